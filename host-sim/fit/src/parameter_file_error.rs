//! Why a parameter file is refused: the key, what was found and what was expected, in one line.

use crate::spec::SpecError;
use compensator_core::{LawKind, ParameterError};
use std::path::PathBuf;
use toml_edit::Item;

/// Why a parameter file is refused. The message is one line.
#[derive(Debug)]
pub struct ParameterFileError {
    /// The file, if the text comes from one.
    pub file: Option<PathBuf>,
    /// What is wrong.
    pub kind: ParameterFileErrorKind,
}

/// What is wrong with a parameter file.
#[derive(Debug, thiserror::Error)]
pub enum ParameterFileErrorKind {
    /// The file cannot be read.
    #[error("{0}")]
    Io(std::io::Error),
    /// The text is not TOML.
    #[error("{0}")]
    Syntax(toml_edit::TomlError),
    /// The terms of a linear model are wrong.
    #[error("linear: {0}")]
    Linear(toml_edit::de::Error),
    /// The file has a section or a key of another program.
    #[error("unknown key {key:?}, expected {}", expected.join(", "))]
    UnknownSection {
        /// The key.
        key: String,
        /// The known ones.
        expected: Vec<&'static str>,
    },
    /// A section has a key that it does not take.
    #[error("{key}: unknown, expected of {expected}")]
    UnknownKey {
        /// The key with its section.
        key: String,
        /// The known ones.
        expected: String,
    },
    /// A value is of another kind, or outside its range.
    #[error("{key}: {}expected {expected}", found.as_ref().map(|found| format!("found {found}, ")).unwrap_or_default())]
    Value {
        /// The key with its section.
        key: String,
        /// What was found, where that helps.
        found: Option<String>,
        /// What was expected.
        expected: String,
    },
    /// A text is missing.
    #[error("{key}: missing or not a text")]
    NoText {
        /// The key with its section.
        key: String,
    },
    /// A mean belongs to no covariate.
    #[error("log_means.{0}: not a covariate of a log")]
    NoCovariate(String),
    /// A parameter does not belong to the model.
    #[error("{key}: not a parameter of {model}, expected of {expected}")]
    NoParameter {
        /// The key with its section.
        key: String,
        /// The model.
        model: String,
        /// Its parameters.
        expected: String,
    },
    /// The model is unknown, or has too many terms.
    #[error("{0}")]
    Model(#[from] SpecError),
    /// The core refuses a value.
    #[error("{0}")]
    Parameters(#[from] ParameterError),
    /// The network's file cannot be used.
    #[error("network{0}")]
    Network(NetworkRefusal),
}

/// Why the file of a network cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum NetworkRefusal {
    /// The text of the parameter file has no folder.
    #[error(": there is no folder to look for its file in")]
    NoFolder,
    /// The file cannot be read.
    #[error(".file: {}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The file is another one, or was changed.
    #[error(".crc32: {} has {found}, expected {expected}: it is another network, or was changed", path.display())]
    Checksum {
        /// The file.
        path: PathBuf,
        /// Its checksum.
        found: String,
        /// That of the parameter file.
        expected: String,
    },
    /// The network belongs to another law.
    #[error(": supplies {} without terms, and the model is {model}", LawKind::LugreAsymmetric.name())]
    OtherModel {
        /// The model of the parameter file.
        model: String,
    },
}

impl ParameterFileErrorKind {
    pub(crate) fn value(key: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::Value { key: key.into(), found: None, expected: expected.into() }
    }

    pub(crate) fn found(
        key: impl Into<String>,
        found: impl ToString,
        expected: impl Into<String>,
    ) -> Self {
        Self::Value { key: key.into(), found: Some(found.to_string()), expected: expected.into() }
    }

    pub(crate) fn unknown(key: impl Into<String>, expected: impl Into<String>) -> Self {
        Self::UnknownKey { key: key.into(), expected: expected.into() }
    }
}

/// Returns a finite number.
pub(crate) fn number(item: &Item) -> Option<f64> {
    item.as_float().or_else(|| item.as_integer().map(|i| i as f64)).filter(|x| x.is_finite())
}

impl std::fmt::Display for ParameterFileError {
    /// Joins the lines: a key or text of the file may contain line ends.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{}: ", file.display())?;
        }
        let lines = self.kind.to_string();
        f.write_str(&lines.lines().map(str::trim).collect::<Vec<_>>().join(" "))
    }
}

impl std::error::Error for ParameterFileError {}

impl From<ParameterFileErrorKind> for ParameterFileError {
    fn from(kind: ParameterFileErrorKind) -> Self {
        Self { file: None, kind }
    }
}

impl From<ParameterFileErrorKind> for String {
    fn from(kind: ParameterFileErrorKind) -> Self {
        ParameterFileError::from(kind).to_string()
    }
}
