//! The lines above a table, and their cells.

use crate::column_names::ColumnNames;
use std::ops::Range;

/// The lines above a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Preamble {
    /// Start of the table, bytes: its header, or its first row if the header is a comment.
    pub start: usize,
    /// Number of lines above the table.
    pub lines: u64,
    /// The header in the last comment, if there is one.
    pub header: Option<Range<usize>>,
    /// The columns, if the lines above the table describe them.
    pub columns: Option<ColumnNames>,
    /// The separator of the cells, where the lines above the table show it better than its rows.
    pub separator: Option<u8>,
    /// The line of units above the header.
    pub units: Option<Range<usize>>,
    /// The first line of text that is skipped.
    pub skipped: Option<String>,
}

/// Splits a line into its cells, outside quotes, without the quotes around a cell.
pub(super) fn cells(line: &[u8], by: u8) -> Vec<&[u8]> {
    let mut is_quoted = false;
    let parts = line.split(move |byte| {
        is_quoted ^= *byte == b'"';
        *byte == by && !is_quoted
    });
    let bare = |cell: &'_ [u8]| -> Range<usize> {
        let trimmed = cell.trim_ascii();
        let start = cell.len() - cell.trim_ascii_start().len();
        let quotes = usize::from(
            trimmed.len() > 1 && trimmed.starts_with(b"\"") && trimmed.ends_with(b"\""),
        );
        start + quotes..start + trimmed.len() - quotes
    };
    let cells = parts.map(|cell| &cell[bare(cell)]);
    cells.filter(|cell| by != b' ' || !cell.is_empty()).collect()
}

/// Returns true if a cell is a number, with a decimal point or comma.
pub(super) fn is_number(cell: &[u8]) -> bool {
    let plain: Vec<u8> = cell.iter().map(|&byte| if byte == b',' { b'.' } else { byte }).collect();
    fast_float2::parse::<f64, _>(&plain).is_ok()
}
