//! Channels that are held over several rows: the sensor is read less often than the log is written.
//!
//! Repeated values alone are not enough: a joint rests, a quantised column stays within a step, a smooth one may be
//! printed with few digits. A column is held if it changes nearly always after the same number of rows, and then by more
//! than its smallest step. If several are held, the report states which is read last.
//!
//! A held covariate is used as logged: its values in between were never measured. A torque that is held while the joint
//! moves is wrong in every row but the first, and so is a held motion under a live torque. Then only the rows in which
//! the held channel is read anew are kept ([`fresh_rows`]). If both are held and are read in the same rows, these rows are
//! kept. If they are read at different times, no row is left out.

use super::column::{Column, quantile};
use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::motion::quantum::quantum;
use crate::number::figure;
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
    /// The changes, as (run, row).
    changes: Vec<(usize, usize)>,
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
        _ => return None,
    };
    let most = held.rows.round().max(2.0) as usize;
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
    let runs = log.columns[held.column].runs.iter().map(fresh).collect();
    Some(FreshRows { is_motion_held, is_torque_held, runs })
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

pub fn held(log: &Log) -> Vec<LogFinding> {
    let found: Vec<Held> =
        (0..log.columns.len()).filter_map(|index| held_column(log, index)).collect();
    let fresh = fresh_rows(log);
    let findings = found.iter().map(|held| {
        let column = &log.columns[held.column];
        let corrected = is_corrected(log, fresh.as_ref(), column);
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
        LogFinding {
            kind: LogFindingKind::HeldChannel,
            columns: vec![column.name.clone()],
            value: held.rows * log.sensors.step_s,
            unit: "s".into(),
            corrected,
            in_words: format!(
                "{} is held: it is read anew every {} rows only ({} s){order}. {done}",
                column.name,
                figure(held.rows),
                figure(held.rows * log.sensors.step_s)
            ),
        }
    });
    findings.collect()
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
    for (place, (run, values)) in log.data.runs.iter().zip(&column.runs).enumerate() {
        let mut last = 0;
        for row in 1..values.len() {
            if values[row] == values[row - 1] {
                continue;
            }
            let rested = column.is_motion()
                && run.velocity[last..row].iter().any(|velocity| velocity.abs() < still);
            if last > 0 && !rested {
                lengths.push((row - last) as f64);
                changes.push((place, row));
                jumps.push((values[row] - values[row - 1]).abs());
            }
            last = row;
        }
    }
    if lengths.len() < MIN_CHANGES {
        return None;
    }
    let usual = quantile(&mut lengths.clone(), 0.5);
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
    for (run, row) in &held.changes {
        let before = other.changes.partition_point(|place| *place <= (*run, *row));
        if let Some((_, start)) =
            before.checked_sub(1).map(|at| other.changes[at]).filter(|p| p.0 == *run)
            && let Some(count) = counts.get_mut(row - start)
        {
            *count += 1;
        }
    }
    let (rows, count) = counts.iter().enumerate().max_by_key(|(_, count)| **count)?;
    let regular = *count as f64 >= MIN_FOLLOWING_SHARE * held.changes.len() as f64;
    (regular && rows > 0 && rows as f64 <= 0.5 * held.rows).then_some(rows)
}
