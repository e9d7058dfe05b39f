//! Why an experiment cannot be repeated. Each message is one line.

use joint_rig::RigError;
use std::error::Error;

/// Why an experiment cannot be repeated.
#[derive(Debug, thiserror::Error)]
pub enum PaperError {
    /// A log, a fit, a diagnosis or a simulated machine reports an error.
    #[error(transparent)]
    Source(Box<dyn Error + Send + Sync>),
    /// The driver rejects a set, does not arm, or does not answer.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// An error of this joint or arm.
    #[error("{0}: {1}")]
    Of(String, Box<Self>),
    /// A driver of a comparison is missing.
    #[error("an arm is missing")]
    NoArm,
    /// An experiment has no repeats.
    #[error("no seeds")]
    NoSeeds,
    /// The tests lack a column that a network reads.
    #[error("found no column {0}, an input of the network")]
    NoCovariate(&'static str),
    /// The simulation is not among the known ones.
    #[error("no damper")]
    NoDamper,
    /// A driver accepts parameters while it moves.
    #[error("an armed driver took parameters")]
    TookParameters,
    /// A driver has other parameters than those written.
    #[error("the driver reads back another set")]
    ReadsBack,
    /// A log has no rows to fit, or none to evaluate.
    #[error("no unbroken stretch of two rows or more to fit, or none to evaluate")]
    NoRows,
    /// No model has the first name; the second lists the known ones.
    #[error("--inside manipulator: found model {0:?}, expected of {1}")]
    UnknownModel(String, String),
    /// The log has other joints than the arm.
    #[error("--inside manipulator: found joints {0}, expected three")]
    Joints(String),
    /// A log has no run to fit, or none to evaluate.
    #[error("--inside manipulator: no run to fit, or none to evaluate; whole runs are held out")]
    NoRuns,
    /// A joint lacks something in a run.
    #[error("joint {joint}: run {run}: found no {missing}")]
    Missing {
        /// Name of the joint.
        joint: String,
        /// Name of the run.
        run: String,
        /// A column, or rows.
        missing: String,
    },
    /// A run has different numbers of rows: the run, the rows found, their joint, and the rows of the first joint.
    #[error("run {0}: found {1} rows of joint {2}, expected {3} as of the first")]
    UnequalRows(String, usize, String, usize),
    /// A run, with this number of rows, is too short.
    #[error("run {0}: found {1} rows, expected two or more")]
    ShortRun(String, usize),
    /// The rows of a run are not equally spaced.
    #[error(
        "run {run}, row {row}: found a step of {step_s:.6} s, expected {period_s:.6} s: a trajectory is simulated in even steps"
    )]
    UnevenSteps {
        /// Name of the run.
        run: String,
        /// Number of the row.
        row: usize,
        /// Time since the row before, s.
        step_s: f64,
        /// Mean time between two rows, s.
        period_s: f64,
    },
}

impl PaperError {
    /// Returns how an error of another package is reported.
    pub(crate) fn source(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Source(error.into())
    }

    /// Adds the name of the joint or arm.
    pub(crate) fn of(self, name: impl Into<String>) -> Self {
        Self::Of(name.into(), Box::new(self))
    }
}

impl From<PaperError> for String {
    fn from(error: PaperError) -> Self {
        error.to_string()
    }
}

impl From<PaperError> for friction_diagnose::prepare::Error {
    fn from(error: PaperError) -> Self {
        Self::Request(error.to_string())
    }
}
