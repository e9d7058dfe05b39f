//! Row-by-row validation of a log.
//!
//! Every file format is read to one kind of table, so that a log means the same in each format. A row needs a
//! run name, a finite time, a velocity and a torque. Its time must not be before that of the last accepted row of the
//! same run. Other rows are left out and counted, and the first few are reported. Time stamps may *repeat*: a logger
//! that is faster than its clock writes such rows, and all of them are measurements. Runs may be interleaved row by
//! row; each has its own clock.
//!
//! Some decisions need the whole file and are made at its end (`close`). A velocity that is empty in every other row
//! belongs to a separate channel of a merged log; in one row of a hundred it is a bad row. Missing values are NaN
//! until then.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use super::cell::is_list;
use super::clock::{self, Clock};
use super::columns::{ColumnTally, FINITE, RunLabel, is_missing_value, set_number};
use super::dataset::Run;
use super::error::{BadCell, BadRows, DataError, listed, quoted};
use super::header::Layout;
use super::log_table::LogTable;
use super::plan::Reading;
use super::split::are_equal;
use super::table::{Cells, Row};
use super::work::checkpoint_at;
use crate::setting::Setting;

/// Maximum number of runs in a file. More indicate that the run column holds something else.
pub const MAX_RUNS: usize = 100_000;

/// Maximum magnitude of a measured value. The core squares values in `f32`, and a fit sums squares; both must stay
/// finite. Time and covariates that the contract does not define are not limited.
const MAX_MAGNITUDE: f64 = 1e15;

/// Returns what a cell should hold instead, or `None` if its value is valid.
fn value_error(cell: Option<f64>, is_unbounded: bool) -> Option<&'static str> {
    match cell {
        Some(value) if value.abs() <= MAX_MAGNITUDE || is_unbounded && value.is_finite() => None,
        Some(value) if value.is_finite() => Some("a magnitude of at most 1e15"),
        _ => Some(FINITE),
    }
}

/// Returns the expected content of a rejected cell, with a hint if the cell holds a list.
fn expected_content(error: &'static str, cell: &[u8]) -> Cow<'static, str> {
    if is_list(cell) {
        let first = Setting::Columns.suggested("NAME=COLUMN[0]");
        format!("a number; of a list, {first} takes the first").into()
    } else if is_ambiguous_comma(cell) {
        "a number with a point, as 1234.5: this comma may separate thousands or be the decimal point".into()
    } else {
        error.into()
    }
}

/// Returns true for a number with one comma before three digits, as `1,234`.
fn is_ambiguous_comma(cell: &[u8]) -> bool {
    let mut parts = cell.strip_prefix(b"-").unwrap_or(cell).split(|byte| *byte == b',');
    let has_digits = |part: Option<&[u8]>, lengths: std::ops::RangeInclusive<usize>| {
        part.is_some_and(|part| {
            lengths.contains(&part.len()) && part.iter().all(u8::is_ascii_digit)
        })
    };
    has_digits(parts.next(), 1..=3) && has_digits(parts.next(), 3..=3) && parts.next().is_none()
}

/// The valid rows of a file.
#[derive(Debug, Default)]
pub(super) struct FileData {
    /// The header, with the optional columns that are kept in the order of [`Run::extra`].
    pub layout: Layout,
    /// The runs, with all optional columns in [`Run::extra`]. The name is empty if the file has no run column and holds one
    /// recording.
    pub runs: Vec<Run>,
    /// Origin of the times, ns since 1970; `None` if the file does not state it.
    pub origin_ns: Option<i128>,
    pub rows: usize,
    pub bad: BadRows,
}

/// A run that is being read. Missing values are NaN.
#[derive(Debug)]
pub(super) struct OpenRun {
    pub name: Box<[u8]>,
    /// Time, velocity (or position), torque.
    pub required: [Vec<f64>; 3],
    /// The optional columns, which end at their last number. A number in a later row fills the rows between with NaN.
    pub optional: Vec<Vec<f64>>,
    pub labels: Vec<RunLabel>,
    /// Row numbers in the file, as an editor counts them.
    pub row_numbers: Vec<u64>,
    /// Number of accepted rows.
    pub accepted: usize,
}

impl OpenRun {
    /// Returns the columns of numbers. An optional column may have fewer values than the run has rows.
    pub fn columns_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        self.required.iter_mut().chain(&mut self.optional)
    }

    /// Removes the rows for which `keep` is false.
    pub fn retain(&mut self, keep: &[bool]) {
        self.columns_mut().for_each(|column| retain(column, keep));
        retain(&mut self.row_numbers, keep);
    }
}

/// Removes the rows of a column for which `keep` is false.
pub(super) fn retain<T>(column: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    column.retain(|_| keep.next() == Some(&true));
}

/// The distinct texts of a column.
#[derive(Debug, Default)]
pub(super) struct DistinctTexts {
    pub values: Vec<Box<[u8]>>,
    /// True if the column holds more texts than are kept.
    pub is_truncated: bool,
    last: usize,
    /// True if the text changes inside a run.
    pub changes: bool,
}

impl DistinctTexts {
    /// Maximum number of texts that are kept. A column with more does not name joints.
    const MAX_VALUES: usize = 32;

    fn insert(&mut self, text: &[u8]) {
        if self.values.get(self.last).is_some_and(|last| **last == *text) {
            return;
        }
        match self.values.iter().position(|known| **known == *text) {
            Some(at) => self.last = at,
            None if self.values.len() < Self::MAX_VALUES => {
                self.last = self.values.len();
                self.values.push(text.into());
            }
            None => self.is_truncated = true,
        }
    }

    /// Lists the texts for a message.
    pub fn listed(&self) -> String {
        let texts: Vec<String> =
            self.values.iter().map(|text| String::from_utf8_lossy(text).into_owned()).collect();
        if self.is_truncated { format!("{} ..", listed(&texts)) } else { listed(&texts) }
    }
}

/// Collects the valid rows of a file and counts the others.
pub(super) struct Cleaner<'a> {
    pub(super) file: &'a Path,
    pub(super) layout: Layout,
    pub(super) clock: Clock,
    pub(super) runs: Vec<OpenRun>,
    by_name: HashMap<Box<[u8]>, usize>,
    /// The run of the previous row. The next row mostly belongs to it too.
    current: usize,
    /// The run of the last accepted row.
    previous: Option<usize>,
    /// One for each optional column.
    pub(super) tallies: Vec<ColumnTally>,
    /// Cells without a value in the velocity and the torque column.
    pub(super) missing: [ColumnTally; 2],
    /// Number of rows with neither velocity nor torque.
    pub(super) covariate_only_rows: usize,
    /// Texts of the columns that may name joints.
    pub(super) joint_names: Vec<DistinctTexts>,
    /// Texts of the columns that `--where` names.
    pub(super) selection_texts: Vec<DistinctTexts>,
    /// Number of rows that `--where` excludes.
    pub(super) unselected_rows: usize,
    pub(super) rows: usize,
    /// Number of rows for which a new run has room.
    expected_rows: usize,
    /// Rows that are left out, until the end without those that the format left out.
    pub(super) bad: BadRows,
}

/// Validates the rows of a table, and evaluates it at its end.
///
/// # Errors
/// If the file holds more than [`MAX_RUNS`] runs, and as [`Cleaner::finish`].
pub(super) fn clean(table: LogTable) -> Result<FileData, DataError> {
    let LogTable { file, plan, columns, lines, bad, bad_lines, left_out, notes, hint } = table;
    let Reading::Data(layout) = plan.reading else { return Ok(FileData::default()) };
    let mut cleaner = Cleaner::new(&file, *layout);
    cleaner.rows = bad.count;
    let read = || {
        let cells: Vec<&Cells> = columns.iter().map(Cow::as_ref).collect();
        cleaner.expected_rows = if cleaner.layout.run.is_none() { lines.len() } else { 0 };
        for (row, line) in lines.into_iter().enumerate() {
            checkpoint_at(row);
            cleaner.add_row(line, &Row { columns: &cells, row })?;
        }
        drop(columns);
        cleaner.bad.extend(bad);
        cleaner.finish()
    };
    let mut data = read().map_err(|error| match hint {
        Some(hint) => error.with_hint(&hint),
        None => error,
    })?;
    data.bad.extend(bad_lines);
    data.layout.left_out.extend(left_out);
    data.layout.notes.extend(notes);
    Ok(data)
}

impl<'a> Cleaner<'a> {
    fn new(file: &'a Path, layout: Layout) -> Self {
        let tallies = layout.optional.iter().map(|_| ColumnTally::default()).collect();
        let texts = |count| std::iter::repeat_with(DistinctTexts::default).take(count).collect();
        Cleaner {
            file,
            clock: Clock::new(layout.required[0], layout.dates)
                .with_timing(layout.timing, layout.run),
            runs: Vec::new(),
            by_name: HashMap::new(),
            current: 0,
            previous: None,
            tallies,
            missing: Default::default(),
            covariate_only_rows: 0,
            joint_names: texts(layout.joint_names.len()),
            selection_texts: texts(layout.only.len()),
            unselected_rows: 0,
            rows: 0,
            expected_rows: 0,
            bad: BadRows::default(),
            layout,
        }
    }

    /// Adds a row with its number as defined by [`BadCell::row`].
    ///
    /// # Errors
    /// If the file holds more than [`MAX_RUNS`] runs.
    fn add_row(&mut self, number: u64, row: &Row) -> Result<(), DataError> {
        if !self.is_selected(row) {
            self.unselected_rows += 1;
            // Rows of another joint are at the same instants, all others at their own.
            if !self.clock.reads_stamps() && !self.layout.only.iter().any(|only| only.is_joint) {
                self.clock.time_s(row);
            }
            return Ok(());
        }
        self.rows += 1;
        let time = self.clock.time_s(row);
        if let Some(error) = value_error(time, true) {
            self.reject_cell(number, row, 0, error);
            return Ok(());
        }
        let Some([velocity, torque]) = self.motion_and_torque(number, row) else { return Ok(()) };
        let values = [time.unwrap_or_default(), velocity, torque];
        let Some(run) = self.run_index(number, row)? else { return Ok(()) };
        let is_covariate_only = values[1].is_nan() && values[2].is_nan();
        self.covariate_only_rows += usize::from(is_covariate_only);
        let open = &mut self.runs[run];
        for (kept, value) in open.required.iter_mut().zip(values) {
            kept.push(value);
        }
        for (tally, value) in self.missing.iter_mut().zip(&values[1..]) {
            tally.numbers += usize::from(!value.is_nan());
        }
        open.row_numbers.push(number);
        open.accepted += 1;
        self.add_optional(number, row, run, is_covariate_only);
        for (texts, column) in self.joint_names.iter_mut().zip(&self.layout.joint_names) {
            let before = texts.last;
            texts.insert(&row.text(column.index));
            texts.changes |= before != texts.last && self.previous == Some(run);
        }
        self.previous = Some(run);
        Ok(())
    }

    /// Returns velocity and torque of a row, NaN for a missing value. Rejects a row with another cell in place of a number.
    fn motion_and_torque(&mut self, number: u64, row: &Row) -> Option<[f64; 2]> {
        let mut values = [f64::NAN; 2];
        for (value, at) in values.iter_mut().zip(1..) {
            let cell = self.layout.required[at].value(row);
            let Some(error) = value_error(cell, false) else {
                *value = cell.unwrap_or_default();
                continue;
            };
            let column = self.layout.required[at].index;
            let text = row.text(column);
            if cell.is_some_and(|cell| !cell.is_nan()) || !is_missing_value(&text) {
                self.reject_cell(number, row, at, error);
                return None;
            }
            let name = &self.layout.names[column];
            self.missing[at - 1].add_other(self.file, number, name, &text, FINITE);
        }
        Some(values)
    }

    /// Adds the optional cells of a row that was added to a run.
    fn add_optional(&mut self, number: u64, row: &Row, run: usize, is_covariate_only: bool) {
        let open = &mut self.runs[run];
        let at = open.row_numbers.len() - 1;
        let optional = self.layout.optional.iter().zip(&mut self.tallies);
        for ((column, tally), (kept, label)) in
            optional.zip(open.optional.iter_mut().zip(&mut open.labels))
        {
            let cell = column.reading.value(row);
            match value_error(cell, column.quantity.is_none()) {
                None => {
                    tally.numbers += 1;
                    tally.covariate_only += usize::from(is_covariate_only);
                    set_number(kept, at, cell.unwrap_or_default());
                }
                Some(error) => {
                    let index = column.reading.index;
                    let (name, text) = (&self.layout.names[index], row.text(index));
                    let expected = expected_content(error, &text);
                    tally.add_other(self.file, number, name, &text, &expected);
                    label.add(&text);
                }
            }
        }
    }

    /// Returns true if `--where` selects the row.
    fn is_selected(&mut self, row: &Row) -> bool {
        let mut is_selected = true;
        for (only, texts) in self.layout.only.iter().zip(&mut self.selection_texts) {
            let text = row.text(only.index);
            texts.insert(&text);
            let text = String::from_utf8_lossy(&text);
            is_selected &= only.values.iter().any(|value| are_equal(&text, value));
        }
        is_selected
    }

    /// Leaves a row out because of a required cell: 0 time, 1 velocity, 2 torque.
    fn reject_cell(&mut self, number: u64, row: &Row, at: usize, error: &'static str) {
        let column = self.layout.required[at].index;
        let text = row.text(column);
        let date = if at == 0 { self.time_error(row, &text) } else { None };
        let expected = date.map_or_else(|| expected_content(error, &text), Cow::Borrowed);
        self.reject_row(number, Some(column), quoted(&text), &expected);
    }

    /// Returns what is expected instead of a date that cannot be read: that of the time column, or that beside it.
    fn time_error(&self, row: &Row, text: &[u8]) -> Option<&'static str> {
        let order = self.clock.date_order();
        self.clock
            .step_error(row)
            .or_else(|| clock::date_error(text, order))
            .or_else(|| clock::day_error(&row.text(self.layout.dates?), order))
    }

    /// Adds a note on the file.
    pub(super) fn note(&mut self, note: impl std::fmt::Display) {
        self.layout.notes.push(format!("{}: {note}", self.file.display()));
    }

    /// Leaves a row out and counts it. `column` is `None` if no single cell is the cause.
    pub fn reject_row(&mut self, row: u64, column: Option<usize>, found: String, expected: &str) {
        self.bad.add(|| {
            let column = column.map_or("(all)", |at| self.layout.names[at].as_str()).into();
            let (file, expected) = (self.file.into(), expected.into());
            BadCell { file, row, column, found, expected }
        });
    }

    /// Returns the index of the row's run, which it adds if it is new. Returns `None` if the row has no run name.
    fn run_index(&mut self, number: u64, row: &Row) -> Result<Option<usize>, DataError> {
        let name = match self.layout.run {
            Some(column) => {
                let name = row.text(column);
                if name.is_empty() {
                    self.reject_row(number, Some(column), quoted(&name), "the run's name");
                    return Ok(None);
                }
                name
            }
            // A comparison of two empty names would take a third of the time of a row.
            None if !self.runs.is_empty() => return Ok(Some(0)),
            None => Cow::Borrowed(&[][..]),
        };
        if self.runs.get(self.current).is_some_and(|run| *run.name == *name) {
            return Ok(Some(self.current));
        }
        if let Some(&known) = self.by_name.get(&*name) {
            self.current = known;
            return Ok(Some(known));
        }
        if self.runs.len() == MAX_RUNS {
            return Err(DataError::Cell(BadCell {
                file: self.file.into(),
                row: number,
                column: self.layout.run.map_or("run", |at| &self.layout.names[at]).into(),
                found: format!("more than {MAX_RUNS} run names"),
                expected: format!("at most {MAX_RUNS} runs; does this column hold row numbers?"),
            }));
        }
        let columns = self.layout.optional.len();
        self.current = self.runs.len();
        self.by_name.insert(name.as_ref().into(), self.current);
        self.runs.push(OpenRun {
            name: name.as_ref().into(),
            required: std::array::from_fn(|_| Vec::with_capacity(self.expected_rows)),
            optional: vec![Vec::new(); columns],
            labels: std::iter::repeat_with(RunLabel::default).take(columns).collect(),
            row_numbers: Vec::with_capacity(self.expected_rows),
            accepted: 0,
        });
        Ok(Some(self.current))
    }
}
