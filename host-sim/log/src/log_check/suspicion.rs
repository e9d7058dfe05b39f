//! What makes a log doubtful as a whole: it is refused, with what to type, unless the kind is kept as logged.

use super::LogFinding;
use super::finding::LogFindingKind;
use crate::setting::Setting;
use crate::{DataError, Dataset};

/// A reason to refuse a log: what was found, and what to type.
#[derive(Clone, Debug, PartialEq)]
pub struct Suspicion {
    /// Its kind, by which it can be kept as logged.
    pub kind: LogFindingKind,
    columns: Vec<String>,
    found: String,
    expected: String,
}

impl Suspicion {
    /// Returns a suspicion. `expected` ends "expected ..".
    pub fn new(kind: LogFindingKind, columns: &[&str], found: String, expected: String) -> Self {
        let columns = columns.iter().map(|name| (*name).to_owned()).collect();
        let kept = Setting::AsLogged.suggested(kind.name());
        let what = if kind == LogFindingKind::UnitSuspect { "the units" } else { "it as it is" };
        Self { kind, columns, found, expected: format!("{expected}, or {kept} to keep {what}") }
    }

    /// Returns a suspicion that one of some values of `--columns` ends.
    pub fn typed(kind: LogFindingKind, columns: &[&str], found: String, pairs: &[String]) -> Self {
        let each: Vec<String> = pairs.iter().map(|pair| Setting::Columns.suggested(pair)).collect();
        Self::new(kind, columns, found, each.join(" or "))
    }

    /// Returns the error of a log that is refused.
    pub fn error(self, data: &Dataset) -> DataError {
        let file = data.first_file();
        DataError::file(file, self.found, self.expected)
    }

    /// Returns the finding of a log that is kept as it is.
    pub fn finding(self) -> LogFinding {
        let words = format!("The log has {}. Nothing is changed, as asked.", self.found);
        let columns: Vec<&str> = self.columns.iter().map(String::as_str).collect();
        self.kind.finding(&columns, 1.0, "log", words)
    }
}
