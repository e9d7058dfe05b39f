//! Why a command has no result.

use super::words::{in_options, text_in_options};
use friction_diagnose::prepare;
use friction_fit::spec::SpecError;
use joint_log::DataError;
use std::borrow::Cow;
use std::error::Error;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Result of a part of a command.
pub type Result<T = (), E = CommandError> = std::result::Result<T, E>;

/// Why a command has no result, as one line for the user. The program then ends with exit code 2. A check that fails is a
/// result: the command returns exit code 1.
///
/// It is a [`Refusal`] of the command line itself, or the error of a library. Every error converts to it with `?`. The
/// settings in a message are named as options.
#[derive(Debug)]
pub struct CommandError(Box<dyn Error + Send + Sync>);

impl<E: Into<Box<dyn Error + Send + Sync>>> From<E> for CommandError {
    fn from(error: E) -> Self {
        Self(error.into())
    }
}

impl fmt::Display for CommandError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let error = &*self.0;
        let worded = (error.downcast_ref::<prepare::Error>().map(in_options))
            .or_else(|| error.downcast_ref::<DataError>().map(in_options))
            .or_else(|| error.downcast_ref::<SpecError>().map(in_options));
        f.write_str(&worded.unwrap_or_else(|| text_in_options(&error.to_string())))
    }
}

/// What the command line itself refuses.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// The value of an argument, an option or a file.
    #[error("{argument}: found {found}, expected {expected}")]
    Value { argument: String, found: String, expected: Cow<'static, str> },
    /// An option, a file or a joint that does not fit the command.
    #[error("{subject}: {reason}")]
    Unfit { subject: String, reason: Cow<'static, str> },
    /// A file or folder that cannot be read or written.
    #[error("{}: {source}", path.display())]
    File { path: PathBuf, source: io::Error },
    /// One of several parts, such as a joint, with its error.
    #[error("{part}: {reason}")]
    Part { part: String, reason: CommandError },
    /// What needs a cargo feature, with the command that builds with it.
    #[error("{what}: not in this build, which lacks the {with_command}")]
    Feature { what: String, with_command: String },
    /// A result that cannot be printed.
    #[error("standard output: {0}")]
    Output(#[source] io::Error),
    /// Signals that cannot be caught.
    #[error("Ctrl-C: {0}")]
    Signals(#[from] ctrlc::Error),
    /// The user answered no.
    #[error("cancelled; nothing was changed")]
    Declined,
    /// A question without a terminal to answer it.
    #[error("{0} Standard input is not a terminal: use --yes to confirm")]
    NoTerminal(String),
}

/// Returns the error of a value that is not accepted.
pub fn found(
    argument: impl Into<String>,
    found: impl Into<String>,
    expected: impl Into<Cow<'static, str>>,
) -> CommandError {
    let (argument, found) = (argument.into(), found.into());
    Refusal::Value { argument, found, expected: expected.into() }.into()
}

/// Returns the error of an option, a file or a joint that does not fit the command.
pub fn unfit(subject: impl fmt::Display, reason: impl Into<Cow<'static, str>>) -> CommandError {
    Refusal::Unfit { subject: subject.to_string(), reason: reason.into() }.into()
}

/// Returns how the error of a file names it.
pub fn in_file(path: &Path) -> impl Fn(io::Error) -> CommandError {
    move |source| Refusal::File { path: path.to_owned(), source }.into()
}

/// Returns how the error of one of several parts names it.
pub fn in_part<E: Into<CommandError>>(part: impl fmt::Display) -> impl FnOnce(E) -> CommandError {
    move |error| Refusal::Part { part: part.to_string(), reason: error.into() }.into()
}
