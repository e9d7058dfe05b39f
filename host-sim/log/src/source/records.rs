//! The records of a text table with their line numbers.
//!
//! Row numbers must be those that an editor shows. The `csv` crate counts a record from the blank lines before it,
//! and its count is right only *after* it consumed a line end. So lines end at LF here (a preceding CR is trimmed with
//! the blanks), and a final LF is appended in case the file lacks one. The first line of a record is found by counting
//! back from the reader's position after it.

use csv::{ByteRecord, ReaderBuilder, Terminator};
use std::io::{Chain, Read};

/// The records of a table.
pub(super) struct RecordReader<R> {
    separator: u8,
    reader: csv::Reader<Chain<R, &'static [u8]>>,
    pub record: ByteRecord,
    /// Lines above the table.
    lines_above: u64,
    /// Length of the table, bytes, with the appended line end.
    bytes: u64,
    /// The reader's line before the current record.
    line_before: u64,
}

/// Position of a record in the file.
pub(super) struct RecordPosition {
    /// Its first line.
    pub line: u64,
    /// Number of line ends inside the record.
    pub line_ends: u64,
    /// True if the record ends in a quoted cell that is never closed.
    pub is_open: bool,
}

/// Returns a builder of readers of lines that end in LF, with comments after `#`.
pub(super) fn reader_builder(separator: u8) -> ReaderBuilder {
    let mut builder = ReaderBuilder::new();
    builder.has_headers(false).flexible(true).delimiter(separator);
    builder.terminator(Terminator::Any(b'\n')).comment(Some(b'#'));
    builder
}

impl<R: Read> RecordReader<R> {
    /// Creates a reader of a table of `bytes` bytes below `lines_above` lines.
    pub fn new(text: R, separator: u8, lines_above: u64, bytes: u64) -> Self {
        let mut builder = reader_builder(separator);
        Self {
            separator,
            reader: builder.buffer_capacity(256 * 1024).from_reader(text.chain(&b"\n"[..])),
            record: ByteRecord::new(),
            lines_above,
            bytes: bytes + 1,
            line_before: 0,
        }
    }

    /// Reads the next record. Returns false at the end of the table.
    pub fn advance(&mut self) -> Result<bool, csv::Error> {
        self.line_before = self.reader.position().line();
        let is_read = self.reader.read_byte_record(&mut self.record)?;
        if self.separator == b' ' {
            self.record = without_blanks(&self.record);
        }
        Ok(is_read)
    }

    /// Returns the number of bytes read.
    pub fn bytes_read(&self) -> u64 {
        self.reader.position().byte()
    }

    /// Returns the position of the current record.
    pub fn position(&self) -> RecordPosition {
        let line_after = self.reader.position().line();
        let ends_in_line_end = self.record.as_slice().last() == Some(&b'\n');
        let line_ends = if line_after - self.line_before > 1 || ends_in_line_end {
            self.record.as_slice().iter().filter(|&&byte| byte == b'\n').count() as u64
        } else {
            0
        };
        // Only an unclosed quote reaches the end of the file without a line end.
        let is_open = ends_in_line_end && self.reader.position().byte() == self.bytes;
        let line = self.lines_above + line_after.saturating_sub(line_ends + u64::from(!is_open));
        RecordPosition { line, line_ends, is_open }
    }
}

/// Returns the words of a record that is split at single blanks. numpy's `savetxt` and Fortran align the columns of a table
/// with several blanks. A comment after blanks has no words.
pub(super) fn without_blanks(record: &ByteRecord) -> ByteRecord {
    let words = record.iter().filter(|cell| !cell.trim_ascii().is_empty());
    let is_comment = words.clone().next().is_some_and(|word| word.starts_with(b"#"));
    words.filter(|_| !is_comment).collect()
}

/// Returns the cells of a header.
pub(super) fn cell_names(record: &ByteRecord) -> Vec<String> {
    let name = |cell: &[u8]| String::from_utf8_lossy(cell.trim_ascii()).into_owned();
    record.iter().map(name).collect()
}

/// Returns true if the row is empty, or holds only separators as spreadsheets write for an empty row.
pub(super) fn is_blank(record: &ByteRecord) -> bool {
    record.as_slice().trim_ascii().is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn advance_with_aligned_columns_returns_words() {
        let text = "  t   v\r\n 0.1  -2 \r\n\n  # remark\n3 \"a b\"";
        let read = |separator| {
            let mut reader = RecordReader::new(text.as_bytes(), separator, 0, text.len() as u64);
            let mut found = Vec::new();
            while reader.advance().unwrap() {
                found.push((reader.position().line, cell_names(&reader.record)));
            }
            found
        };
        let lines =
            [(1, vec!["t", "v"]), (2, vec!["0.1", "-2"]), (4, vec![]), (5, vec!["3", "a b"])];
        let lines =
            lines.map(|(line, words)| (line, words.into_iter().map(str::to_owned).collect()));
        assert_eq!(read(b' '), lines);
        assert_eq!(read(b',')[0], (1, vec!["t   v".to_owned()]));
    }
}
