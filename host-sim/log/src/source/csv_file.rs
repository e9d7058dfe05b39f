//! CSV files.
//!
//! A log of several gigabytes must not be held as text. Rows stream through one reused record (`records`), and of numbers only
//! their values are kept. The `csv` crate splits the rows (quotes, embedded line ends). `fast-float2` parses the numbers
//! directly from the bytes, which is most of the work.
//!
//! A number with separators of thousands may show that earlier ones were misread. The file is then read once more, and
//! a third time without such separators if other numbers contradict them.

use encoding_rs::WINDOWS_1252;
use std::cell::Cell;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use super::channel_clocks::ChannelClocks;
use super::encoding::{encoding, without_mark};
use super::format::{HEAD_BYTES, Input, LogFormat};
use super::line::{cells, separator};
use super::number_style::NumberStyle;
use super::preamble::{Preamble, find_preamble};
use super::records::{
    RecordPosition, RecordReader, cell_names, is_blank, reader_builder, without_blanks,
};
use crate::clock::is_date;
use crate::column_names::ColumnNames;
use crate::columns::is_missing_value;
use crate::error::DataError;
use crate::error::quoted;
use crate::log_table::{LogTable, TableRows};
use crate::options::ReadOptions;
use crate::plan::{Plan, Reading, Request};

/// Rows between two calls of the progress function.
const PROGRESS_ROWS: u64 = 16 * 1024;

/// The number format of a table.
struct NumberFormat {
    /// True if the separator is not a comma, so that a comma may be the decimal point.
    is_comma_free: bool,
    /// What the numbers have shown.
    style: Cell<NumberStyle>,
}

impl NumberFormat {
    #[inline]
    fn parse(&self, cell: &[u8]) -> Option<f64> {
        if !self.style.get().is_point_misleading()
            && let Ok(value) = fast_float2::parse(cell)
        {
            return Some(value);
        }
        self.parse_signs(cell)
    }

    #[cold]
    fn parse_signs(&self, cell: &[u8]) -> Option<f64> {
        let mut style = self.style.get();
        let value = style.parse(cell, self.is_comma_free).or_else(|| fast_float2::parse(cell).ok());
        self.style.set(style);
        value
    }
}

/// Tables as text. Every text matches, so this format is tried last.
pub(super) const FORMAT: LogFormat = LogFormat { matches: |_| true, read };

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    let Input { request, mut file, head, size } = input;
    let io = |source| DataError::Io { file: request.path.into(), source };
    if encoding(head).is_some() {
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(io)?;
        return read_bytes(request, &bytes);
    }
    let before = preamble_after_mark(head, request.options);
    let start = before.start as u64;
    let from_start = || -> std::io::Result<File> {
        let mut file = file.try_clone()?;
        file.seek(SeekFrom::Start(start))?;
        Ok(file)
    };
    TextTable { request, head, before, size }.read(from_start)
}

/// Reads a table that is in memory.
pub(super) fn read_bytes(request: Request, bytes: &[u8]) -> Result<LogTable<'static>, DataError> {
    let size = bytes.len() as u64;
    let head = &bytes[..bytes.len().min(HEAD_BYTES as usize)];
    let Some(encoding) = encoding(head) else {
        let before = preamble_after_mark(head, request.options);
        let start = before.start;
        return TextTable { request, head, before, size }.read(|| Ok(&bytes[start..]));
    };
    let (text, ..) = encoding.decode(bytes);
    let progress = |bytes: u64| (request.progress)(bytes.min(size));
    let mut table = read_bytes(Request { progress: &progress, ..request }, text.as_bytes())?;
    if encoding == WINDOWS_1252 {
        let note = "the text is not UTF-8 and is read as Windows-1252";
        table.notes.push(format!("{}: {note}", request.path.display()));
    }
    Ok(table)
}

/// Returns what precedes the rows of a text, which may begin with a byte order mark.
fn preamble_after_mark(head: &[u8], options: &ReadOptions) -> Preamble {
    let text = without_mark(head);
    let before = find_preamble(text, options.skip_lines);
    Preamble { start: before.start + head.len() - text.len(), ..before }
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

/// A table and its position in the file.
struct TextTable<'a> {
    request: Request<'a>,
    head: &'a [u8],
    before: Preamble,
    size: u64,
}

impl TextTable<'_> {
    /// Reads the table, once more if its numbers turn out to have another style. `open` returns the text after the
    /// preamble.
    fn read<R: Read>(
        &self,
        open: impl Fn() -> std::io::Result<R>,
    ) -> Result<LogTable<'static>, DataError> {
        let io = |source| DataError::Io { file: self.request.path.into(), source };
        let first = NumberStyle::default();
        let (data, style) = self.read_in_style(open().map_err(io)?, first);
        let was_misread = style.thousands_comma || style.thousands_point;
        if !was_misread {
            return data;
        }
        let (data, style) = self.read_in_style(open().map_err(io)?, style);
        if !style.is_contradictory() {
            return data;
        }
        let plain = NumberStyle { is_plain: true, ..NumberStyle::default() };
        self.read_in_style(open().map_err(io)?, plain).0
    }

    /// Returns the names of the columns: those of the preamble or those of the first record. If the first record is a row, the
    /// columns are numbered and the record is the current one.
    fn names<R: Read>(
        &self,
        records: &mut RecordReader<R>,
        format: &NumberFormat,
    ) -> Result<ColumnNames, csv::Error> {
        if let Some(columns) = &self.before.columns {
            return Ok(columns.clone());
        }
        let mut names = Vec::new();
        if let Some(line) = &self.before.header {
            let by = self.separator();
            let mut header = reader_builder(by).from_reader(line.as_slice());
            if header.read_byte_record(&mut records.record)? {
                let record = &records.record;
                names = if by == b' ' {
                    cell_names(&without_blanks(record))
                } else {
                    cell_names(record)
                };
            }
        }
        while names.is_empty() && records.advance()? {
            if is_blank(&records.record) {
                continue;
            }
            if is_row(&records.record, format) {
                return Ok(ColumnNames::numbered(records.record.len()));
            }
            if let Some(names) = long_row_names(&records.record, format) {
                return Ok(ColumnNames { names, is_numbered: true, ..ColumnNames::default() });
            }
            names = cell_names(&records.record);
        }
        Ok(names.into())
    }

    fn separator(&self) -> u8 {
        let below = &self.head[self.before.start.min(self.head.len())..];
        let header = self.before.header.as_deref().unwrap_or(below);
        self.before.separator.unwrap_or_else(|| separator(header))
    }

    fn read_in_style(
        &self,
        text: impl Read,
        style: NumberStyle,
    ) -> (Result<LogTable<'static>, DataError>, NumberStyle) {
        let separator = self.separator();
        let format = NumberFormat { is_comma_free: separator != b',', style: Cell::new(style) };
        let bytes = self.size.saturating_sub(self.before.start as u64);
        let records = RecordReader::new(text, separator, self.before.lines, bytes);
        let data = self.read_records(records, &format).map(|mut data| {
            data.notes.extend(self.notes(format.style.get()));
            data
        });
        (data, format.style.get())
    }

    fn read_records<R: Read>(
        &self,
        mut records: RecordReader<R>,
        format: &NumberFormat,
    ) -> Result<LogTable<'static>, DataError> {
        let Request { path, progress, .. } = self.request;
        let failed = |error: csv::Error| csv_error(path, error);
        let names = self.names(&mut records, format).map_err(failed)?;
        let width = names.names.len();
        let clocks = ChannelClocks::find(&names, self.request.options);
        let mut plan = self.plan(&names, clocks.as_ref())?;
        let mut has_record = names.is_numbered || records.advance().map_err(failed)?;
        if has_record && records.record.len() == width {
            let row: Vec<&[u8]> = records.record.iter().map(<[u8]>::trim_ascii).collect();
            if plan.take_units(path, &merged(row, clocks.as_ref()), "below")? {
                has_record = records.advance().map_err(failed)?;
            }
        }
        let is_long = matches!(plan.reading, Reading::Long(_));
        let mut table = TableRows::new(path, plan);
        // The rows of channels with clocks of their own, before they are merged.
        let mut rows_of_file =
            clocks.is_some().then(|| TableRows::new(path, Plan::cells(names.clone())));
        let mut count: u64 = 0;
        while has_record && !table.is_full() {
            let position = records.position();
            let record = &records.record;
            count += 1;
            if count.is_multiple_of(PROGRESS_ROWS) {
                progress(records.bytes_read());
            }
            let cell = |at: usize| record.get(at).unwrap_or_default().trim_ascii();
            let is_header = |at: usize| *cell(at) == *names.names[at].as_bytes();
            if is_blank(record) || self.is_end_mark(record, clocks.is_some()) {
                // An empty line.
            } else if position.is_open || record.len() != width && clocks.is_none() {
                let expected = format!("{} cells as in the header", table.plan.names.names.len());
                let found = found_cells(&position, record.len());
                table.reject_row(position.line, None, found, &expected);
            } else if let Some(rows) = &mut rows_of_file {
                rows.add_row(position.line, |at| format.parse(cell(at)), |at| cell(at).into());
            } else if !(is_long && (0..width).all(is_header)) {
                // A long table of several series may have the header of each.
                table.add_row(position.line, |at| format.parse(cell(at)), |at| cell(at).into());
            }
            has_record = records.advance().map_err(failed)?;
        }
        let mut notes = Vec::new();
        if let Some((clocks, rows)) = clocks.zip(rows_of_file) {
            notes.push(clocks.note(&names));
            notes.extend(clocks.merge(&rows.finish(), &mut table));
        }
        let mut table = table.finish();
        table.notes = notes.iter().map(|note| format!("{}: {note}", path.display())).collect();
        Ok(table)
    }

    /// Decides what is read of the columns, in the units above the header.
    fn plan(&self, names: &ColumnNames, clocks: Option<&ChannelClocks>) -> Result<Plan, DataError> {
        let mut plan = self
            .request
            .plan(clocks.map_or_else(|| names.clone(), |clocks| clocks.names(names)))?;
        if let Some(line) = &self.before.units {
            let units = merged(cells(line, self.separator()), clocks);
            plan.take_units(self.request.path, &units, "above")?;
        }
        Ok(plan)
    }

    /// Returns true for the line that ends an export of TwinCAT Scope.
    fn is_end_mark(&self, record: &csv::ByteRecord, has_clocks: bool) -> bool {
        (has_clocks || self.before.columns.is_some()) && record.as_slice().trim_ascii() == b"EOF"
    }

    /// Returns notes on what was assumed of the text.
    fn notes(&self, style: NumberStyle) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(first) = &self.before.skipped {
            let (lines, first) = (self.before.lines, quoted(first.as_bytes()));
            notes.push(format!(
                "{lines} lines above the header are skipped, the first with text is {first}"
            ));
        }
        let thousands = [
            (style.thousands_comma, "commas"),
            (style.thousands_point, "points"),
            (style.thousands_space, "spaces or apostrophes"),
        ];
        for (_, sign) in thousands.iter().filter(|(is_used, _)| *is_used) {
            notes.push(format!("{sign} inside numbers separate thousands"));
        }
        if style.decimal_comma {
            notes.push("commas inside numbers are decimal points".into());
        }
        let file = self.request.path.display();
        notes.into_iter().map(|note| format!("{file}: {note}")).collect()
    }
}

/// Returns the cells of a row; of a table whose channels have clocks of their own, those of the merged table.
fn merged<'a>(row: Vec<&'a [u8]>, clocks: Option<&ChannelClocks>) -> Vec<&'a [u8]> {
    match clocks {
        Some(clocks) => clocks.cells(&row),
        None => row,
    }
}

/// Returns true if a record is a row of values and not a header: numbers, dates and missing values.
fn is_row(record: &csv::ByteRecord, format: &NumberFormat) -> bool {
    let is_number = |cell: &[u8]| format.parse(cell.trim_ascii()).is_some();
    let is_value = |cell: &[u8]| is_number(cell) || is_missing_value(cell) || is_date(cell);
    let numbers = record.iter().filter(|cell| is_number(cell)).count();
    record.len() > 1 && numbers > 0 && 2 * numbers >= record.len() && record.iter().all(is_value)
}

/// Returns the names of the columns of a long table without a header, if a record is its first row: a time, a name and a number.
fn long_row_names(record: &csv::ByteRecord, format: &NumberFormat) -> Option<Vec<String>> {
    let is_number = |cell: &[u8]| format.parse(cell.trim_ascii()).is_some();
    record.get(0).filter(|cell| is_number(cell) || is_date(cell))?;
    let mut others = record.iter().skip(1);
    let (one, other) = (is_number(others.next()?), is_number(others.next()?));
    let names = if other { ["time", "name", "value"] } else { ["time", "value", "name"] };
    (record.len() == 3 && one != other).then(|| names.map(str::to_owned).to_vec())
}

/// Describes a record of the wrong number of cells.
fn found_cells(position: &RecordPosition, cells: usize) -> String {
    match position.line_ends {
        _ if position.is_open => "a quote that is never closed".into(),
        0 => format!("{cells} cells"),
        count => format!("a quoted cell that ends {count} lines further down"),
    }
}
