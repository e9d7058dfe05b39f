//! CSV, row by row.
//!
//! A log of some gigabytes must not be held as text, so rows stream through one reused record and
//! only numbers are kept. The `csv` crate splits the rows (quotes, embedded line ends), and
//! `fast-float2` reads the numbers straight from the bytes, which is most of the work.
//!
//! Row numbers must be the ones an editor shows, or a message about row 7311 helps nobody. The
//! `csv` crate counts a record from the blank lines before it and gets the count right only
//! *after* a line end has been consumed. So lines end at LF here (a CR before it is trimmed away
//! with the blanks), a final LF is appended in case the file lacks one, and a record's first line
//! is found by counting back from where the reader stands after it.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use csv::{ByteRecord, ReaderBuilder, Terminator};

use super::preamble::{Preamble, preamble};
use super::{HEAD, Input, Source, utf16};
use crate::data::clean::{Cleaner, FileData, Row};
use crate::data::error::DataError;
use crate::data::header::layout;
use crate::data::read::ReadOptions;

/// Rows between two calls of the progress function.
const PROGRESS_ROWS: u64 = 16 * 1024;

/// A record with the number format it is in.
struct CsvRow<'a> {
    record: &'a ByteRecord,
    /// Where the comma does not separate cells it may be the decimal point.
    comma_may_be_point: bool,
    /// Set once it was.
    comma_was_point: &'a Cell<bool>,
}

impl Row for CsvRow<'_> {
    #[inline]
    fn number(&self, column: usize) -> Option<f64> {
        let cell = self.record.get(column)?.trim_ascii();
        match fast_float2::parse(cell) {
            Ok(value) => Some(value),
            Err(_) if self.comma_may_be_point => {
                let value = with_decimal_comma(cell)?;
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

/// A number whose decimal point is a comma, as in `1,5`.
fn with_decimal_comma(cell: &[u8]) -> Option<f64> {
    const LONGEST: usize = 40;
    let comma = cell.iter().position(|&byte| byte == b',')?;
    if cell.len() > LONGEST || cell.contains(&b'.') {
        return None;
    }
    let mut copy = [0; LONGEST];
    copy[..cell.len()].copy_from_slice(cell);
    copy[comma] = b'.';
    fast_float2::parse(&copy[..cell.len()]).ok()
}

/// Tables as text.
pub(super) const SOURCE: Source = Source { is_it: |_| true, read };

/// Before the text of some programs.
const BYTE_ORDER_MARK: &[u8] = &[0xef, 0xbb, 0xbf];

/// The separator that occurs most often in a line, outside quotes.
pub(super) fn separator(line: &[u8]) -> u8 {
    let header = line.trim_ascii_start();
    // A leading tab may be an empty first name, but then others follow it.
    let mut counts = [(b',', 0), (b';', 0), (b'\t', 0)];
    let mut is_quoted = false;
    for &byte in header.iter().take_while(|&&byte| byte != b'\n') {
        is_quoted ^= byte == b'"';
        if let Some((_, count)) = counts.iter_mut().find(|(s, _)| *s == byte && !is_quoted) {
            *count += 1;
        }
    }
    // `max_by_key` prefers the last of equals, and the comma is to be preferred.
    counts.iter().rev().max_by_key(|(_, count)| *count).map_or(b',', |(separator, _)| *separator)
}

fn read(input: Input) -> Result<FileData, DataError> {
    let Input { path, mut file, head, size, options, progress } = input;
    let io = |source| DataError::Io { file: path.into(), source };
    if let Some(order) = utf16::order(head) {
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(io)?;
        let text = utf16::decode(&bytes, order);
        drop(bytes);
        let head = &text.as_bytes()[..text.len().min(HEAD as usize)];
        let before = preamble(head);
        let rest = &text.as_bytes()[before.start..];
        let table = Table { path, head, before, size: text.len() as u64 };
        return table.read(rest, options, &|bytes| progress(bytes.min(size)));
    }
    let mark = if head.starts_with(BYTE_ORDER_MARK) { BYTE_ORDER_MARK.len() } else { 0 };
    let mut before = preamble(&head[mark..]);
    before.start += mark;
    before.header = before.header.map(|range| range.start + mark..range.end + mark);
    file.seek(SeekFrom::Start(before.start as u64)).map_err(io)?;
    Table { path, head, before, size }.read(file, options, progress)
}

/// A table, and where it begins.
struct Table<'a> {
    path: &'a Path,
    head: &'a [u8],
    before: Preamble,
    size: u64,
}

impl Table<'_> {
    /// Reads it; `text` is what follows the preamble.
    fn read(
        self,
        text: impl Read,
        options: &ReadOptions,
        progress: &dyn Fn(u64),
    ) -> Result<FileData, DataError> {
        let Self { path, head, before, size } = self;
        let commented = before.header.clone().map(|range| &head[range]);
        let separator = separator(commented.unwrap_or(&head[before.start.min(head.len())..]));
        let failed = |error: csv::Error| {
            let said = error.to_string();
            let source = match error.into_kind() {
                csv::ErrorKind::Io(source) => source,
                _ => std::io::Error::other(said),
            };
            DataError::Io { file: path.into(), source }
        };
        // With the line end that is appended.
        let bytes = size.saturating_sub(before.start as u64) + 1;
        let mut builder = ReaderBuilder::new();
        builder.has_headers(false).flexible(true).delimiter(separator);
        builder.terminator(Terminator::Any(b'\n')).comment(Some(b'#'));
        let mut reader = builder.buffer_capacity(256 * 1024).from_reader(text.chain(&b"\n"[..]));
        let mut record = ByteRecord::new();

        let name = |cell: &[u8]| String::from_utf8_lossy(cell.trim_ascii()).into_owned();
        let mut names = Vec::new();
        if let Some(line) = commented {
            let mut header = builder.from_reader(line);
            if header.read_byte_record(&mut record).map_err(failed)? {
                names = record.iter().map(name).collect();
            }
        }
        while names.is_empty() && reader.read_byte_record(&mut record).map_err(failed)? {
            if !is_blank(&record) {
                names = record.iter().map(name).collect();
            }
        }
        let width = names.len();
        let mut layout = layout(path, names, options)?;

        let comma_was_point = Cell::new(false);
        let mut records: u64 = 0;
        let mut line_before = reader.position().line();
        let mut is_there = reader.read_byte_record(&mut record).map_err(failed)?;
        if is_there && record.len() == width {
            let cells: Vec<&[u8]> = record.iter().map(<[u8]>::trim_ascii).collect();
            if layout.take_units(&cells) {
                line_before = reader.position().line();
                is_there = reader.read_byte_record(&mut record).map_err(failed)?;
            }
        }
        let mut cleaner = Cleaner::new(path, layout);
        while is_there {
            let line_after = reader.position().line();
            let ends_in_line_end = record.as_slice().last() == Some(&b'\n');
            let inside = if line_after - line_before > 1 || ends_in_line_end {
                record.as_slice().iter().filter(|&&byte| byte == b'\n').count() as u64
            } else {
                0
            };
            line_before = line_after;
            // Only a quote that is never closed runs into the end of the file without a line end.
            let is_open = ends_in_line_end && reader.position().byte() == bytes;
            let line = before.lines + line_after.saturating_sub(inside + u64::from(!is_open));
            records += 1;
            if records.is_multiple_of(PROGRESS_ROWS) {
                progress(reader.position().byte());
            }
            if is_blank(&record) {
                // An empty line.
            } else if is_open || record.len() != width {
                let found = match inside {
                    _ if is_open => "a quote that is never closed".into(),
                    0 => format!("{} cells", record.len()),
                    _ => format!("a quoted cell that ends {inside} lines further down"),
                };
                cleaner.leave_out_ragged(line, found);
            } else {
                let row = CsvRow {
                    record: &record,
                    comma_may_be_point: separator != b',',
                    comma_was_point: &comma_was_point,
                };
                cleaner.take(line, &row)?;
            }
            is_there = reader.read_byte_record(&mut record).map_err(failed)?;
        }
        let mut data = cleaner.finish()?;
        if comma_was_point.get() {
            let file = path.display();
            data.notes.push(format!("{file}: commas inside numbers are decimal points"));
        }
        Ok(data)
    }
}

/// Whether the row is an empty line, or the row of separators a spreadsheet makes of one.
fn is_blank(record: &ByteRecord) -> bool {
    record.as_slice().trim_ascii().is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separators_are_seen() {
        assert_eq!(separator(b"a,b,c\n1,2,3\n"), b',');
        assert_eq!(separator(b"a;b;c\n1,0;2,0;3,0\n"), b';');
        assert_eq!(separator(b"\r\n\na\tb\r\n"), b'\t');
        assert_eq!(separator(b"\"a;x;y\",b\n"), b',', "quoted ones do not count");
        assert_eq!(separator(b"alone\n"), b',');
    }

    #[test]
    fn a_decimal_comma_is_one_comma_and_no_point() {
        assert_eq!(with_decimal_comma(b"-1,5e3"), Some(-1500.0));
        assert_eq!(with_decimal_comma(b"1,234,567"), None);
        assert_eq!(with_decimal_comma(b"1.234,5"), None);
        assert_eq!(with_decimal_comma(b"15"), None);
        assert_eq!(with_decimal_comma(&[b','; 100]), None);
    }
}
