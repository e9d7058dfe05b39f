//! Why a log, a table or a machine cannot be graded. Each message is one line.

use friction_diagnose::prepare;
use friction_fit::spec::SpecError;
use joint_log::{ColumnsError, DataError};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Why a log, a table or a machine cannot be graded.
#[derive(Debug, thiserror::Error)]
pub enum GradingError {
    /// A log cannot be read, is refused by the product, or cannot be split or diagnosed.
    #[error(transparent)]
    Log(#[from] prepare::Error),
    /// A file or folder cannot be read or written.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// A file is not JSON, or lacks a key.
    #[error("{}: {error}", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Why.
        error: serde_json::Error,
    },
    /// The columns of a drawn log do not fit together.
    #[error(transparent)]
    Columns(#[from] ColumnsError),
    /// An error of this log, scenario or table.
    #[error("{0}: {1}")]
    Of(String, Box<Self>),
    /// No thread can be created.
    #[error(transparent)]
    Thread(#[from] rayon::ThreadPoolBuildError),
    /// An argument of a log has no value.
    #[error("{0}: missing value")]
    NoValue(String),
    /// An argument of a log is not among those that are graded.
    #[error("unknown argument {0}")]
    UnknownArgument(String),
    /// The value of an argument of a log cannot be parsed.
    #[error("{name}: found {found:?}, expected {expected}")]
    Value {
        /// The argument.
        name: String,
        /// Its value.
        found: String,
        /// What it should be.
        expected: &'static str,
    },
    /// A table of evidence is of another version.
    #[error("the columns are not those of this version: collect the evidence again")]
    OtherEvidence,
    /// The head of a table is another one.
    #[error("the head is not {0:?}")]
    Head(&'static str),
    /// A line of a table cannot be parsed.
    #[error("line {line}: expected {expected}")]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// What it should have.
        expected: String,
    },
    /// A log or a result lacks a column.
    #[error("no column {0}")]
    NoColumn(String),
    /// A column of a result has no numbers.
    #[error("{0}: not numbers")]
    NotNumbers(&'static str),
    /// A command of the product wrote no result: the last line of its errors.
    #[error("no result: {0}")]
    NoResult(String),
    /// The product predicts too few of the judging rows: the share without a prediction.
    #[error("no prediction for {:.0} % of the rows", 100.0 * .0)]
    FewPredictions(f64),
    /// Simulated logs have no answer. None may be dropped from a count.
    #[error("{0} worlds had no answer")]
    NoAnswers(usize),
    /// The full measured logs are not there.
    #[error("no measured logs: set MEASURED_DATA to their folder")]
    NoMeasuredLogs,
}

impl GradingError {
    /// Returns how the error of a file or folder is reported.
    pub fn io(path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        move |error| Self::Io { path: path.as_ref().to_owned(), error }
    }

    /// Adds the name of a log, scenario or table.
    #[must_use]
    pub fn of(self, name: impl Into<String>) -> Self {
        Self::Of(name.into(), Box::new(self))
    }
}

impl From<DataError> for GradingError {
    fn from(error: DataError) -> Self {
        Self::Log(error.into())
    }
}

impl From<SpecError> for GradingError {
    fn from(error: SpecError) -> Self {
        Self::Log(error.into())
    }
}

/// Ends a program: prints the error, if there is one.
pub fn end(result: Result<(), GradingError>) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
