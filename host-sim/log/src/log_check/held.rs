//! Channels that are held over several rows: the sensor is read less often than the log is written.
//!
//! Repeated values alone are not enough: a joint rests, a quantised column stays within a step, a smooth one may be
//! printed with few digits. A column is held if it changes nearly always after the same number of rows, and then by more
//! than its smallest step. If several are held, the report states which is read last.
//!
//! A column may also be held now and then, where the logger is faster than a bus that is not regular. Then it repeats a value
//! in rows in which the joint travels by several of its steps, which no sensor that is read in each row does.
//!
//! A held covariate is used as logged: its values in between were never measured. A torque that is held while the joint
//! moves is wrong in every row but the first, and so is a held motion under a live torque. Then only the rows in which
//! the held channel is read anew are kept ([`fresh_rows`]). If both are held and are read in the same rows, these rows are
//! kept. If they are read at different times, no row is left out.

use super::column::Column;
use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::wrap::is_velocity_derived;
use crate::dataset::Place;
use crate::motion::quantum;
use crate::number::figure;
use crate::statistics::{median, quantile};
use crate::{Dataset, Run};

/// Minimum number of changes for a decision.
const MIN_CHANGES: usize = 40;

/// Minimum share of the holds of usual length, within a row or a quarter of it.
const MIN_REGULAR_SHARE: f64 = 0.75;

/// Minimum share of the changes that exceed the column's smallest step.
const MIN_LARGE_SHARE: f64 = 0.6;

/// Minimum share of the changes that follow another column's at the same distance.
const MIN_FOLLOWING_SHARE: f64 = 0.7;

/// A held column.
struct Held {
    column: usize,
    rows: f64,
    /// The rows in which it changes, in order.
    changes: Vec<Place>,
}

/// The rows of each run in which the held torque or motion is read anew.
pub struct FreshRows {
    /// True if the motion is held.
    pub is_motion_held: bool,
    /// True if the torque is held.
    pub is_torque_held: bool,
    /// The rows of each run.
    pub runs: Vec<Vec<usize>>,
}

impl FreshRows {
    /// Returns the log with these rows only.
    #[must_use]
    pub fn select(&self, data: &Dataset) -> Dataset {
        let mut kept = data.clone();
        for (run, rows) in kept.runs.iter_mut().zip(&self.runs) {
            *run = run.with_columns(|column| {
                rows.iter().filter_map(|row| column.get(*row)).copied().collect()
            });
        }
        // The differences across the rows that are left out were 0, and too large after them.
        if self.is_motion_held && is_velocity_derived(data) {
            kept.runs.iter_mut().for_each(Run::derive_velocity);
        }
        kept.rows = kept.runs.iter().map(Run::len).sum();
        kept
    }
}

/// Returns the [`FreshRows`], or `None` if nothing is to be corrected.
pub fn fresh_rows(log: &Log) -> Option<FreshRows> {
    if !log.correct.corrects(LogFindingKind::HeldChannel) {
        return None;
    }
    let held = |name: &str| {
        let index = log.columns.iter().position(|column| column.name == name)?;
        held_column(log, index)
    };
    // A quantised angle of a uniform motion also changes at regular distances, but its velocity does not.
    let velocity = held(log.velocity());
    let motion = match log.column(log.position()) {
        Some(_) => held(log.position()).filter(|held| {
            velocity.as_ref().is_some_and(|velocity| (velocity.rows - held.rows).abs() < 0.5)
        }),
        None => velocity,
    };
    let torque = held(log.torque());
    let (is_motion_held, is_torque_held) = (motion.is_some(), torque.is_some());
    let held = match (motion, torque) {
        (Some(motion), None) => motion,
        (None, Some(torque)) => torque,
        (Some(motion), Some(torque)) if are_read_together(&motion, &torque) => motion,
        (None, None) => return repeated(log).map(|found| found.fresh),
        _ => return None,
    };
    let most = held.rows.round().max(2.0) as usize;
    let runs = rows_read(&log.columns[held.column], most);
    Some(FreshRows { is_motion_held, is_torque_held, runs })
}

/// Returns the rows of each run in which a column is read anew: where it changes, and at the latest after `most` rows.
fn rows_read(column: &Column, most: usize) -> Vec<Vec<usize>> {
    let fresh = |values: &&[f64]| {
        let mut rows = vec![0];
        for row in 1..values.len() {
            let last = rows[rows.len() - 1];
            // Equal values may also be new readings: the joint rests.
            if values[row] != values[row - 1] || row - last >= most {
                rows.push(row);
            }
        }
        rows
    };
    column.runs.iter().map(fresh).collect()
}

/// A position, or a velocity without one, that repeats values although the joint moves.
struct Repeated {
    /// Index of the column.
    column: usize,
    /// Share of the rows in motion that repeat the value before.
    share: f64,
    fresh: FreshRows,
}

/// Minimum travel of a row that shows whether a position is read anew, in steps of the position.
const MIN_TRAVEL_STEPS: f64 = 2.0;

/// Rows on either side of a row that show its travel.
const TRAVEL_ROWS: usize = 4;

/// Minimum share of such rows that repeat a value, and minimum number of them.
const MIN_REPEATED_SHARE: f64 = 0.03;
const MIN_REPEATED_ROWS: usize = 20;

/// Minimum median travel of the row after a hold, in those of as many rows as the hold has. A joint that has rested goes on with the
/// travel of one row.
const MIN_CATCH_UP: f64 = 0.7;

/// Finds a motion that is held now and then.
fn repeated(log: &Log) -> Option<Repeated> {
    let column = log.columns.iter().position(|column| column.name == log.position())?;
    let position = &log.columns[column];
    let least =
        2.0 * TRAVEL_ROWS as f64 * MIN_TRAVEL_STEPS * quantum(position.runs.iter().copied());
    let (mut travelling, mut repeats, mut lengths) = (0usize, Vec::new(), Vec::new());
    let mut catch_ups = Vec::new();
    for (index, values) in position.runs.iter().enumerate() {
        let mut length = 1.0;
        for row in TRAVEL_ROWS..values.len().saturating_sub(TRAVEL_ROWS) {
            let travel = (values[row + TRAVEL_ROWS] - values[row - TRAVEL_ROWS]).abs();
            if travel <= least {
                length = 1.0;
                continue;
            }
            travelling += 1;
            let step = (values[row] - values[row - 1]).abs();
            if step == 0.0 {
                repeats.push(Place { run: index, row });
                length += 1.0;
                continue;
            }
            lengths.push(length);
            if length > 1.0 {
                catch_ups.push(step * (2 * TRAVEL_ROWS) as f64 / (travel * length));
            }
            length = 1.0;
        }
    }
    let share = repeats.len() as f64 / travelling.max(1) as f64;
    let catches_up = median(&mut catch_ups).unwrap_or_default() > MIN_CATCH_UP;
    if repeats.len() < MIN_REPEATED_ROWS || share < MIN_REPEATED_SHARE || !catches_up {
        return None;
    }
    let repeats_too = |column: Option<&Column>| {
        let again = |Place { run, row }: &&Place| {
            column.is_some_and(|column| column.runs[*run][*row] == column.runs[*run][row - 1])
        };
        repeats.iter().filter(again).count() as f64 > MIN_FOLLOWING_SHARE * repeats.len() as f64
    };
    // A velocity of its own that goes on shows the motion.
    if !is_velocity_derived(log.data) && !repeats_too(log.column(log.velocity())) {
        return None;
    }
    let is_torque_held = repeats_too(log.column(log.torque()));
    let most = quantile(&mut lengths, 0.95).unwrap_or_default().round().max(2.0) as usize;
    let fresh = FreshRows { is_motion_held: true, is_torque_held, runs: rows_read(position, most) };
    Some(Repeated { column, share, fresh })
}

/// Returns the finding of a motion that is held now and then.
fn finding_of_repeated(log: &Log, found: &Repeated) -> LogFinding {
    let name = &log.columns[found.column].name;
    let corrected = log.correct.corrects(LogFindingKind::HeldChannel);
    let done = if corrected { "These rows are left out." } else { "They are used, as asked." };
    let words = format!(
        "{name} is held now and then: {} % of the rows in motion repeat the value before. {done}",
        figure(100.0 * found.share)
    );
    LogFindingKind::HeldChannel
        .finding(&[name], found.share, "of the rows", words)
        .corrected(corrected)
}

/// Returns true if rows are left out because this column is held.
fn is_corrected(log: &Log, fresh: Option<&FreshRows>, column: &Column) -> bool {
    let is_motion = column.name == log.position() || column.name == log.velocity();
    let is_torque = column.name == log.torque();
    fresh
        .is_some_and(|fresh| fresh.is_motion_held && is_motion || fresh.is_torque_held && is_torque)
}

/// Returns true if two columns change in the same rows.
fn are_read_together(one: &Held, other: &Held) -> bool {
    let common = one.changes.iter().filter(|place| other.changes.binary_search(place).is_ok());
    let fewest = one.changes.len().min(other.changes.len());
    common.count() as f64 >= MIN_FOLLOWING_SHARE * fewest as f64
}

/// Returns the findings of held channels; `fresh` are the rows that are kept because of them.
pub fn held(log: &Log, fresh: Option<&FreshRows>) -> Vec<LogFinding> {
    let found: Vec<Held> =
        (0..log.columns.len()).filter_map(|index| held_column(log, index)).collect();
    let is_regular = |name: &str| found.iter().any(|held| log.columns[held.column].name == name);
    let now_and_then = match is_regular(log.position()) || is_regular(log.torque()) {
        true => None,
        false => repeated(log).map(|found| finding_of_repeated(log, &found)),
    };
    let findings = found.iter().map(|held| {
        let column = &log.columns[held.column];
        let corrected = is_corrected(log, fresh, column);
        let done = if corrected {
            "The rows between are left out: their values are of an earlier time."
        } else {
            "It is taken as it stands."
        };
        let last = found
            .iter()
            .filter(|other| other.column != held.column)
            .filter_map(|other| Some((other, after(held, other)?)))
            .min_by_key(|(_, rows)| *rows);
        let order = match last {
            Some((other, rows)) => {
                format!(", {rows} rows after {} is", log.columns[other.column].name)
            }
            None => String::new(),
        };
        let words = format!(
            "{} is held: it is read anew every {} rows only ({} s){order}. {done}",
            column.name,
            figure(held.rows),
            figure(held.rows * log.sensors.step_s)
        );
        LogFindingKind::HeldChannel
            .finding(&[&column.name], held.rows * log.sensors.step_s, "s", words)
            .corrected(corrected)
    });
    findings.chain(now_and_then).collect()
}

fn held_column(log: &Log, index: usize) -> Option<Held> {
    let column = &log.columns[index];
    // Half of the holds must last for two rows or more.
    let repeats = column.pairs().filter(|(before, now)| before == now);
    if repeats.take(MIN_CHANGES / 2).count() < MIN_CHANGES / 2 {
        return None;
    }
    let still = 0.02 * log.sensors.speed;
    let (mut lengths, mut changes, mut jumps) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (run, values)) in log.data.runs.iter().zip(&column.runs).enumerate() {
        let mut last = 0;
        for row in 1..values.len() {
            if values[row] == values[row - 1] {
                continue;
            }
            let rested = column.is_motion()
                && run.velocity[last..row].iter().any(|velocity| velocity.abs() < still);
            if last > 0 && !rested {
                lengths.push((row - last) as f64);
                changes.push(Place { run: index, row });
                jumps.push((values[row] - values[row - 1]).abs());
            }
            last = row;
        }
    }
    if lengths.len() < MIN_CHANGES {
        return None;
    }
    let usual = median(&mut lengths.clone()).unwrap_or_default();
    let within = (0.25 * usual).max(if usual > 2.0 { 1.0 } else { 0.0 });
    let alike = lengths.iter().filter(|length| (**length - usual).abs() <= within).count();
    if usual < 2.0 || (alike as f64) < MIN_REGULAR_SHARE * lengths.len() as f64 {
        return None;
    }
    let step = quantum(column.runs.iter().copied());
    let large = jumps.iter().filter(|jump| **jump > 1.5 * step).count();
    if (large as f64) < MIN_LARGE_SHARE * jumps.len() as f64 {
        return None;
    }
    let mean = lengths.iter().sum::<f64>() / lengths.len() as f64;
    Some(Held { column: index, rows: if usual > 3.0 { mean } else { usual }, changes })
}

/// Returns by how many rows `held` changes after `other`, if it does so regularly and within half a hold.
fn after(held: &Held, other: &Held) -> Option<usize> {
    if (held.rows - other.rows).abs() > 0.1 * other.rows {
        return None;
    }
    let mut counts = vec![0usize; held.rows.ceil() as usize + 1];
    for change in &held.changes {
        let before = other.changes.partition_point(|place| place <= change);
        let start = before.checked_sub(1).map(|at| other.changes[at]);
        if let Some(start) = start.filter(|start| start.run == change.run)
            && let Some(count) = counts.get_mut(change.row - start.row)
        {
            *count += 1;
        }
    }
    let (rows, count) = counts.iter().enumerate().max_by_key(|(_, count)| **count)?;
    let regular = *count as f64 >= MIN_FOLLOWING_SHARE * held.changes.len() as f64;
    (regular && rows > 0 && rows as f64 <= 0.5 * held.rows).then_some(rows)
}
