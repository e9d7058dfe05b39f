//! Errors of reading a log, as messages of one line.
//!
//! The reader of a message usually has the file open in an editor. So every message has the same order: the file, the
//! row as the editor counts it (the header is row 1), the column, what was found and what was expected. A message is
//! always one line: [`quoted`] truncates and escapes all text that is repeated from the file.
//!
//! A single bad row is not an error. It becomes a [`BadCell`] in [`BadRows`], is left out and reported. Only too many
//! bad rows stop the reading.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use crate::setting::{Message, Setting, plain};

/// Number of bad rows that are reported in detail; the others are only counted.
pub(super) const NAMED_BAD_ROWS: usize = 5;

/// A cell of a file, what was found there and what was expected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadCell {
    /// The file, as given by the caller.
    pub file: PathBuf,
    /// The row, counted from 1 with the header as row 1. For Parquet, the row of the same table as a CSV file.
    pub row: u64,
    /// The column's name in the file.
    pub column: String,
    /// What was found; quoted and truncated if it is text.
    pub found: String,
    /// What was expected.
    pub expected: String,
}

impl fmt::Display for BadCell {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&plain(&self.marked()))
    }
}

impl Message for BadCell {
    fn marked(&self) -> String {
        let Self { file, row, column, found, expected } = self;
        let (file, column) = (file.display(), one_line(column));
        format!("{file}: row {row}, column {column}: found {found}, expected {expected}")
    }
}

/// The rows that were left out.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BadRows {
    /// Number of rows.
    pub count: usize,
    /// The first rows of each file in detail, in file order, with one cell per row.
    pub first: Vec<BadCell>,
}

/// Why a log could not be read or split. Each message is one line. A front end names the settings in it by
/// [`Message::worded`].
#[derive(Debug)]
pub enum DataError {
    /// The file cannot be opened or read to its end.
    Io {
        /// The file, as given by the caller.
        file: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A cell is invalid, and the file cannot be used because of it.
    Cell(BadCell),
    /// Too many of the rows are bad.
    TooManyBad {
        /// The first bad row of the file.
        first: Box<BadCell>,
        /// Number of bad rows of the file.
        bad: usize,
        /// Number of rows of the file.
        rows: usize,
        /// Maximum share of bad rows.
        max_share: f64,
    },
    /// The file as a whole is invalid.
    File {
        /// The file, as given by the caller.
        file: PathBuf,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// Required columns are missing.
    MissingColumns {
        /// The file, as given by the caller.
        file: PathBuf,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
        /// The suggested pairs for them, a part of what was expected.
        pairs: Box<str>,
        /// The contract names of the missing columns.
        missing: Vec<&'static str>,
        /// Number of columns of the file.
        count: usize,
    },
    /// The log holds several joints, of which one must be selected.
    SeveralJoints {
        /// The file, as given by the caller.
        file: PathBuf,
        /// Where the joints are, as the end of a sentence.
        place: String,
        /// The column to use in [`ReadOptions::only`](super::ReadOptions::only).
        column: String,
        /// The joints, in the order of the file.
        joints: Vec<String>,
    },
    /// The file is in a format that this build does not read, because it lacks the format's feature.
    LeftOut {
        /// The file, as given by the caller.
        file: PathBuf,
        /// The format, with an article.
        format: &'static str,
        /// The feature of this crate that reads it.
        feature: &'static str,
    },
    /// The request cannot be met with these data: for example an unknown name in `--columns`, or a hold-out that
    /// selects no rows.
    Request {
        /// The option or argument.
        what: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
}

impl DataError {
    /// Returns the error of a file that is invalid as a whole.
    pub(super) fn file(
        file: impl Into<PathBuf>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::File { file: file.into(), found: found.into(), expected: expected.into() }
    }

    /// Returns the error of a request. `what` is the option or argument.
    pub(super) fn request(
        what: impl Into<String>,
        found: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Request { what: what.into(), found: found.into(), expected: expected.into() }
    }

    /// Adds a sentence to what was expected.
    pub(super) fn with_hint(mut self, hint: &str) -> Self {
        if let Self::Cell(BadCell { expected, .. })
        | Self::File { expected, .. }
        | Self::MissingColumns { expected, .. }
        | Self::Request { expected, .. } = &mut self
        {
            *expected += "; ";
            *expected += hint;
        }
        self
    }
}

impl Message for DataError {
    fn marked(&self) -> String {
        match self {
            Self::Io { file, source } => {
                format!("{}: cannot be read: {}", file.display(), one_line(&source.to_string()))
            }
            Self::Cell(cell) => cell.marked(),
            Self::TooManyBad { first, bad, rows, max_share } => format!(
                "{} ({bad} of {rows} rows are bad, this is the first; at most {} % may be{})",
                first.marked(),
                (1e3 * max_share).round() / 10.0,
                bad_rows_option(*bad, *rows)
            ),
            Self::File { file, found, expected }
            | Self::MissingColumns { file, found, expected, .. } => {
                format!("{}: found {found}, expected {expected}", file.display())
            }
            Self::SeveralJoints { file, place, column, joints } => format!(
                "{}: found {} joints {place} ({}), expected one: {}",
                file.display(),
                joints.len(),
                listed(joints),
                Setting::Where
                    .given(format!("{column}={}", listed(&joints[..joints.len().min(1)])))
            ),
            Self::LeftOut { file, format, feature } => format!(
                "{}: {format}: not in this build, which lacks the {}",
                file.display(),
                Setting::Feature.suggested(feature)
            ),
            Self::Request { what, found, expected } => {
                format!("{what}: found {found}, expected {expected}")
            }
        }
    }
}

impl fmt::Display for DataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&plain(&self.marked()))
    }
}

impl std::error::Error for DataError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}

impl BadRows {
    /// Counts a row.
    pub(super) fn add(&mut self, cell: impl FnOnce() -> BadCell) {
        self.count += 1;
        if self.first.len() < NAMED_BAD_ROWS {
            self.first.push(cell());
        }
    }

    /// Adds other rows of the file.
    pub(super) fn extend(&mut self, others: Self) {
        self.count += others.count;
        self.first.extend(others.first);
        self.sort();
    }

    /// Keeps the first rows in file order, with one cell each.
    pub(super) fn sort(&mut self) {
        self.first.sort_by_key(|cell| cell.row);
        self.first.dedup_by_key(|cell| cell.row);
        self.first.truncate(NAMED_BAD_ROWS);
    }

    /// Returns an error if too many of `rows` rows are bad.
    pub(super) fn check(&self, rows: usize, max_share: f64) -> Result<(), DataError> {
        let bad = self.count;
        let Some(first) = self.first.first().filter(|_| is_too_bad(bad, rows, max_share)) else {
            return Ok(());
        };
        Err(DataError::TooManyBad { first: Box::new(first.clone()), bad, rows, max_share })
    }
}

/// Returns true if too many rows are bad.
fn is_too_bad(bad: usize, rows: usize, max_share: f64) -> bool {
    // A limit of 29 % allows 29 of 100 rows, though 0.29 times 100 is rounded to less.
    bad as f64 > max_share * rows as f64 * (1.0 + 1e-9)
}

/// Minimum number of good rows beside which most rows may be bad. A few rows are no log.
const MIN_GOOD_ROWS: usize = 20;

/// Returns the option that leaves the bad rows out. Where most rows are bad, the file may be misread.
fn bad_rows_option(bad: usize, rows: usize) -> String {
    let percent = (100 * bad).div_ceil(rows.max(1));
    if percent >= 100 || percent >= 50 && rows - bad < MIN_GOOD_ROWS {
        return String::new();
    }
    let doubt = if percent >= 50 { "if the other rows are read correctly, " } else { "" };
    format!("; {doubt}{} leaves them out", Setting::BadRows.suggested(format!("{percent}%")))
}

/// Returns a reference to a selection of rows, for a message.
pub(super) fn asked_rows(column: &str, values: &[String]) -> String {
    Setting::Where.given(format!("{column}={}", values.join(",")))
}

/// Creates an error in the header row.
pub(super) fn at_header(file: &Path, column: &str, found: &str, expected: &str) -> DataError {
    DataError::Cell(BadCell {
        file: file.into(),
        row: 1,
        column: column.into(),
        found: found.into(),
        expected: expected.into(),
    })
}

/// Quotes text from a file for a message: one line, at most 40 characters.
pub(super) fn quoted(bytes: &[u8]) -> String {
    const MAX_CHARS: usize = 40;
    let bytes = bytes.trim_ascii();
    if bytes.is_empty() {
        return "an empty cell".into();
    }
    // Only the start is decoded: an unclosed quote can make a cell as long as the file.
    let text = String::from_utf8_lossy(&bytes[..bytes.len().min(4 * MAX_CHARS)]);
    let mut short: String = text.chars().take(MAX_CHARS).collect();
    if short.len() < bytes.len() && text.chars().count() > MAX_CHARS {
        short.push_str("..");
    }
    format!("\"{}\"", one_line(&short))
}

/// Replaces control characters and line ends with escapes.
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

/// Lists names for a message. A long list is truncated.
pub(super) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    const MAX_NAMES: usize = 30;
    if names.is_empty() {
        return "none".into();
    }
    let shown: Vec<String> = names
        .iter()
        .take(MAX_NAMES)
        .map(|name| {
            let name: String = name.as_ref().chars().take(40).collect();
            one_line(&name)
        })
        .collect();
    let more = names.len().saturating_sub(MAX_NAMES);
    if more > 0 { format!("{} and {more} more", shown.join(", ")) } else { shown.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;

    #[test]
    fn bad_cell_display_is_one_line_with_file_row_and_column() {
        let cell = BadCell {
            file: "a.csv".into(),
            row: 7,
            column: "torque\nnm".into(),
            found: quoted(b" off\r\nline "),
            expected: "a finite number".into(),
        };
        let parts = ["a.csv", "row 7", r"column torque\nnm", r#""off\r\nline""#, &cell.expected];
        message::check("errors", "cell with line ends", &cell.to_string(), &parts);
        assert_eq!(cell.to_string().lines().count(), 1);
    }

    #[test]
    fn quoted_with_long_text_truncates_it() {
        assert!(!quoted(b"   ").contains('"'));
        let text = quoted("é".repeat(1000).as_bytes());
        assert!(text.chars().count() < 50, "{text}");
        assert!(text.ends_with("..\""));
    }

    #[test]
    fn listed_with_many_names_truncates_the_list() {
        let names: Vec<String> = (0..100).map(|i| format!("c{i}")).collect();
        assert!(listed(&names).ends_with("and 70 more"));
        assert_eq!(listed::<&str>(&[]), "none");
    }
}
