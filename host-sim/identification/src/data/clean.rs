//! May this row stay?
//!
//! All file formats end here, row by row, so that a log means the same in each. A row must have its
//! run, a finite time, velocity and torque, and a time that is not before the row kept last in the same
//! run; otherwise it is left out, counted and (the first few) named. Time stamps may *repeat*: a logger faster
//! than its clock writes such rows, and all of them are measurements. Runs may be interleaved row by row; each has its
//! own clock.
//!
//! What only the whole file can show is decided when it is over (`close`): a velocity that is empty in every other row
//! is a channel of its own in a merged log, in one row of a hundred it is a bad row. Until then holes are NaN.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;

use super::clock::Clock;
use super::columns::{Column, FINITE, Label, Tally, is_nothing};
use super::dataset::{LeftOutColumn, SourceColumn};
use super::error::{BadCell, BadRows, DataError, NAMED_BAD_ROWS, listed, quoted};
use super::header::{Layout, OptionalColumn};
use super::reading::is_list;
use super::split::same;
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

/// The same, with what helps where the cell is a list.
fn expected(complaint: &'static str, cell: &[u8]) -> &'static str {
    if is_list(cell) {
        "a number; of a list, --columns NAME=COLUMN[0] takes the first"
    } else {
        complaint
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
    pub sources: Vec<SourceColumn>,
    /// What the times count from, ns since 1970, where the file says it.
    pub origin_ns: Option<i128>,
    /// Whether the runs' names are the file's own.
    pub has_runs: bool,
    pub rows: usize,
    pub bad: BadRows,
}

/// One run of a file.
#[derive(Debug)]
pub(super) struct CleanRun {
    /// `None` if the file has no run column and is one start.
    pub name: Option<String>,
    /// Time, velocity, torque.
    pub required: [Vec<f64>; 3],
    /// Parallel to [`FileData::optional`].
    pub optional: Vec<Vec<f64>>,
    pub labels: Vec<(String, String)>,
}

/// A run while it is read. Holes are NaN.
#[derive(Debug)]
pub(super) struct OpenRun {
    pub name: Box<[u8]>,
    /// Time, velocity (or position), torque.
    pub required: [Vec<f64>; 3],
    pub optional: Vec<Column>,
    pub labels: Vec<Label>,
    /// Rows of the file, as an editor counts them.
    pub lines: Vec<u64>,
    /// Rows that were taken.
    pub taken: usize,
}

/// The texts a column holds.
#[derive(Debug, Default)]
pub(super) struct Texts {
    pub seen: Vec<Box<[u8]>>,
    /// Whether there are more than are kept.
    pub many: bool,
    last: usize,
    /// Whether it changes inside a run.
    pub changes: bool,
}

impl Texts {
    /// Kept at most: more values do not name joints.
    const MOST: usize = 32;

    fn see(&mut self, text: &[u8]) {
        if self.seen.get(self.last).is_some_and(|last| **last == *text) {
            return;
        }
        match self.seen.iter().position(|seen| **seen == *text) {
            Some(at) => self.last = at,
            None if self.seen.len() < Self::MOST => {
                self.last = self.seen.len();
                self.seen.push(text.into());
            }
            None => self.many = true,
        }
    }

    /// For a message.
    pub fn listed(&self) -> String {
        let texts: Vec<String> =
            self.seen.iter().map(|text| String::from_utf8_lossy(text).into_owned()).collect();
        if self.many { format!("{} ..", listed(&texts)) } else { listed(&texts) }
    }
}

/// Takes rows and keeps the good ones.
pub(super) struct Cleaner<'a> {
    pub(super) file: &'a Path,
    pub(super) layout: Layout,
    pub(super) clock: Clock,
    pub(super) runs: Vec<OpenRun>,
    by_name: HashMap<Box<[u8]>, usize>,
    /// The run of the row before: mostly that of the next one, too.
    current: usize,
    /// The run of the row taken last.
    previous: Option<usize>,
    /// Of the optional columns.
    pub(super) tallies: Vec<Tally>,
    /// Of velocity and torque.
    pub(super) holes: [Tally; 2],
    /// Rows with neither.
    pub(super) apart: usize,
    /// Of the columns that may name joints, and of those rows are chosen by.
    pub(super) joint_names: Vec<Texts>,
    pub(super) chosen_by: Vec<Texts>,
    /// Rows that were not chosen.
    pub(super) elsewhere: usize,
    pub(super) rows: usize,
    pub(super) bad: BadRows,
}

impl<'a> Cleaner<'a> {
    pub fn new(file: &'a Path, layout: Layout) -> Self {
        let tallies = layout.optional.iter().map(|_| Tally::default()).collect();
        let texts = |count| std::iter::repeat_with(Texts::default).take(count).collect();
        Cleaner {
            file,
            clock: Clock::new(layout.required[0]),
            runs: Vec::new(),
            by_name: HashMap::new(),
            current: 0,
            previous: None,
            tallies,
            holes: Default::default(),
            apart: 0,
            joint_names: texts(layout.joint_names.len()),
            chosen_by: texts(layout.only.len()),
            elsewhere: 0,
            rows: 0,
            bad: BadRows::default(),
            layout,
        }
    }

    /// Takes one row, counted as [`BadCell::row`] says. Fails only if there are too many runs.
    pub fn take(&mut self, number: u64, row: &impl Row) -> Result<(), DataError> {
        if !self.is_chosen(row) {
            self.elsewhere += 1;
            return Ok(());
        }
        self.rows += 1;
        let time = self.clock.time_s(row);
        if let Some(complaint) = complaint(time, true) {
            self.leave_out_cell(number, row, 0, complaint);
            return Ok(());
        }
        let mut values = [time.unwrap_or_default(), f64::NAN, f64::NAN];
        for (at, value) in values.iter_mut().enumerate().skip(1) {
            let cell = self.layout.required[at].value(row);
            match complaint(cell, false) {
                None => *value = cell.unwrap_or_default(),
                Some(complaint) if cell.is_none_or(f64::is_nan) => {
                    let column = self.layout.required[at].index;
                    let text = row.text(column);
                    if !is_nothing(&text) {
                        self.leave_out_cell(number, row, at, complaint);
                        return Ok(());
                    }
                    let name = &self.layout.names[column];
                    self.holes[at - 1].no_number(self.file, number, name, &text, FINITE);
                }
                Some(complaint) => {
                    self.leave_out_cell(number, row, at, complaint);
                    return Ok(());
                }
            }
        }
        let Some(run) = self.run_of(number, row)? else { return Ok(()) };
        let is_apart = values[1].is_nan() && values[2].is_nan();
        self.apart += usize::from(is_apart);
        let open = &mut self.runs[run];
        let at = open.required[0].len();
        for (kept, value) in open.required.iter_mut().zip(values) {
            kept.push(value);
        }
        for (tally, value) in self.holes.iter_mut().zip(&values[1..]) {
            tally.numbers += usize::from(!value.is_nan());
        }
        open.lines.push(number);
        open.taken += 1;
        let optional = self.layout.optional.iter().zip(&mut self.tallies);
        for ((column, tally), (kept, label)) in
            optional.zip(open.optional.iter_mut().zip(&mut open.labels))
        {
            let cell = column.reading.value(row);
            match complaint(cell, column.quantity.is_none()) {
                None => {
                    tally.number();
                    tally.apart += usize::from(is_apart);
                    kept.put(at, cell.unwrap_or_default());
                }
                Some(complaint) => {
                    let index = column.reading.index;
                    let (name, text) = (&self.layout.names[index], row.text(index));
                    let expected = expected(complaint, &text);
                    tally.no_number(self.file, number, name, &text, expected);
                    label.see(&text);
                }
            }
        }
        for (texts, column) in self.joint_names.iter_mut().zip(&self.layout.joint_names) {
            let before = texts.last;
            texts.see(&row.text(column.index));
            texts.changes |= before != texts.last && self.previous == Some(run);
        }
        self.previous = Some(run);
        Ok(())
    }

    /// Whether `--where` takes the row.
    fn is_chosen(&mut self, row: &impl Row) -> bool {
        let mut is_chosen = true;
        for (only, texts) in self.layout.only.iter().zip(&mut self.chosen_by) {
            let text = row.text(only.index);
            texts.see(&text);
            let text = String::from_utf8_lossy(&text);
            is_chosen &= only.values.iter().any(|value| same(&text, value));
        }
        is_chosen
    }

    /// Leaves a row out for one of its required cells: of time, velocity, torque.
    fn leave_out_cell(&mut self, number: u64, row: &impl Row, at: usize, complaint: &'static str) {
        let column = self.layout.required[at].index;
        let text = row.text(column);
        let expected = expected(complaint, &text);
        self.leave_out(number, Some(column), quoted(&text), expected);
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
            lines: Vec::new(),
            taken: 0,
        });
        Ok(Some(self.current))
    }
}
