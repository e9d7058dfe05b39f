//! What can be wrong with a log, said in one line.
//!
//! Whoever reads an error of this module has a file open in an editor next to it. So every
//! message has the same order: the file, the row as the editor counts it (the header is row 1),
//! the column, what stands there, and what should have. A message never spans two lines, however
//! odd the file: [`quoted`] cuts and escapes whatever is repeated from it.
//!
//! A single bad row is not an error. It becomes a [`BadCell`] in [`BadRows`], is left out, and is
//! reported at the end; only too many of them stop the reading.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// How many bad rows are kept by name; the rest are only counted.
pub(super) const NAMED_BAD_ROWS: usize = 5;

/// One place in one file, what was found there and what was expected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadCell {
    /// The file, as it was named by the caller.
    pub file: PathBuf,
    /// The row, counted from 1 with the header as row 1. For Parquet, the row the same table
    /// would have in a CSV file.
    pub row: u64,
    /// The column's name in the file.
    pub column: String,
    /// What stands there, quoted and cut short where it is text.
    pub found: String,
    /// What should stand there.
    pub expected: String,
}

impl fmt::Display for BadCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, row, column, found, expected } = self;
        let (file, column) = (file.display(), one_line(column));
        write!(f, "{file}: row {row}, column {column}: found {found}, expected {expected}")
    }
}

/// The rows that were left out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BadRows {
    /// How many.
    pub count: usize,
    /// The first few of each file by name, in file order; at most one cell per row.
    pub first: Vec<BadCell>,
}

/// Why a log could not be read or split. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum DataError {
    /// The file cannot be opened or read to its end.
    #[error("{}: cannot be read: {}", file.display(), one_line(&source.to_string()))]
    Io {
        /// The file, as it was named by the caller.
        file: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// Something is wrong at one place in the file, and the file is of no use with it.
    #[error("{0}")]
    Cell(BadCell),
    /// More than [`MAX_BAD_SHARE`](super::MAX_BAD_SHARE) of the rows are bad.
    #[error("{first} ({bad} of {rows} rows are bad, this is the first; at most 5 % may be)")]
    TooManyBad {
        /// The first bad row of the file.
        first: BadCell,
        /// How many rows of the file are bad.
        bad: usize,
        /// How many rows the file has.
        rows: usize,
    },
    /// Something is wrong with the file as a whole.
    #[error("{}: found {found}, expected {expected}", file.display())]
    File {
        /// The file, as it was named by the caller.
        file: PathBuf,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// A log of several joints, of which one is to be taken at a time.
    #[error("{}: found {} joints {place} ({}), expected one: --where {column}={}", file.display(), joints.len(), listed(joints), first(joints))]
    SeveralJoints {
        /// The file, as it was named by the caller.
        file: PathBuf,
        /// Where they are, as the end of a sentence.
        place: String,
        /// What [`ReadOptions::only`](super::ReadOptions::only) is to name.
        column: String,
        /// The joints, in the order of the file.
        joints: Vec<String>,
    },
    /// The caller asked for something these data cannot give: an unknown name in `--columns`, a
    /// hold-out that holds nothing out.
    #[error("{what}: found {found}, expected {expected}")]
    Request {
        /// The option or argument.
        what: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
}

/// The first of some names, fit to be typed.
fn first(names: &[String]) -> String {
    names.first().map(|name| listed(std::slice::from_ref(name))).unwrap_or_default()
}

/// An error in the header row.
pub(super) fn at_header(file: &Path, column: &str, found: &str, expected: &str) -> DataError {
    DataError::Cell(BadCell {
        file: file.into(),
        row: 1,
        column: column.into(),
        found: found.into(),
        expected: expected.into(),
    })
}

/// Text from a file, fit to be repeated in a message: one line, at most 40 characters, quoted.
pub(super) fn quoted(bytes: &[u8]) -> String {
    const LONGEST: usize = 40;
    let bytes = bytes.trim_ascii();
    if bytes.is_empty() {
        return "an empty cell".into();
    }
    // Only the start is looked at: an unclosed quote can make a cell as long as the file.
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * LONGEST)]);
    let mut short: String = text.chars().take(LONGEST).collect();
    if short.len() < bytes.len() && text.chars().count() > LONGEST {
        short.push_str("..");
    }
    format!("\"{}\"", one_line(&short))
}

/// The text with control characters and line ends written as escapes.
pub(super) fn one_line(text: &str) -> String {
    let mut line = String::with_capacity(text.len());
    for c in text.chars() {
        if c.is_control() || c == '\u{2028}' || c == '\u{2029}' {
            line.extend(c.escape_default());
        } else {
            line.push(c);
        }
    }
    line
}

/// A list of names for a message; a long one is cut.
pub(super) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const LONGEST: usize = 30;
    if names.is_empty() {
        return "none".into();
    }
    let shown: Vec<String> = names
        .iter()
        .take(LONGEST)
        .map(|name| {
            let name: String = name.as_ref().chars().take(40).collect();
            one_line(&name)
        })
        .collect();
    let more = names.len().saturating_sub(LONGEST);
    if more > 0 { format!("{} and {more} more", shown.join(", ")) } else { shown.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_told_in_one_line_with_file_row_and_column() {
        let cell = BadCell {
            file: "a.csv".into(),
            row: 7,
            column: "torque\nnm".into(),
            found: quoted(b" off\r\nline "),
            expected: "a finite number".into(),
        };
        let said = cell.to_string();
        let expected =
            r#"a.csv: row 7, column torque\nnm: found "off\r\nline", expected a finite number"#;
        assert_eq!(said, expected);
    }

    #[test]
    fn long_text_is_cut_and_an_empty_cell_has_a_name() {
        assert_eq!(quoted(b"   "), "an empty cell");
        let said = quoted("é".repeat(1000).as_bytes());
        assert!(said.chars().count() < 50, "{said}");
        assert!(said.ends_with("..\""));
    }

    #[test]
    fn a_long_list_of_names_is_cut() {
        let names: Vec<String> = (0..100).map(|i| format!("c{i}")).collect();
        assert!(listed(&names).ends_with("and 70 more"));
        assert_eq!(listed::<&str>(&[]), "none");
    }
}
