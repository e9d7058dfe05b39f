//! Evaluation of a file at its end: missing values, columns that are kept, starts of recordings.
//!
//! The order matters. A file of several joints is rejected first, because two joints also look like a clock that runs
//! backwards. Then the rows of each run are ordered and split into recordings (`order`), and the optional columns are
//! evaluated and filled (`fill`). Last, rows without a velocity or a torque are removed. They count as rows of another
//! channel if the file merges several channels, and as bad rows if not.
//!
//! A file is a merge if velocity or torque occurs in a smaller share of rows than [`MERGED_CHANNEL_SHARE`], at regular
//! distances. It is a partial merge if rows with neither hold values of columns that are rare elsewhere.

mod clock_check;
mod notes;

use std::mem::take;
use std::ops::Range;

use super::clean::{Cleaner, FileData, OpenRun, retain};
use super::columns::{ColumnUse, FINITE};
use super::counter_wrap::{ClockWrap, unwrap_times};
use super::dataset::{LeftOutColumn, Run};
use super::duplicates::remove_duplicates;
use super::error::{DataError, asked_rows};
use super::fill::{Fill, fill};
use super::header::Layout;
use super::number::figure;
use super::options::MAX_BAD_SHARE;
use super::order::{check_order, late_rows, recordings, sorting_order};
use super::segment::GAP_FACTOR;
use super::spread::spread;
use super::statistics::median_step;
use super::velocity::differences;

/// Maximum share of rows with a value of velocity or torque for it to be a channel with its own stamps.
const MERGED_CHANNEL_SHARE: f64 = 0.6;

/// Maximum share of rows with a value of a covariate, among the rows with velocity or torque, for the covariate to be
/// such a channel.
const SEPARATE_COVARIATE_SHARE: f64 = 0.5;

/// Minimum share of the rows with neither velocity nor torque that such covariates must explain.
const MIN_EXPLAINED_SHARE: f64 = 0.9;

/// One recording of a run: the rows that are kept, in order.
struct Recording {
    /// Index of the run.
    run: usize,
    /// Number of the recording in the run, from 1; `None` if there is only one.
    number: Option<usize>,
    rows: Range<usize>,
}

/// The columns of a recording.
#[derive(Clone, Copy)]
struct Columns<'a> {
    /// Time, velocity, torque.
    required: &'a [Vec<f64>; 3],
    /// The optional columns that are kept.
    optional: &'a [Vec<f64>],
    /// The places of these among all optional columns.
    numeric: &'a [usize],
}

/// How the channels of a file are merged.
#[derive(Clone, Copy, PartialEq)]
enum ChannelLayout {
    /// Each row is one sample of all columns.
    Single,
    /// Velocity and torque share rows; other columns have rows of their own.
    SeparateCovariates,
    /// Velocity and torque have rows of their own.
    Merged,
}

impl Cleaner<'_> {
    /// Evaluates the columns, fills missing values, splits recordings and returns the data.
    ///
    /// # Errors
    /// If the file holds no rows, several joints, too many bad rows, or text in a column that `--columns` names.
    pub fn finish(mut self) -> Result<FileData, DataError> {
        self.check_not_empty()?;
        self.check_single_joint()?;
        self.check_signs()?;
        self.check_rates()?;
        let uses = self.column_uses()?;
        let channels = self.channel_layout();
        let (mut repeated, mut late, mut duplicates) = (0, 0, 0);
        let mut all: Vec<Recording> = Vec::new();
        let mut runs = take(&mut self.runs);
        self.continue_clock(&mut runs);
        self.check_clock(&runs)?;
        for (at, run) in runs.iter_mut().enumerate() {
            duplicates += remove_duplicates(run);
            late += sort_rows(run);
            repeated += self.remove_backward_rows(run);
            let is_one = self.layout.run.is_some();
            let whole = 0..run.row_numbers.len();
            let found = if is_one { vec![whole] } else { recordings(&run.required[0]) };
            let several = found.len() > 1;
            all.extend(found.into_iter().filter(|rows| !rows.is_empty()).enumerate().map(
                |(number, rows)| Recording { run: at, number: several.then_some(number + 1), rows },
            ));
        }
        let spread =
            if channels == ChannelLayout::Single { spread_rows(&mut runs, &all) } else { 0 };
        let uses = self.drop_incomplete_columns(uses, &mut runs, &all);
        let filled = self.fill_optional(&uses, &mut runs, &all);
        if channels == ChannelLayout::Merged {
            fill_velocity(&mut runs, &all);
        }
        let (mut clean, mut other_rows) = (Vec::new(), 0);
        for recording in &all {
            let (run, others) = self.extract(&mut runs[recording.run], recording, &uses, channels);
            clean.extend(run);
            other_rows += others;
        }
        self.check_bad_share()?;
        self.add_column_notes(&uses, &filled, &clean);
        self.add_row_notes(channels, other_rows, all.len() - runs.len());
        self.add_order_notes(late, duplicates, repeated, spread);
        let Self { mut layout, clock, rows, bad, .. } = self;
        let Layout { optional, sources, .. } = &mut layout;
        for ((column, filled), column_use) in optional.iter().zip(&filled).zip(&uses) {
            if let Some(source) = sources.iter_mut().find(|of| of.name == column.name) {
                source.filled = filled.map_or(0, |(rows, _)| rows);
                source.fill = filled.map(|(_, method)| method.description());
            }
            if *column_use != ColumnUse::Numeric {
                sources.retain(|source| source.name != column.name);
            }
        }
        let mut uses = uses.iter();
        optional.retain(|_| uses.next() == Some(&ColumnUse::Numeric));
        Ok(FileData { layout, runs: clean, origin_ns: clock.origin_ns, rows, bad })
    }

    /// Continues the times across the wraps of their counter.
    fn continue_clock(&mut self, runs: &mut [OpenRun]) {
        if !self.clock.reads_stamps() {
            return;
        }
        let count_s = self.clock.reading.conversion.map(|conversion| conversion.apply(1.0));
        let count_s = count_s.filter(|count_s| *count_s > 0.0 && *count_s != 1.0);
        for run in runs {
            if let Some(wrap) = unwrap_times(&mut run.required[0], count_s) {
                let ClockWrap { bits, range_s, count } = wrap;
                let range = figure(range_s);
                self.note(format!(
                    "the clock is a counter of {bits} bits and wraps {count} times, each after {range} s: the times go on"
                ));
            }
        }
    }

    fn check_not_empty(&self) -> Result<(), DataError> {
        if self.rows > 0 {
            return Ok(());
        }
        let mut selection = self.layout.only.iter().zip(&self.selection_texts);
        if let Some((only, texts)) = selection.next_back().filter(|_| self.unselected_rows > 0) {
            let column = &self.layout.names[only.index];
            let asked = asked_rows(column, &only.values);
            return Err(DataError::request(
                format!("{}: {asked}", self.file.display()),
                format!("none of {} rows", self.unselected_rows),
                format!("one of {}", texts.listed()),
            ));
        }
        Err(DataError::file(self.file, "a header and no rows", "a row per sample"))
    }

    fn check_single_joint(&self) -> Result<(), DataError> {
        for (column, texts) in self.layout.joint_names.iter().zip(&self.joint_names) {
            let names_joints = column.is_certain || texts.changes;
            let several = !texts.is_truncated && texts.values.len() > 1 && names_joints;
            if several {
                let (names, column) =
                    (texts.values.iter(), self.layout.names[column.index].clone());
                return Err(DataError::SeveralJoints {
                    file: self.file.into(),
                    place: format!("in column {column}"),
                    column,
                    joints: names.map(|name| String::from_utf8_lossy(name).into_owned()).collect(),
                });
            }
        }
        Ok(())
    }

    /// Decides how the optional columns are used. A column of text that `--columns` names is an error.
    fn column_uses(&self) -> Result<Vec<ColumnUse>, DataError> {
        let uses: Vec<ColumnUse> = self.tallies.iter().map(|tally| tally.column_use()).collect();
        let columns = self.layout.optional.iter().zip(&self.tallies).zip(&uses);
        for ((column, tally), column_use) in columns {
            let text = tally.first_text.as_ref().filter(|_| column.is_mapped);
            if let (ColumnUse::Text, Some(text)) = (column_use, text) {
                return Err(DataError::Cell(text.clone()));
            }
        }
        Ok(uses)
    }

    fn channel_layout(&self) -> ChannelLayout {
        let [velocities, torques] = &self.missing;
        let both = self.rows - self.covariate_only_rows.min(self.rows);
        let fewest = velocities.numbers.min(torques.numbers);
        let is_rare = (fewest as f64) < MERGED_CHANNEL_SHARE * both as f64;
        let distance = if fewest > 0 { self.regular_distance() } else { None };
        if is_rare && distance.is_some() {
            return ChannelLayout::Merged;
        }
        let is_slow = |numbers: usize| (numbers as f64) < SEPARATE_COVARIATE_SHARE * both as f64;
        let slow =
            self.tallies.iter().filter(|tally| is_slow(tally.numbers - tally.covariate_only));
        let explained: usize = slow.map(|tally| tally.covariate_only).sum();
        let rows = self.covariate_only_rows;
        let is_explained = explained as f64 >= MIN_EXPLAINED_SHARE * rows as f64;
        // A channel with a higher rate than velocity and torque.
        let is_slower = (both as f64) < MERGED_CHANNEL_SHARE * self.rows as f64;
        let is_slower = is_slower && distance.is_some_and(|distance| distance > 1);
        if rows > 0 && (is_explained || is_slower) {
            return ChannelLayout::SeparateCovariates;
        }
        ChannelLayout::Single
    }

    /// Returns the usual distance of the values of the rarer of velocity and torque, in rows, if it is regular.
    fn regular_distance(&self) -> Option<usize> {
        let rarer = 1 + usize::from(self.missing[1].numbers < self.missing[0].numbers);
        let mut distances = Vec::new();
        for run in &self.runs {
            let there = run.required[rarer].iter().enumerate().filter(|(_, value)| !value.is_nan());
            let rows: Vec<usize> = there.map(|(row, _)| row).collect();
            distances.extend(rows.windows(2).map(|pair| pair[1] - pair[0]));
        }
        if distances.is_empty() {
            return None;
        }
        let mut quantile = |share: f64| {
            let at = ((distances.len() - 1) as f64 * share) as usize;
            *distances.select_nth_unstable(at).1
        };
        let (usual, long) = (quantile(0.5), quantile(0.9));
        (long <= 2 * usual + 1).then_some(usual)
    }

    /// Removes the rows whose clock goes back, and returns how many rows repeat a stamp.
    fn remove_backward_rows(&mut self, run: &mut OpenRun) -> usize {
        let found = check_order(&run.required[0], self.layout.run.is_some());
        for &(row, before) in &found.backward {
            let time = &run.required[0];
            let number = run.row_numbers[before];
            let expected = format!("a time not before {} of row {number}", time[before]);
            let column = self.layout.required[0].index;
            self.reject_row(run.row_numbers[row], Some(column), time[row].to_string(), &expected);
        }
        if !found.backward.is_empty() {
            let mut keep = vec![true; run.row_numbers.len()];
            found.backward.iter().for_each(|(row, _)| keep[*row] = false);
            run.retain(&keep);
        }
        found.repeated
    }

    /// Leaves out a numeric column that has no value in whole recordings, if these hold more rows than may be bad.
    fn drop_incomplete_columns(
        &mut self,
        mut uses: Vec<ColumnUse>,
        runs: &mut [OpenRun],
        all: &[Recording],
    ) -> Vec<ColumnUse> {
        let numeric =
            |(_, column_use): &(usize, &mut ColumnUse)| **column_use == ColumnUse::Numeric;
        for (at, column_use) in uses.iter_mut().enumerate().filter(numeric) {
            let is_empty = |recording: &&Recording| {
                let values = &runs[recording.run].optional[at];
                values
                    .get(recording.rows.clone())
                    .is_none_or(|values| values.iter().all(|v| v.is_nan()))
            };
            let empty: Vec<&Recording> = all.iter().filter(is_empty).collect();
            let rows: usize = empty.iter().map(|recording| recording.rows.len()).sum();
            if rows as f64 > MAX_BAD_SHARE * self.rows as f64 {
                *column_use = ColumnUse::Empty;
                let name = self.run_name(&runs[empty[0].run], empty[0].number);
                let column = &self.layout.optional[at];
                let why = format!("run {name} holds no value of it");
                let header = self.layout.names[column.reading.index].clone();
                self.layout.left_out.push(LeftOutColumn { name: header, why });
            }
        }
        for run in runs {
            let rows = run.row_numbers.len();
            for (column, column_use) in run.optional.iter_mut().zip(&uses) {
                if *column_use == ColumnUse::Numeric {
                    column.resize(rows, f64::NAN);
                } else {
                    *column = Vec::new();
                }
            }
        }
        uses
    }

    /// Fills the optional columns. Returns for each the number of filled rows and the method.
    fn fill_optional(
        &self,
        uses: &[ColumnUse],
        runs: &mut [OpenRun],
        all: &[Recording],
    ) -> Vec<Option<(usize, Fill)>> {
        let fill_column = |(at, column_use): (usize, &ColumnUse)| {
            let is_whole = |run: &OpenRun| run.optional[at].iter().all(|v| !v.is_nan());
            if *column_use != ColumnUse::Numeric || runs.iter().all(is_whole) {
                return None;
            }
            let method = match self.layout.optional[at].quantity {
                Some(_) => Fill::Interpolate,
                None => Fill::for_values(runs.iter().flat_map(|run| &run.optional[at])),
            };
            let mut filled = 0;
            for recording in all {
                let run = &mut runs[recording.run];
                let time = &run.required[0][recording.rows.clone()];
                let values = &mut run.optional[at][recording.rows.clone()];
                filled += fill(time, values, method, f64::INFINITY);
            }
            Some((filled, method))
        };
        uses.iter().enumerate().map(fill_column).collect()
    }

    /// Extracts the complete rows of a recording as a run. Also returns the number of rows of other channels.
    fn extract(
        &mut self,
        run: &mut OpenRun,
        recording: &Recording,
        uses: &[ColumnUse],
        channels: ChannelLayout,
    ) -> (Option<Run>, usize) {
        let rows = recording.rows.clone();
        let is_whole = rows.len() == run.row_numbers.len();
        let part = |column: &mut Vec<f64>| {
            if is_whole { take(column) } else { column[rows.clone()].to_vec() }
        };
        let mut required = run.required.each_mut().map(part);
        let is_numeric = |at: &usize| uses[*at] == ColumnUse::Numeric;
        let numeric: Vec<usize> = (0..uses.len()).filter(is_numeric).collect();
        let mut optional: Vec<Vec<f64>> =
            numeric.iter().map(|at| part(&mut run.optional[*at])).collect();
        let row_numbers = &run.row_numbers[rows.clone()];
        let columns = Columns { required: &required, optional: &optional, numeric: &numeric };
        let (keep, other_rows) = self.complete_rows(row_numbers, columns, channels);
        if keep.contains(&false) {
            let columns = required.iter_mut().chain(&mut optional);
            columns.for_each(|column| retain(column, &keep));
        }
        if required[0].is_empty() {
            return (None, other_rows);
        }
        if self.layout.is_position {
            required[1] = differences(&required[0], &required[1]);
        }
        required.iter_mut().chain(&mut optional).for_each(Vec::shrink_to_fit);
        let columns = self.layout.optional.iter().zip(&run.labels).zip(uses);
        let text = columns.filter(|(_, column_use)| **column_use == ColumnUse::Text);
        let labels = text.filter_map(|((column, label), _)| {
            Some((column.name.clone(), label.text(run.accepted)?))
        });
        let labels = labels.collect();
        let name = self.run_name(run, recording.number);
        let [time_s, velocity, torque] = required;
        let columns = Run { time_s, velocity, torque, extra: optional, ..Run::default() };
        (Some(Run { name, labels, ..columns }), other_rows)
    }

    /// Returns for each row of a recording whether it is complete, and the number of rows of other channels. Leaves out the other
    /// rows.
    fn complete_rows(
        &mut self,
        row_numbers: &[u64],
        columns: Columns,
        channels: ChannelLayout,
    ) -> (Vec<bool>, usize) {
        let Columns { required, optional, numeric } = columns;
        let extent = |values: &Vec<f64>| {
            let first = values.iter().position(|value| !value.is_nan()).unwrap_or(values.len());
            let last = values.iter().rposition(|value| !value.is_nan()).unwrap_or_default();
            first..last + 1
        };
        let with_velocity = extent(&required[1]);
        let mut other_rows = 0;
        let mut keep = vec![true; row_numbers.len()];
        for (row, keep) in keep.iter_mut().enumerate() {
            let [no_velocity, no_torque] = [1, 2].map(|at| required[at][row].is_nan());
            let lacking = optional.iter().position(|column| column[row].is_nan());
            *keep = !no_velocity && !no_torque && lacking.is_none();
            let is_other_channel = match channels {
                ChannelLayout::Single => false,
                ChannelLayout::SeparateCovariates => no_velocity && no_torque,
                // Before the first and after the last velocity there is nothing to interpolate.
                ChannelLayout::Merged => no_torque || !with_velocity.contains(&row),
            };
            if is_other_channel {
                other_rows += 1;
            } else if !*keep {
                let lacking = || numeric[lacking.unwrap_or_default()];
                let index = match (no_velocity, no_torque) {
                    (true, _) => self.layout.required[1].index,
                    (_, true) => self.layout.required[2].index,
                    _ => self.layout.optional[lacking()].reading.index,
                };
                self.reject_missing_value(row_numbers[row], index);
            }
        }
        (keep, other_rows)
    }

    /// Leaves out a row because of a cell without a value.
    fn reject_missing_value(&mut self, row: u64, column: usize) {
        let mut cells = self.missing.iter().chain(&self.tallies).flat_map(|tally| &tally.first_bad);
        let name = &self.layout.names[column];
        let cell = cells.find(|cell| cell.row == row && cell.column == *name);
        let found = cell.map_or("no value".into(), |cell| cell.found.clone());
        self.reject_row(row, Some(column), found, FINITE);
    }

    /// Returns a run's name: the file's own, or the number of the recording; empty if there is only one.
    fn run_name(&self, run: &OpenRun, number: Option<usize>) -> String {
        match self.layout.run {
            Some(_) => String::from_utf8_lossy(&run.name).into_owned(),
            None => number.map(|number| number.to_string()).unwrap_or_default(),
        }
    }

    /// Returns an error if the file has too many bad rows.
    fn check_bad_share(&mut self) -> Result<(), DataError> {
        self.bad.sort();
        self.bad.check(self.rows, self.layout.max_bad_share)
    }
}

/// Aligns the optional columns with the rows of a run, and sorts the rows if they are one recording in another order.
/// Returns the number of rows that came after a later one.
fn sort_rows(run: &mut OpenRun) -> usize {
    let rows = run.row_numbers.len();
    for column in &mut run.optional {
        column.resize(if column.is_empty() { 0 } else { rows }, f64::NAN);
    }
    let Some(order) = sorting_order(&run.required[0], MAX_BAD_SHARE) else { return 0 };
    let late = late_rows(&run.required[0]);
    for column in run.columns_mut().filter(|column| !column.is_empty()) {
        *column = order.iter().map(|row| column[*row]).collect();
    }
    run.row_numbers = order.iter().map(|row| run.row_numbers[*row]).collect();
    late
}

/// Spreads rows of equal stamps in time. Returns the number of rows that get another time.
fn spread_rows(runs: &mut [OpenRun], all: &[Recording]) -> usize {
    let spread_recording = |recording: &Recording| {
        let [time, velocity, torque] = &mut runs[recording.run].required;
        let rows = recording.rows.clone();
        spread(&mut time[rows.clone()], [&velocity[rows.clone()], &torque[rows]])
    };
    all.iter().map(spread_recording).sum()
}

/// Interpolates the velocity of merged channels between its own stamps, unless they are a gap apart.
fn fill_velocity(runs: &mut [OpenRun], all: &[Recording]) {
    for recording in all {
        let [time, velocity, _] = &mut runs[recording.run].required;
        let rows = recording.rows.clone();
        let (time, velocity) = (&time[rows.clone()], &mut velocity[rows]);
        let measured = time.iter().zip(&*velocity).filter(|(_, value)| !value.is_nan());
        let stamps: Vec<f64> = measured.map(|(time, _)| *time).collect();
        let reach = median_step(&stamps).map_or(0.0, |step| GAP_FACTOR * step);
        fill(time, velocity, Fill::Interpolate, reach);
    }
}
