//! The names of a file's columns, with what a format states about them.

/// The names of a file's columns.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct ColumnNames {
    pub names: Vec<String>,
    /// Units of the columns, empty where the file states none. May be shorter than the names.
    pub units: Vec<String>,
    /// True if the preamble is that of TwinCAT Scope.
    pub is_twincat_scope: bool,
    /// True if the file has no names, and the names are the numbers of the columns.
    pub is_numbered: bool,
}

impl ColumnNames {
    /// Returns the names of the columns of a file without a header: their numbers, from 1.
    pub fn numbered(columns: usize) -> Self {
        let names = (1..=columns).map(|number| number.to_string()).collect();
        Self { names, is_numbered: true, ..Self::default() }
    }
}

impl From<Vec<String>> for ColumnNames {
    fn from(names: Vec<String>) -> Self {
        Self { names, ..Self::default() }
    }
}
