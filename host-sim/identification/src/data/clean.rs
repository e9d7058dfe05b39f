//! May this row stay?
//!
//! Both file formats end here, row by row, so that a log means the same in either. A row must
//! have its run, a finite time, velocity and torque, and a time that is not before the row kept
//! last in the same run; otherwise it is left out, counted and (the first few) named. Time stamps
//! may *repeat*: a logger faster than its clock writes such rows, and all of them are measurements.
//! Runs may be interleaved row by row; each has its own clock.
//!
//! A row that lacks an optional value is decided about when the file is over (see `columns`), so
//! until then its columns hold NaN; [`Cleaner::finish`] takes those rows out.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use super::columns::{Column, FINITE, Fate, Label, Tally};
use super::dataset::LeftOutColumn;
use super::error::{BadCell, BadRows, DataError, NAMED_BAD_ROWS, quoted};
use super::header::{Layout, OptionalColumn};
use compensator_core::quantity::JointKind;

/// More than this share of bad rows in a file is an error: such a file is misread, not noisy.
pub const MAX_BAD_SHARE: f64 = 0.05;

/// More runs than this in a file is an error: then the run column is not one.
pub const MAX_RUNS: usize = 100_000;

/// No machine moves, pushes or heats like this. The core's `f32` squares such numbers, which must stay
/// finite; a fit's sums of squares must, too. A clock or a foreign covariate may count as it likes.
const LARGEST: f64 = 1e15;

/// What is wrong with a cell, if anything, as what is expected instead.
fn complaint(cell: Option<f64>, counts: bool) -> Option<&'static str> {
    match cell {
        Some(value) if value.abs() <= LARGEST || counts && value.is_finite() => None,
        Some(value) if value.is_finite() => Some("a size of at most 1e15"),
        _ => Some(FINITE),
    }
}

/// One row of a file, whatever its format.
pub(super) trait Row {
    /// The cell as a number; may be NaN or infinite; `None` where it is none.
    fn number(&self, column: usize) -> Option<f64>;
    /// The cell as text without surrounding blanks.
    fn text(&self, column: usize) -> Cow<'_, [u8]>;
}

/// A file's clean rows.
#[derive(Debug)]
pub(super) struct FileData {
    pub joint: JointKind,
    pub runs: Vec<CleanRun>,
    /// The optional columns that stayed.
    pub optional: Vec<OptionalColumn>,
    pub left_out: Vec<LeftOutColumn>,
    pub notes: Vec<String>,
    pub rows: usize,
    pub bad: BadRows,
}

/// One run of a file.
#[derive(Debug)]
pub(super) struct CleanRun {
    /// `None` if the file has no run column.
    pub name: Option<String>,
    /// Time, velocity, torque.
    pub required: [Vec<f64>; 3],
    /// Parallel to [`FileData::optional`].
    pub optional: Vec<Vec<f64>>,
    pub labels: Vec<(String, String)>,
}

/// A run while it is read.
#[derive(Debug)]
struct OpenRun {
    name: Box<[u8]>,
    required: [Vec<f64>; 3],
    optional: Vec<Column>,
    labels: Vec<Label>,
    /// The row of the file that was kept last.
    last_row: u64,
}

/// Takes rows and keeps the good ones.
pub(super) struct Cleaner<'a> {
    file: &'a Path,
    layout: Layout,
    runs: Vec<OpenRun>,
    by_name: HashMap<Box<[u8]>, usize>,
    /// The run of the row before: mostly that of the next one, too.
    current: usize,
    tallies: Vec<Tally>,
    rows: usize,
    bad: BadRows,
    repeated_stamps: usize,
}

impl<'a> Cleaner<'a> {
    pub fn new(file: &'a Path, layout: Layout) -> Self {
        let tallies = layout.optional.iter().map(|_| Tally::default()).collect();
        Cleaner {
            file,
            layout,
            runs: Vec::new(),
            by_name: HashMap::new(),
            current: 0,
            tallies,
            rows: 0,
            bad: BadRows::default(),
            repeated_stamps: 0,
        }
    }

    /// Takes one row, counted as [`BadCell::row`] says. Fails only if there are too many runs.
    pub fn take(&mut self, number: u64, row: &impl Row) -> Result<(), DataError> {
        self.rows += 1;
        let mut values = [0.0; 3];
        for (at, (value, &column)) in values.iter_mut().zip(&self.layout.required).enumerate() {
            let cell = row.number(column);
            if let Some(expected) = complaint(cell, at == 0) {
                let found = quoted(&row.text(column));
                self.leave_out(number, Some(column), found, expected);
                return Ok(());
            }
            *value = cell.unwrap_or_default();
        }
        let Some(run) = self.run_of(number, row)? else { return Ok(()) };
        let open = &mut self.runs[run];
        let at = open.required[0].len();
        if let Some(&last) = open.required[0].last() {
            if values[0] < last {
                let expected = format!("a time not before {last} of row {}", open.last_row);
                let column = self.layout.required[0];
                self.leave_out(number, Some(column), values[0].to_string(), &expected);
                return Ok(());
            }
            self.repeated_stamps += usize::from(values[0] == last);
        }
        for (kept, value) in open.required.iter_mut().zip(values) {
            kept.push(value);
        }
        open.last_row = number;
        let optional = self.layout.optional.iter().zip(&mut self.tallies);
        for ((column, tally), (kept, label)) in
            optional.zip(open.optional.iter_mut().zip(&mut open.labels))
        {
            let cell = row.number(column.index);
            match complaint(cell, column.quantity.is_none()) {
                None => {
                    tally.number();
                    kept.put(at, cell.unwrap_or_default());
                }
                Some(expected) => {
                    let (name, text) = (&self.layout.names[column.index], row.text(column.index));
                    tally.no_number(self.file, number, name, &text, expected);
                    label.see(&text);
                }
            }
        }
        Ok(())
    }

    /// Counts a row that is left out; `column` is `None` where no single cell is to blame.
    pub fn leave_out(&mut self, row: u64, column: Option<usize>, found: String, expected: &str) {
        self.bad.count += 1;
        if self.bad.first.len() < NAMED_BAD_ROWS {
            let column = column.map_or("(all)", |at| self.layout.names[at].as_str()).into();
            let (file, expected) = (self.file.into(), expected.into());
            self.bad.first.push(BadCell { file, row, column, found, expected });
        }
    }

    /// Counts a row whose cells are too few or too many.
    pub fn leave_out_ragged(&mut self, row: u64, found: String) {
        self.rows += 1;
        let expected = format!("{} cells as in the header", self.layout.names.len());
        self.leave_out(row, None, found, &expected);
    }

    /// The run the row belongs to, opened if it is new; `None` if the row does not say.
    fn run_of(&mut self, number: u64, row: &impl Row) -> Result<Option<usize>, DataError> {
        let name = match self.layout.run {
            Some(column) => {
                let name = row.text(column);
                if name.is_empty() {
                    self.leave_out(number, Some(column), quoted(&name), "the run's name");
                    return Ok(None);
                }
                name
            }
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
                found: format!("a run more after {MAX_RUNS} of them"),
                expected: format!("at most {MAX_RUNS} runs; is this column the row's number?"),
            }));
        }
        let columns = self.layout.optional.len();
        self.current = self.runs.len();
        self.by_name.insert(name.as_ref().into(), self.current);
        self.runs.push(OpenRun {
            name: name.as_ref().into(),
            required: Default::default(),
            optional: std::iter::repeat_with(Column::default).take(columns).collect(),
            labels: std::iter::repeat_with(Label::default).take(columns).collect(),
            last_row: number,
        });
        Ok(Some(self.current))
    }

    /// Judges the optional columns, takes the rows out that lack one, and closes the file.
    pub fn finish(mut self) -> Result<FileData, DataError> {
        let file = self.file;
        if self.rows == 0 {
            return Err(DataError::File {
                file: file.into(),
                found: "a header and no rows".into(),
                expected: "a row per sample".into(),
            });
        }
        let fates: Vec<Fate> = self.tallies.iter().map(Tally::fate).collect();
        for (tally, _) in
            self.tallies.iter().zip(&fates).filter(|(_, fate)| **fate == Fate::Numeric)
        {
            self.bad.first.extend(tally.first_bad.iter().cloned());
        }
        let mut runs = Vec::with_capacity(self.runs.len());
        for open in self.runs.drain(..) {
            let (run, lost) = close(open, &self.layout, &fates);
            self.bad.count += lost;
            if !run.required[0].is_empty() {
                runs.push(run);
            }
        }
        self.bad.first.sort_by_key(|cell| cell.row);
        self.bad.first.dedup_by_key(|cell| cell.row);
        self.bad.first.truncate(NAMED_BAD_ROWS);
        if self.bad.count as f64 > MAX_BAD_SHARE * self.rows as f64 {
            let first = self.bad.first[0].clone();
            return Err(DataError::TooManyBad { first, bad: self.bad.count, rows: self.rows });
        }

        let Layout { joint, optional, mut left_out, mut notes, names, .. } = self.layout;
        for (column, fate) in optional.iter().zip(&fates) {
            let is_label =
                runs.iter().all(|run| run.labels.iter().any(|(name, _)| *name == column.name));
            let why = match fate {
                Fate::Numeric => continue,
                Fate::Empty => "it holds no value",
                Fate::Text if is_label => "it is text (kept as a label of each run)",
                Fate::Text => "it is text that changes inside a run",
            };
            left_out.push(LeftOutColumn { name: names[column.index].clone(), why: why.into() });
        }
        if self.repeated_stamps > 0 {
            let (file, rows) = (file.display(), self.repeated_stamps);
            notes.push(format!(
                "{file}: {rows} rows repeat the time stamp before them and are kept"
            ));
        }
        let stays = |at: usize| fates[at] == Fate::Numeric;
        let optional = optional.into_iter().enumerate().filter(|(at, _)| stays(*at));
        let optional = optional.map(|(_, column)| column).collect();
        Ok(FileData { joint, runs, optional, left_out, notes, rows: self.rows, bad: self.bad })
    }
}

/// Closes a run: drops the optional columns that do not stay, and then the rows that lack a value
/// in one that does. Returns how many rows those were.
fn close(open: OpenRun, layout: &Layout, fates: &[Fate]) -> (CleanRun, usize) {
    let rows = open.required[0].len();
    let mut required = open.required;
    let mut optional = Vec::new();
    let mut labels = Vec::new();
    for (at, (column, label)) in open.optional.into_iter().zip(open.labels).enumerate() {
        match fates[at] {
            Fate::Numeric => optional.push(column.close(rows)),
            Fate::Text => {
                let name = &layout.optional[at].name;
                labels.extend(label.close(rows).map(|text| (name.clone(), text)));
            }
            Fate::Empty => {}
        }
    }
    let keep: Vec<bool> =
        (0..rows).map(|row| optional.iter().all(|column| !column[row].is_nan())).collect();
    let lost = keep.iter().filter(|keep| !**keep).count();
    for column in required.iter_mut().chain(&mut optional) {
        if lost > 0 {
            let mut keep = keep.iter();
            column.retain(|_| *keep.next().unwrap_or(&false));
        }
        column.shrink_to_fit();
    }
    let name = layout.run.map(|_| String::from_utf8_lossy(&open.name).into_owned());
    (CleanRun { name, required, optional, labels }, lost)
}
