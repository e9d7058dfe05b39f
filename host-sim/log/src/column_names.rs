//! The names of a file's columns, with what a format states about them.

/// The names of a file's columns.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct ColumnNames {
    pub names: Vec<String>,
    /// Units of the columns, empty where the file states none. May be shorter than the names.
    pub units: Vec<String>,
    /// True if the preamble is that of TwinCAT Scope.
    pub is_twincat_scope: bool,
}

impl From<Vec<String>> for ColumnNames {
    fn from(names: Vec<String>) -> Self {
        Self { names, ..Self::default() }
    }
}
