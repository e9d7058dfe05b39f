//! Why the logs and trends of a fleet cannot be found. Each message is one line.

use super::jobs::LOG_ENDS;
use super::table::{CAMPAIGN, JOINT};
use crate::ResultError;
use crate::level_trend::TrendError;
use joint_log::DataError;
use std::io;
use std::path::{Path, PathBuf};

/// Why the logs and trends of a fleet cannot be found.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A file or folder cannot be read or written.
    #[error("{}: {error}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The error of the operating system.
        error: io::Error,
    },
    /// A folder contains no log.
    #[error("{}: found no log, expected files {}", folder.display(), LOG_ENDS.join(", "))]
    NoLog {
        /// The folder.
        folder: PathBuf,
    },
    /// A joint has two trends.
    #[error("{file}: found a second trend of joint {joint}, expected only {first}")]
    SecondTrend {
        /// The second file.
        file: String,
        /// Name of the joint.
        joint: String,
        /// The first file.
        first: String,
    },
    /// The file of a trend cannot be understood.
    #[error(transparent)]
    Trend(#[from] TrendError),
    /// A file is no table.
    #[error("{}: found no text, expected a table in CSV or Parquet, or a folder of logs", table.display())]
    NoText {
        /// The file.
        table: PathBuf,
    },
    /// A table does not name the joints.
    #[error(
        "{}: found no column {JOINT}, expected a table with the columns {JOINT} and {CAMPAIGN}, or a folder of logs",
        table.display()
    )]
    NoJointColumn {
        /// The file.
        table: PathBuf,
    },
    /// A row of a table names no joint.
    #[error("{} row {row}: found no name in column {JOINT}, expected one", table.display())]
    UnnamedRow {
        /// The file.
        table: PathBuf,
        /// Number of the row.
        row: usize,
    },
    /// A table has no rows.
    #[error("{}: found a header and no rows", table.display())]
    NoRows {
        /// The file.
        table: PathBuf,
    },
    /// A Parquet table cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// The log of a joint cannot be copied from a table.
    #[error(transparent)]
    Result(#[from] ResultError),
}

impl FleetError {
    /// Returns how the error of a file is reported.
    pub(super) fn of_file(file: &Path) -> impl Fn(io::Error) -> Self + '_ {
        |error| Self::File { file: file.to_owned(), error }
    }
}
