//! Errors of a network: of its file, of its inputs, of the core's validation.

use compensator_core::network::MAX_INPUTS;
use compensator_core::parameters::ParameterError;
use friction_diagnose::prepare::Error;
use std::path::PathBuf;

/// Why a network cannot be read, trained or used; one line.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The text of a file is not JSON, or has other fields.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A number of a file is not the only one that is supported.
    #[error("{field}: found {found}, expected {expected}")]
    Number {
        /// Its field.
        field: &'static str,
        /// Its value.
        found: usize,
        /// The supported value.
        expected: usize,
    },
    /// A file has no inputs, or too many.
    #[error("inputs: found {0}, expected 1 to {MAX_INPUTS}")]
    InputCount(usize),
    /// A list of a file has another length than its inputs need.
    #[error("{field}: found {found}, expected {expected} for {inputs} inputs")]
    Length {
        /// Its field.
        field: &'static str,
        /// Its length.
        found: usize,
        /// The length for these inputs.
        expected: usize,
        /// Number of inputs.
        inputs: usize,
    },
    /// The factors of a file are others, or in another order.
    #[error("factors: found {found:?}, expected {expected:?}")]
    Factor {
        /// Name of the first factor that differs.
        found: String,
        /// The expected name.
        expected: &'static str,
    },
    /// The period of the evaluations is no time.
    #[error("evaluation_period_s: found {0}, expected more than 0")]
    EvaluationPeriod(f64),
    /// The core refuses a value.
    #[error(transparent)]
    Refused(#[from] ParameterError),
    /// A driver has no such input.
    #[error("inputs: a driver does not measure {0:?}")]
    NotMeasured(String),
    /// A driver has one input for a column of its own.
    #[error(
        "inputs: {0:?} and {1:?} are custom columns of this log, and a driver has only one custom input, its auxiliary covariate"
    )]
    TwoCustomInputs(String, String),
    /// The file that a parameter file names is invalid.
    #[error("network.file: {}: {error}", .path.display())]
    File {
        /// Its path.
        path: PathBuf,
        /// What is wrong with it.
        error: Box<NetworkError>,
    },
    /// The log lacks an input.
    #[error("{0}: not a column of the log, and the network reads it")]
    NoColumn(String),
    /// The inputs are to be chosen by the log, which has none, or too many.
    #[error("--inputs: the log has {0} covariates, name 1 to {MAX_INPUTS} inputs")]
    Covariates(usize),
    /// Too many inputs are named.
    #[error("--inputs: found {0}, expected at most {MAX_INPUTS}")]
    TooManyInputs(usize),
    /// The log has no such input.
    #[error("--inputs: found {found:?}, expected one of {}", .known.join(", "))]
    UnknownInput {
        /// The given name.
        found: String,
        /// The inputs that the log has.
        known: Vec<String>,
    },
    /// A training ends with a loss that is no number: a run has such a value, or the weights have diverged.
    #[error("training: the loss of the last pass is {0}, expected a finite number")]
    Loss(f64),
}

impl From<NetworkError> for Error {
    fn from(error: NetworkError) -> Self {
        Self::Request(error.to_string())
    }
}
