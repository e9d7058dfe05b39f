//! CSV files as a source of rows.
//!
//! A log of several gigabytes must not be held as text. Rows stream through one reused record, and only numbers are
//! kept. The `csv` crate splits the rows (quotes, embedded line ends). `fast-float2` parses the numbers directly from
//! the bytes, which is most of the work.
//!
//! Row numbers must be those that an editor shows. The `csv` crate counts a record from the blank lines before it,
//! and its count is right only *after* it consumed a line end. So lines end at LF here (a preceding CR is trimmed with
//! the blanks), and a final LF is appended in case the file lacks one. The first line of a record is found by counting
//! back from the reader's position after it.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::{Chain, Read, Seek, SeekFrom};
use std::path::Path;

use csv::{ByteRecord, ReaderBuilder, Terminator};

use super::format::{HEAD_BYTES, Input, LogFormat};
use super::preamble::{Preamble, find_preamble};
use super::separator::separator;
use super::utf16;
use crate::data::clean::{Cleaner, FileData};
use crate::data::error::DataError;
use crate::data::header::layout;
use crate::data::options::ReadOptions;
use crate::data::row::LogRow;

/// Rows between two calls of the progress function.
const PROGRESS_ROWS: u64 = 16 * 1024;

/// A record with its number format.
struct CsvRow<'a> {
    record: &'a ByteRecord,
    /// True if the separator is not a comma, so that a comma may be the decimal point.
    comma_may_be_point: bool,
    /// Set when a decimal comma was read.
    comma_was_point: &'a Cell<bool>,
}

impl LogRow for CsvRow<'_> {
    #[inline]
    fn number(&self, column: usize) -> Option<f64> {
        let cell = self.record.get(column)?.trim_ascii();
        match fast_float2::parse(cell) {
            Ok(value) => Some(value),
            Err(_) if self.comma_may_be_point => {
                let value = parse_decimal_comma(cell)?;
                self.comma_was_point.set(true);
                Some(value)
            }
            Err(_) => None,
        }
    }

    fn text(&self, column: usize) -> Cow<'_, [u8]> {
        Cow::Borrowed(self.record.get(column).unwrap_or_default().trim_ascii())
    }
}

/// Parses a number with a decimal comma, as `1,5`.
fn parse_decimal_comma(cell: &[u8]) -> Option<f64> {
    const MAX_BYTES: usize = 40;
    let comma = cell.iter().position(|&byte| byte == b',')?;
    if cell.len() > MAX_BYTES || cell.contains(&b'.') {
        return None;
    }
    let mut copy = [0; MAX_BYTES];
    copy[..cell.len()].copy_from_slice(cell);
    copy[comma] = b'.';
    fast_float2::parse(&copy[..cell.len()]).ok()
}

/// Tables as text. Every text matches, so this format is tried last.
pub(super) const FORMAT: LogFormat = LogFormat { matches: |_| true, read };

/// The byte order mark of UTF-8, which some programs write first.
const BYTE_ORDER_MARK: &[u8] = &[0xef, 0xbb, 0xbf];

fn read(input: Input) -> Result<FileData, DataError> {
    let Input { path, mut file, head, size, options, progress } = input;
    let io = |source| DataError::Io { file: path.into(), source };
    if let Some(order) = utf16::byte_order(head) {
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(io)?;
        let text = utf16::decode(&bytes, order);
        drop(bytes);
        let head = &text.as_bytes()[..text.len().min(HEAD_BYTES as usize)];
        let before = find_preamble(head);
        let rest = &text.as_bytes()[before.start..];
        let table = TextTable { path, head, before, size: text.len() as u64 };
        return table.read(rest, options, &|bytes| progress(bytes.min(size)));
    }
    let mark = if head.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
    let mut before = find_preamble(&head[mark..]);
    before.start += mark;
    before.header = before.header.map(|range| range.start + mark..range.end + mark);
    file.seek(SeekFrom::Start(before.start as u64)).map_err(io)?;
    TextTable { path, head, before, size }.read(file, options, progress)
}

/// Converts an error of the `csv` crate.
fn csv_error(path: &Path, error: csv::Error) -> DataError {
    let message = error.to_string();
    let source = match error.into_kind() {
        csv::ErrorKind::Io(source) => source,
        _ => std::io::Error::other(message),
    };
    DataError::Io { file: path.into(), source }
}

/// Returns the cells of a header.
fn cell_names(record: &ByteRecord) -> Vec<String> {
    let name = |cell: &[u8]| String::from_utf8_lossy(cell.trim_ascii()).into_owned();
    record.iter().map(name).collect()
}

/// The records of a table with their line numbers.
struct RecordReader<R> {
    reader: csv::Reader<Chain<R, &'static [u8]>>,
    record: ByteRecord,
    /// Lines above the table.
    lines_above: u64,
    /// Length of the table, bytes, with the appended line end.
    bytes: u64,
    /// The reader's line before the current record.
    line_before: u64,
}

/// Position of a record in the file.
struct RecordPosition {
    /// Its first line.
    line: u64,
    /// Number of line ends inside the record.
    line_ends: u64,
    /// True if the record ends in a quoted cell that is never closed.
    is_open: bool,
}

impl<R: Read> RecordReader<R> {
    /// Reads the next record. Returns false at the end of the table.
    fn advance(&mut self) -> Result<bool, csv::Error> {
        self.line_before = self.reader.position().line();
        self.reader.read_byte_record(&mut self.record)
    }

    /// Returns the position of the current record.
    fn position(&self) -> RecordPosition {
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

/// A table and its position in the file.
struct TextTable<'a> {
    path: &'a Path,
    head: &'a [u8],
    before: Preamble,
    size: u64,
}

impl TextTable<'_> {
    /// Reads the table. `text` begins after the preamble.
    fn read(
        self,
        text: impl Read,
        options: &ReadOptions,
        progress: &dyn Fn(u64),
    ) -> Result<FileData, DataError> {
        let Self { path, head, before, size } = self;
        let commented = before.header.clone().map(|range| &head[range]);
        let separator = separator(commented.unwrap_or(&head[before.start.min(head.len())..]));
        let failed = |error: csv::Error| csv_error(path, error);
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).delimiter(separator);
        builder.terminator(Terminator::Any(b'\n')).comment(Some(b'#'));
        let mut records = RecordReader {
            reader: builder.buffer_capacity(256 * 1024).from_reader(text.chain(&b"\n"[..])),
            record: ByteRecord::new(),
            lines_above: before.lines,
            bytes: size.saturating_sub(before.start as u64) + 1,
            line_before: 0,
        };
        let mut names = Vec::new();
        if let Some(line) = commented {
            let mut header = builder.from_reader(line);
            if header.read_byte_record(&mut records.record).map_err(failed)? {
                names = cell_names(&records.record);
            }
        }
        while names.is_empty() && records.advance().map_err(failed)? {
            if !is_blank(&records.record) {
                names = cell_names(&records.record);
            }
        }
        let width = names.len();
        let mut layout = layout(path, names, options)?;
        let mut has_record = records.advance().map_err(failed)?;
        if has_record && records.record.len() == width {
            let cells: Vec<&[u8]> = records.record.iter().map(<[u8]>::trim_ascii).collect();
            if layout.take_units(&cells) {
                has_record = records.advance().map_err(failed)?;
            }
        }
        let comma_was_point = Cell::new(false);
        let mut cleaner = Cleaner::new(path, layout);
        let mut count: u64 = 0;
        while has_record {
            let RecordPosition { line, line_ends, is_open } = records.position();
            let record = &records.record;
            count += 1;
            if count.is_multiple_of(PROGRESS_ROWS) {
                progress(records.reader.position().byte());
            }
            if is_blank(record) {
                // An empty line.
            } else if is_open || record.len() != width {
                let found = match line_ends {
                    _ if is_open => "a quote that is never closed".into(),
                    0 => format!("{} cells", record.len()),
                    _ => format!("a quoted cell that ends {line_ends} lines further down"),
                };
                cleaner.reject_ragged_row(line, found);
            } else {
                let comma_may_be_point = separator != b',';
                let comma_was_point = &comma_was_point;
                cleaner.add_row(line, &CsvRow { record, comma_may_be_point, comma_was_point })?;
            }
            has_record = records.advance().map_err(failed)?;
        }
        let mut data = cleaner.finish()?;
        if comma_was_point.get() {
            let file = path.display();
            data.notes.push(format!("{file}: commas inside numbers are decimal points"));
        }
        Ok(data)
    }
}

/// Returns true if the row is empty, or holds only separators as spreadsheets write for an empty row.
fn is_blank(record: &ByteRecord) -> bool {
    record.as_slice().trim_ascii().is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parse_decimal_comma_with_one_comma_and_no_point_returns_number() {
        assert_eq!(parse_decimal_comma(b"-1,5e3"), Some(-1500.0));
        assert_eq!(parse_decimal_comma(b"1,234,567"), None);
        assert_eq!(parse_decimal_comma(b"1.234,5"), None);
        assert_eq!(parse_decimal_comma(b"15"), None);
        assert_eq!(parse_decimal_comma(&[b','; 100]), None);
    }
}
