//! Why a result cannot be made. Each message is one line.

use std::error::Error;
use std::io;
use std::path::PathBuf;

/// Why the files of a command cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum ResultError {
    /// A value cannot be represented in JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// The Parquet library rejects a table.
    #[cfg(feature = "rows")]
    #[error(transparent)]
    Table(#[from] parquet::errors::ParquetError),
    /// The core rejects the model, or it cannot be applied to the log.
    #[error("{0}")]
    Model(Box<dyn Error + Send + Sync>),
    /// A file cannot be read or written.
    #[error("{}: {}", .0.display(), .1)]
    File(PathBuf, io::Error),
}

impl ResultError {
    /// Returns how the error of a model is reported.
    pub fn of_model(error: impl Into<Box<dyn Error + Send + Sync>>) -> Self {
        Self::Model(error.into())
    }

    /// Returns how the error of a file is reported.
    #[cfg(feature = "fleet")]
    pub(crate) fn of_file(file: &std::path::Path) -> impl Fn(io::Error) -> Self + '_ {
        |error| Self::File(file.to_owned(), error)
    }
}

/// Reports an error where a front end expects its line.
macro_rules! as_line {
    ($error:ty) => {
        impl From<$error> for friction_diagnose::prepare::Error {
            fn from(error: $error) -> Self {
                Self::Request(error.to_string())
            }
        }
    };
}

pub(crate) use as_line;

as_line!(ResultError);
