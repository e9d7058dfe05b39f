//! Options for reading logs.

use super::preset::kind::Preset;
use super::servo_torque::ServoTorque;
use super::torque_constant::TorqueConstant;

/// Maximum share of bad rows in a file, unless [`ReadOptions`] gives another. Above it, the file is probably misread and
/// reading fails.
pub const MAX_BAD_SHARE: f64 = 0.05;

/// How files are read.
#[derive(Debug, Clone)]
pub struct ReadOptions {
    /// Pairs of contract name and column name. The latter may be followed by a unit (`dq_3:deg/s`), and by the element
    /// of a list (`velocity[2]`).
    pub columns: Vec<(String, String)>,
    /// Row selection: only rows in which each of these columns holds one of its values are read.
    pub only: Vec<(String, Vec<String>)>,
    /// Number of samples to drop at the start of each run.
    pub skip: usize,
    /// Number of lines of text above the header that are not read.
    pub skip_lines: usize,
    /// The tool that wrote the log; supplies names and units that [`Self::columns`] does not.
    pub preset: Option<Preset>,
    /// Rate of the rows, Hz. The rows are counted, and a time column is not read.
    pub rate_hz: Option<f64>,
    /// The torque of 100 %, Nm, for torques in percent.
    pub rated_torque_nm: Option<f64>,
    /// The torque of one ampere, for torques in amperes.
    pub torque_constant: Option<TorqueConstant>,
    /// The servo whose control law gives the torque, in a log without one.
    pub torque_from: Option<ServoTorque>,
    /// Maximum share of bad rows in a file, 0 to 1.
    pub max_bad_share: f64,
    /// True to join files that hold one channel each by their times.
    pub join: bool,
}

/// Returns true if the column of a pair of `--columns` is that of a name, perhaps followed by a unit.
pub(super) fn refers_to(theirs: &str, name: &str) -> bool {
    theirs.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with(':'))
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            columns: Vec::new(),
            only: Vec::new(),
            skip: 0,
            skip_lines: 0,
            preset: None,
            rate_hz: None,
            rated_torque_nm: None,
            torque_constant: None,
            torque_from: None,
            max_bad_share: MAX_BAD_SHARE,
            join: false,
        }
    }
}
