//! Why the logs and trends of a fleet cannot be found. Each message is one line.

use super::{CAMPAIGN, JOINT, LOG_ENDS};
use crate::ResultError;
use crate::level_trend::TrendError;
use joint_log::DataError;
use std::path::PathBuf;

/// Why the logs and trends of a fleet cannot be found. A variant with a path has that of the file or folder.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A folder contains no log.
    #[error("{}: found no log, expected files {}", .0.display(), LOG_ENDS.join(", "))]
    NoLog(PathBuf),
    /// A joint has two trends.
    #[error("{}: found a second trend of joint {joint}, expected only {}", .file.display(), .first.display())]
    SecondTrend {
        /// File of the second trend.
        file: PathBuf,
        /// The joint.
        joint: String,
        /// File of the first trend.
        first: PathBuf,
    },
    /// The file of a trend cannot be understood.
    #[error(transparent)]
    Trend(#[from] TrendError),
    /// A file is no table.
    #[error("{}: found no text, expected a table in CSV or Parquet, or a folder of logs", .0.display())]
    NoText(PathBuf),
    /// A table does not name the joints.
    #[error(
        "{}: found no column {JOINT}, expected a table with the columns {JOINT} and {CAMPAIGN}, or a folder of logs",
        .0.display()
    )]
    NoJointColumn(PathBuf),
    /// A row of a table, with its number, names no joint.
    #[error("{} row {}: found no name in column {JOINT}, expected one", .0.display(), .1)]
    UnnamedRow(PathBuf, usize),
    /// A table has no rows.
    #[error("{}: found a header and no rows", .0.display())]
    NoRows(PathBuf),
    /// A Parquet table cannot be read.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A file cannot be read or written, or a log cannot be copied from a table.
    #[error(transparent)]
    Result(#[from] ResultError),
}

crate::error::as_line!(FleetError);
