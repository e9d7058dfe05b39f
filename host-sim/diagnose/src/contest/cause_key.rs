//! What a finding is about.

/// Name of a cause with the columns that it follows: what a finding is about.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CauseKey {
    /// The cause, as in a report.
    pub cause: &'static str,
    /// The columns that it follows.
    pub columns: Vec<String>,
}

impl CauseKey {
    /// Returns the columns in a report: those of `unknown` are multiplied.
    pub fn follows(&self) -> String {
        self.columns.join(if self.cause == "unknown" { " x " } else { ", " })
    }
}
