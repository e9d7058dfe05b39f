//! Compares the diagnosis with the regression on measured logs with a known answer.
//!
//! `tests/data` has excerpts of the logs; `measured_logs` finds them and the full files, whose README states what is known of
//! each, and by whom. A log can contain several effects, and each of them may be named first.

use super::GradingError;
use super::contest::{self, time_on_one_thread};
use super::diagnose_log;
use super::regression::regress;
use compensator_core::TermKind;
use friction_diagnose::DiagnosisOptions;
use friction_diagnose::prepare::PrepareOptions;
use joint_log::{Dataset, ReadOptions, SplitRule, read};
use measured_logs::MeasuredLogs;

/// A log with its reading options and known causes.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredLog {
    /// File name.
    pub file: &'static str,
    columns: &'static [(&'static str, &'static str)],
    rigid_body: &'static [TermKind],
    /// First rows that are skipped and decimation, for the full file. The excerpt has been decimated so.
    skip: usize,
    decimate: usize,
    /// Causes that may be named first; if empty, only `none` is wrong.
    pub known: &'static [&'static str],
}

const LOG: MeasuredLog =
    MeasuredLog { file: "", columns: &[], rigid_body: &[], skip: 0, decimate: 1, known: &[] };

const EMPS: MeasuredLog = MeasuredLog {
    columns: &[
        ("time_s", "t_s"),
        ("position_m", "q_m"),
        ("force_n", "motor_force_N"),
        ("velocity_m_s", "vel_m_per_s"),
        ("acceleration_m_s2", "acc_m_per_s2"),
    ],
    rigid_body: &[TermKind::UnmodelledInertia, TermKind::TorqueOffset],
    skip: 49,
    decimate: 10,
    known: &["direction-asymmetry"],
    ..LOG
};

const ROBOT_AXIS: MeasuredLog = MeasuredLog {
    rigid_body: &[TermKind::UnmodelledInertia, TermKind::LoadGain, TermKind::TorqueOffset],
    ..LOG
};

/// Ripples that scale the friction level or add to it; only for the cogging motor it is known which.
const RIPPLE_CAUSES: &[&str] = &["torque-ripple", "position-ripple"];

/// All logs with the causes that their README states.
pub const MEASURED_LOGS: &[MeasuredLog] = &[
    MeasuredLog { file: "seal-oring.csv", known: &["pressure-coulomb"], ..LOG },
    MeasuredLog { file: "seal-kdn.csv", known: &["pressure-coulomb"], ..LOG },
    MeasuredLog { file: "emps-train.csv", ..EMPS },
    MeasuredLog { file: "emps-pulses.csv", ..EMPS },
    MeasuredLog { file: "worm-drive.csv", known: &["direction-asymmetry"], ..LOG },
    MeasuredLog {
        file: "servo-pendulum.csv",
        columns: &[("torque_nm", "drive_voltage_v")],
        rigid_body: &[TermKind::LoadGain, TermKind::TorqueOffset],
        known: &["load-torque-coulomb"],
        ..LOG
    },
    MeasuredLog {
        file: "bldc-cogging.csv",
        rigid_body: &[TermKind::UnmodelledInertia, TermKind::TorqueOffset],
        known: &["torque-ripple"],
        ..LOG
    },
    MeasuredLog {
        file: "screw-antibacklash.csv",
        rigid_body: &[TermKind::TorqueOffset],
        known: RIPPLE_CAUSES,
        ..LOG
    },
    // The friction level over the preset tension follows a column without a cause of its own: `unknown`.
    MeasuredLog { file: "damper-1-actuators.csv", known: &["backlash", "unknown"], ..LOG },
    MeasuredLog { file: "damper-1.csv", known: &["backlash", "unknown"], ..LOG },
    MeasuredLog { file: "damper-2.csv", known: &["backlash", "direction-asymmetry"], ..LOG },
    MeasuredLog { file: "damper-quakes.csv", known: &["backlash", "direction-asymmetry"], ..LOG },
    MeasuredLog { file: "robot-axis1.csv", known: RIPPLE_CAUSES, ..ROBOT_AXIS },
    MeasuredLog { file: "robot-axis2.csv", ..ROBOT_AXIS },
    MeasuredLog {
        file: "robot-axis3.csv",
        known: &["direction-asymmetry", "torque-ripple", "position-ripple"],
        ..ROBOT_AXIS
    },
];

/// Answer of the diagnosis or the regression for a measured log.
#[derive(Clone, Debug)]
pub struct MeasuredAnswer {
    /// Named causes, with their columns.
    pub named: Vec<String>,
    /// First cause.
    pub first: &'static str,
    /// Reduction of the held-out error.
    pub gain: f64,
    /// Processor time, s.
    pub seconds: f64,
    /// Best candidates, one line.
    pub candidates: String,
}

/// Both answers for a measured log.
#[derive(Clone, Debug)]
pub struct MeasuredContest {
    /// Rows of the log.
    pub rows: usize,
    /// Answer of the diagnosis, if it was run.
    pub ours: Option<MeasuredAnswer>,
    /// Answer of the regression.
    pub rival: MeasuredAnswer,
}

impl MeasuredLog {
    /// Returns true if the first cause is a known one.
    pub fn is_right(&self, first: &str) -> bool {
        if self.known.is_empty() { first != "none" } else { self.known.contains(&first) }
    }

    /// Returns how the full file is read and prepared.
    pub fn options(&self) -> PrepareOptions {
        let pair = |(ours, theirs): &(&str, &str)| ((*ours).to_owned(), (*theirs).to_owned());
        let columns = self.columns.iter().map(pair).collect();
        PrepareOptions {
            read: ReadOptions { columns, skip: self.skip, ..ReadOptions::default() },
            rigid_body: self.rigid_body.to_vec(),
            decimate: self.decimate,
            split: SplitRule::LeaveOneRunOut,
            ..PrepareOptions::default()
        }
    }

    /// Returns the known causes for a table.
    pub fn known(&self) -> String {
        if self.known.is_empty() { "not `none`".into() } else { self.known.join(" or ") }
    }

    /// Reads the log with its options for the diagnosis; `None` if the file does not exist.
    ///
    /// # Errors
    /// Returns an error if the log cannot be read.
    pub fn read(
        &self,
        logs: &MeasuredLogs,
    ) -> Result<Option<(Dataset, DiagnosisOptions)>, GradingError> {
        let path = logs.file(self.file);
        if !path.is_file() {
            return Ok(None);
        }
        let mut options = self.options();
        if !logs.is_full() {
            (options.read.skip, options.decimate) = (0, 1);
        }
        let data = read(&[path], &options.read, &|_, _| {}).map_err(|error| self.failed(error))?;
        let PrepareOptions { decimate, rigid_body, .. } = options;
        Ok(Some((data, DiagnosisOptions { decimate, rigid_body, ..DiagnosisOptions::default() })))
    }

    fn failed(&self, error: impl Into<GradingError>) -> GradingError {
        error.into().of(self.file)
    }

    /// Runs the regression, and unless `rival_only` the diagnosis; `None` if the file does not exist.
    ///
    /// # Errors
    /// Returns an error if the log cannot be read, split or diagnosed.
    pub fn contest(
        &self,
        logs: &MeasuredLogs,
        rival_only: bool,
    ) -> Result<Option<MeasuredContest>, GradingError> {
        let Some((data, question)) = self.read(logs)? else { return Ok(None) };
        let rows = data.rows;
        let (found, seconds) = time_on_one_thread(|| regress(&data, self.rigid_body))?;
        let rival = MeasuredAnswer {
            first: found.named.first().copied().unwrap_or("none"),
            named: found.named.iter().map(|name| (*name).to_owned()).collect(),
            gain: found.gain,
            seconds,
            candidates: found.describe(),
        };
        if rival_only {
            return Ok(Some(MeasuredContest { rows, ours: None, rival }));
        }
        let (answer, seconds) = time_on_one_thread(|| diagnose_log(data, &question))?;
        let (found, _) = answer.map_err(|error| self.failed(error))?;
        let named = found.findings.iter().map(|finding| {
            let order = finding.order.map(|order| format!(" order {:.1}", order.value));
            let order = order.unwrap_or_default();
            format!("{}({}){order}", finding.cause.name(), finding.columns.join(","))
        });
        let ours = MeasuredAnswer {
            first: found.cause(),
            named: named.collect(),
            gain: found.gain.value,
            seconds,
            candidates: contest::format_candidates(&found),
        };
        Ok(Some(MeasuredContest { rows, ours: Some(ours), rival }))
    }
}
