//! Options for reading logs.

use super::preset::kind::Preset;

/// How files are read.
#[derive(Debug, Clone, Default)]
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
    /// The torque of 100 %, Nm, for a preset with torques in percent.
    pub rated_torque_nm: Option<f64>,
    /// True to describe the columns instead of reading them; [`survey`](super::survey) sets it.
    #[doc(hidden)]
    pub is_survey: bool,
}
