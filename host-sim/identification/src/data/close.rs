//! A file is over: what its holes mean, which columns stay, where its starts begin.
//!
//! The order matters. Several joints in one file are refused before anything is said of clocks that run backwards,
//! which is what two joints look like. Then each run is put in order and cut into starts (`order`), the optional columns
//! are judged and filled (`fill`), and last the rows go that lack a velocity or a torque: as rows of another channel where
//! the file is a merge of several, as bad rows where it is not.
//!
//! A merge shows in this: a velocity or a torque that is in fewer than [`OF_ANOTHER`] of the rows, at regular distances; or
//! rows that hold neither, and values of columns that hold nothing elsewhere.

use std::mem::take;
use std::ops::Range;

use super::clean::{CleanRun, Cleaner, FileData, MAX_BAD_SHARE, OpenRun};
use super::clock;
use super::columns::{FINITE, Fate, is_nothing};
use super::contract::RUN;
use super::dataset::LeftOutColumn;
use super::error::{BadCell, DataError, NAMED_BAD_ROWS};
use super::fill::{Fill, fill};
use super::header::Layout;
use super::order::{PAUSE, order, starts};
use super::segment::{GAP_FACTOR, median_step};
use super::velocity::differences;

/// A velocity or torque in a smaller share of the rows is a channel with stamps of its own.
const OF_ANOTHER: f64 = 0.6;

/// A covariate in a smaller share of the rows that hold a velocity or a torque is one, too.
const SLOW: f64 = 0.5;

/// Of the rows with neither velocity nor torque, the share that such covariates must account for.
const EXPLAINED: f64 = 0.9;

/// One start of a run: rows that stay, in order.
struct Start {
    /// The run it is of, and its number in it where there are several.
    run: usize,
    number: Option<usize>,
    rows: Range<usize>,
}

/// What the file is, by its holes.
#[derive(Clone, Copy, PartialEq)]
enum Channels {
    /// One row, one sample.
    One,
    /// Velocity and torque come together, other columns in rows of their own.
    Beside,
    /// Velocity and torque have stamps of their own.
    Merged,
}

impl Cleaner<'_> {
    /// Judges the columns, fills and cuts, and closes the file.
    pub fn finish(mut self) -> Result<FileData, DataError> {
        self.refuse_nothing()?;
        self.refuse_several_joints()?;
        let fates = self.fates()?;
        let channels = self.channels();
        let mut repeated = 0;
        let mut all: Vec<Start> = Vec::new();
        let mut runs = take(&mut self.runs);
        for (at, run) in runs.iter_mut().enumerate() {
            repeated += self.put_in_order(run);
            let is_one = self.layout.run.is_some();
            let whole = 0..run.lines.len();
            let found = if is_one { vec![whole] } else { starts(&run.required[0]) };
            let several = found.len() > 1;
            all.extend(found.into_iter().filter(|rows| !rows.is_empty()).enumerate().map(
                |(number, rows)| Start { run: at, number: several.then_some(number + 1), rows },
            ));
        }
        let fates = self.lacking(fates, &mut runs, &all);
        let filled = self.fill_optional(&fates, &mut runs, &all);
        if channels == Channels::Merged {
            fill_velocity(&mut runs, &all);
        }
        let (mut clean, mut passed) = (Vec::new(), 0);
        for start in &all {
            let (run, others) = self.cut(&mut runs[start.run], start, &fates, channels);
            clean.extend(run);
            passed += others;
        }
        self.judge()?;
        self.tell_columns(&fates, &filled, &clean);
        self.tell_rows(channels, passed, repeated, all.len() - runs.len());
        let Layout { joint, run, optional, left_out, notes, mut sources, .. } = self.layout;
        let has_runs = run.is_some();
        for ((column, filled), fate) in optional.iter().zip(&filled).zip(&fates) {
            if let Some(source) = sources.iter_mut().find(|of| of.name == column.name) {
                source.filled = filled.map_or(0, |(rows, _)| rows);
                source.fill = filled.map(|(_, how)| how.words());
            }
            if *fate != Fate::Numeric {
                sources.retain(|source| source.name != column.name);
            }
        }
        let optional = optional.into_iter().zip(&fates);
        let optional = optional.filter(|(_, fate)| **fate == Fate::Numeric);
        let optional = optional.map(|(column, _)| column).collect();
        let (rows, bad, origin_ns) = (self.rows, self.bad, self.clock.origin_ns);
        Ok(FileData {
            joint,
            runs: clean,
            optional,
            left_out,
            notes,
            sources,
            origin_ns,
            has_runs,
            rows,
            bad,
        })
    }

    fn refuse_nothing(&self) -> Result<(), DataError> {
        if self.rows > 0 {
            return Ok(());
        }
        let mut chosen = self.layout.only.iter().zip(&self.chosen_by);
        if let Some((only, texts)) = chosen.next_back().filter(|_| self.elsewhere > 0) {
            let column = &self.layout.names[only.index];
            let asked = format!("{column}={}", only.values.join(","));
            return Err(DataError::Request {
                what: format!("{}: --where {asked}", self.file.display()),
                found: format!("none of {} rows", self.elsewhere),
                expected: format!("one of {}", texts.listed()),
            });
        }
        Err(DataError::File {
            file: self.file.into(),
            found: "a header and no rows".into(),
            expected: "a row per sample".into(),
        })
    }

    fn refuse_several_joints(&self) -> Result<(), DataError> {
        for (column, texts) in self.layout.joint_names.iter().zip(&self.joint_names) {
            let several = !texts.many && texts.seen.len() > 1 && (column.is_sure || texts.changes);
            if several {
                let (names, column) = (texts.seen.iter(), self.layout.names[column.index].clone());
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

    /// What becomes of the optional columns; one that was asked for and is text is an error.
    fn fates(&self) -> Result<Vec<Fate>, DataError> {
        let fates: Vec<Fate> = self.tallies.iter().map(|tally| tally.fate()).collect();
        let columns = self.layout.optional.iter().zip(&self.tallies).zip(&fates);
        for ((column, tally), fate) in columns {
            if column.mapped && *fate == Fate::Text {
                return Err(DataError::Cell(tally.first_bad[0].clone()));
            }
        }
        Ok(fates)
    }

    fn channels(&self) -> Channels {
        let [velocities, torques] = &self.holes;
        let both = self.rows - self.apart.min(self.rows);
        let fewest = velocities.numbers.min(torques.numbers);
        if fewest > 0 && (fewest as f64) < OF_ANOTHER * both as f64 && self.is_regular() {
            return Channels::Merged;
        }
        let is_slow = |numbers: usize| (numbers as f64) < SLOW * both as f64;
        let slow = self.tallies.iter().filter(|tally| is_slow(tally.numbers - tally.apart));
        let explained: usize = slow.map(|tally| tally.apart).sum();
        if self.apart > 0 && explained as f64 >= EXPLAINED * self.apart as f64 {
            return Channels::Beside;
        }
        Channels::One
    }

    /// Whether the rarer of velocity and torque comes at regular distances, in rows.
    fn is_regular(&self) -> bool {
        let rarer = 1 + usize::from(self.holes[1].numbers < self.holes[0].numbers);
        let mut distances = Vec::new();
        for run in &self.runs {
            let there = run.required[rarer].iter().enumerate().filter(|(_, value)| !value.is_nan());
            let rows: Vec<usize> = there.map(|(row, _)| row).collect();
            distances.extend(rows.windows(2).map(|pair| pair[1] - pair[0]));
        }
        if distances.is_empty() {
            return false;
        }
        let mut quantile = |share: f64| {
            let at = ((distances.len() - 1) as f64 * share) as usize;
            *distances.select_nth_unstable(at).1
        };
        let (usual, long) = (quantile(0.5), quantile(0.9));
        long <= 2 * usual + 1
    }

    /// Takes out the rows whose clock goes back; how many repeat a stamp.
    fn put_in_order(&mut self, run: &mut OpenRun) -> usize {
        let rows = run.lines.len();
        for column in &mut run.optional {
            column.values.resize(if column.values.is_empty() { 0 } else { rows }, f64::NAN);
        }
        let found = order(&run.required[0], self.layout.run.is_some());
        for &(row, before) in &found.back {
            let time = &run.required[0];
            let expected =
                format!("a time not before {} of row {}", time[before], run.lines[before]);
            let column = self.layout.required[0].index;
            self.leave_out(run.lines[row], Some(column), time[row].to_string(), &expected);
        }
        if !found.back.is_empty() {
            let mut keep = vec![true; rows];
            found.back.iter().for_each(|(row, _)| keep[*row] = false);
            let optional = run.optional.iter_mut().map(|column| &mut column.values);
            run.required.iter_mut().chain(optional).for_each(|column| retain(column, &keep));
            retain(&mut run.lines, &keep);
        }
        found.repeated
    }

    /// Columns of which whole starts hold no value are none, where that concerns more rows than may be bad.
    fn lacking(&mut self, mut fates: Vec<Fate>, runs: &mut [OpenRun], all: &[Start]) -> Vec<Fate> {
        for (at, fate) in fates.iter_mut().enumerate().filter(|(_, fate)| **fate == Fate::Numeric) {
            let is_empty = |start: &&Start| {
                let values = &runs[start.run].optional[at].values;
                values
                    .get(start.rows.clone())
                    .is_none_or(|values| values.iter().all(|v| v.is_nan()))
            };
            let empty: Vec<&Start> = all.iter().filter(is_empty).collect();
            let rows: usize = empty.iter().map(|start| start.rows.len()).sum();
            if rows as f64 > MAX_BAD_SHARE * self.rows as f64 {
                *fate = Fate::Empty;
                let name = self.run_name(&runs[empty[0].run], empty[0].number);
                let column = &self.layout.optional[at];
                let why = format!("run {} holds no value of it", name.unwrap_or_default());
                let header = self.layout.names[column.reading.index].clone();
                self.layout.left_out.push(LeftOutColumn { name: header, why });
            }
        }
        for run in runs {
            let rows = run.lines.len();
            for (column, fate) in run.optional.iter_mut().zip(&fates) {
                if *fate == Fate::Numeric {
                    column.values.resize(rows, f64::NAN);
                } else {
                    column.values = Vec::new();
                }
            }
        }
        fates
    }

    /// Fills the optional columns: of each, the rows and how.
    fn fill_optional(
        &self,
        fates: &[Fate],
        runs: &mut [OpenRun],
        all: &[Start],
    ) -> Vec<Option<(usize, Fill)>> {
        let fill_column = |(at, fate): (usize, &Fate)| {
            let is_whole = |run: &OpenRun| run.optional[at].values.iter().all(|v| !v.is_nan());
            if *fate != Fate::Numeric || runs.iter().all(is_whole) {
                return None;
            }
            let how = match self.layout.optional[at].quantity {
                Some(_) => Fill::Interpolate,
                None => Fill::suiting(runs.iter().flat_map(|run| &run.optional[at].values)),
            };
            let mut filled = 0;
            for start in all {
                let run = &mut runs[start.run];
                let time = &run.required[0][start.rows.clone()];
                let values = &mut run.optional[at].values[start.rows.clone()];
                filled += fill(time, values, how, f64::INFINITY);
            }
            Some((filled, how))
        };
        fates.iter().enumerate().map(fill_column).collect()
    }

    /// The rows of a start that stay, as a run, and how many are another channel's.
    fn cut(
        &mut self,
        run: &mut OpenRun,
        start: &Start,
        fates: &[Fate],
        channels: Channels,
    ) -> (Option<CleanRun>, usize) {
        let rows = start.rows.clone();
        let is_whole = rows.len() == run.lines.len();
        let part = |column: &mut Vec<f64>| {
            if is_whole { take(column) } else { column[rows.clone()].to_vec() }
        };
        let mut required = run.required.each_mut().map(part);
        let numeric = || fates.iter().enumerate().filter(|(_, fate)| **fate == Fate::Numeric);
        let mut optional: Vec<Vec<f64>> =
            numeric().map(|(at, _)| part(&mut run.optional[at].values)).collect();
        let there = |values: &Vec<f64>| {
            let first = values.iter().position(|value| !value.is_nan()).unwrap_or(values.len());
            let last = values.iter().rposition(|value| !value.is_nan()).unwrap_or_default();
            first..last + 1
        };
        let moving = there(&required[1]);
        let mut passed = 0;
        let mut keep = vec![true; rows.len()];
        for (row, keep) in keep.iter_mut().enumerate() {
            let [no_velocity, no_torque] = [1, 2].map(|at| required[at][row].is_nan());
            let lacking = optional.iter().position(|column| column[row].is_nan());
            *keep = !no_velocity && !no_torque && lacking.is_none();
            let is_others = match channels {
                Channels::One => false,
                Channels::Beside => no_velocity && no_torque,
                // Before the first velocity and behind the last there is nothing to interpolate.
                Channels::Merged => no_torque || !moving.contains(&row),
            };
            if is_others {
                passed += 1;
            } else if !*keep {
                let lacking = || numeric().nth(lacking.unwrap_or_default()).map_or(0, |of| of.0);
                let index = match (no_velocity, no_torque) {
                    (true, _) => self.layout.required[1].index,
                    (_, true) => self.layout.required[2].index,
                    _ => self.layout.optional[lacking()].reading.index,
                };
                self.leave_out_hole(run.lines[rows.start + row], index);
            }
        }
        if keep.contains(&false) {
            let columns = required.iter_mut().chain(&mut optional);
            columns.for_each(|column| retain(column, &keep));
        }
        if required[0].is_empty() {
            return (None, passed);
        }
        if self.layout.is_position {
            required[1] = differences(&required[0], &required[1]);
        }
        required.iter_mut().chain(&mut optional).for_each(Vec::shrink_to_fit);
        let columns = self.layout.optional.iter().zip(&run.labels).zip(fates);
        let labels = columns.filter(|(_, fate)| **fate == Fate::Text).filter_map(|(column, _)| {
            let (column, label) = column;
            Some((column.name.clone(), label.text(run.taken)?))
        });
        let labels = labels.collect();
        let name = self.run_name(run, start.number);
        (Some(CleanRun { name, required, optional, labels }), passed)
    }

    /// Counts a row for a cell that holds no value.
    fn leave_out_hole(&mut self, row: u64, column: usize) {
        let mut seen = self.holes.iter().chain(&self.tallies).flat_map(|tally| &tally.first_bad);
        let name = &self.layout.names[column];
        let cell = seen.find(|cell| cell.row == row && cell.column == *name);
        let found = cell.map_or("no value".into(), |cell| cell.found.clone());
        self.leave_out(row, Some(column), found, FINITE);
    }

    /// A run's name: the file's own, or its number among the starts.
    fn run_name(&self, run: &OpenRun, number: Option<usize>) -> Option<String> {
        match self.layout.run {
            Some(_) => Some(String::from_utf8_lossy(&run.name).into_owned()),
            None => number.map(|number| number.to_string()),
        }
    }

    /// Refuses a file of too many bad rows.
    fn judge(&mut self) -> Result<(), DataError> {
        self.bad.first.sort_by_key(|cell| cell.row);
        self.bad.first.dedup_by_key(|cell| cell.row);
        self.bad.first.truncate(NAMED_BAD_ROWS);
        let (bad, rows) = (self.bad.count, self.rows);
        match self.bad.first.first() {
            Some(first) if bad as f64 > MAX_BAD_SHARE * rows as f64 => {
                Err(DataError::TooManyBad { first: first.clone(), bad, rows })
            }
            _ => Ok(()),
        }
    }

    /// Says which columns do not stay, and which were filled.
    fn tell_columns(
        &mut self,
        fates: &[Fate],
        filled: &[Option<(usize, Fill)>],
        clean: &[CleanRun],
    ) {
        let is_label = |name: &String| {
            clean.iter().all(|run| run.labels.iter().any(|(label, _)| label == name))
        };
        let file = self.file.display();
        for (at, (column, fate)) in self.layout.optional.iter().zip(fates).enumerate() {
            let (name, header) = (&column.name, &self.layout.names[column.reading.index]);
            let tally = &self.tallies[at];
            if let Some((_, how)) = filled[at] {
                let (numbers, rows) = (tally.numbers, self.rows);
                let words = how.words();
                // Texts stand in quotes there, and so do the words for nothing.
                let is_text = |cell: &&BadCell| {
                    cell.found.starts_with('"')
                        && !is_nothing(cell.found.trim_matches('"').as_bytes())
                };
                let text = match tally.first_bad.iter().find(is_text) {
                    Some(cell) => format!("; row {} holds {}", cell.row, cell.found),
                    None => String::new(),
                };
                let there = format!("{name} is in {numbers} of {rows} rows");
                self.layout.notes.push(format!("{file}: {there} and is {words}{text}"));
            }
            let is_told = self.layout.left_out.iter().any(|column| column.name == *header);
            let why = match fate {
                Fate::Numeric => continue,
                Fate::Empty if is_told => continue,
                Fate::Empty => "it holds no value",
                Fate::Text if is_label(name) => "it is text (kept as a label of each run)",
                Fate::Text => "it is text that changes inside a run",
            };
            self.layout.left_out.push(LeftOutColumn { name: header.clone(), why: why.into() });
        }
        let lost = self.layout.optional.iter().zip(fates);
        for (column, _) in lost.filter(|(column, fate)| column.mapped && **fate == Fate::Empty) {
            let (name, header) = (&column.name, &self.layout.names[column.reading.index]);
            let asked = format!("--columns {name}={header}");
            self.layout
                .notes
                .push(format!("{file}: {asked}: {name} is left out, as {header} holds no value"));
        }
    }

    /// Says what else became of the rows.
    fn tell_rows(&mut self, channels: Channels, passed: usize, repeated: usize, starts: usize) {
        let mut said = Vec::new();
        if self.elsewhere > 0 {
            let asked =
                self.layout.only.iter().map(|only| {
                    format!("{}={}", self.layout.names[only.index], only.values.join(","))
                });
            let asked: Vec<String> = asked.collect();
            said.push(format!("{} rows are not of {}", self.elsewhere, asked.join(" and ")));
        }
        if let Some(origin) = self.clock.origin_ns {
            said.push(format!("times count from {}", clock::origin(origin)));
        }
        if self.layout.is_position {
            said.push("no velocity is logged: it is the difference of the positions".into());
        }
        match channels {
            Channels::Merged => said.push(format!(
                "velocity and torque have stamps of their own: the {passed} rows without a torque are passed over, \
                 and the velocity is interpolated in time where the torque has its rows"
            )),
            Channels::Beside => said.push(format!(
                "{passed} rows hold neither velocity nor torque, only columns with stamps of their own"
            )),
            Channels::One => {}
        }
        if starts > 0 {
            said.push(format!(
                "there is no column {RUN}: {} starts are told apart by pauses of more than {} s, or by the clock, \
                 which begins anew",
                starts + 1,
                PAUSE.0
            ));
        }
        if repeated > 0 {
            said.push(format!("{repeated} rows repeat the time stamp before them and are kept"));
        }
        let file = self.file.display();
        self.layout.notes.extend(said.into_iter().map(|words| format!("{file}: {words}")));
    }
}

/// In a merge of channels, interpolates the velocity between stamps of its own that are no gap apart.
fn fill_velocity(runs: &mut [OpenRun], all: &[Start]) {
    for start in all {
        let [time, velocity, _] = &mut runs[start.run].required;
        let (time, velocity) = (&time[start.rows.clone()], &mut velocity[start.rows.clone()]);
        let there = time.iter().zip(&*velocity).filter(|(_, value)| !value.is_nan());
        let own: Vec<f64> = there.map(|(time, _)| *time).collect();
        let reach = median_step(&own).map_or(0.0, |step| GAP_FACTOR * step);
        fill(time, velocity, Fill::Interpolate, reach);
    }
}

/// Keeps what is to be kept.
fn retain<T>(column: &mut Vec<T>, keep: &[bool]) {
    let mut keep = keep.iter();
    column.retain(|_| *keep.next().unwrap_or(&false));
}
