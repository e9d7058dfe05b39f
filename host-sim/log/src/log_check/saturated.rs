//! Columns that are clipped at an end of their range: a saturated sensor, a drive at its limit.
//!
//! At a clipped end, many consecutive rows hold exactly the same extreme value, while elsewhere the column rarely repeats itself
//! and is not straight. The column approaches its end with speed and stops there within a row. A joint that comes to rest slows
//! down first, and stands because it does not move: so any column but the torque counts only in rows with a velocity, and a
//! velocity or a torque not at 0. A velocity is clipped only if the position goes on faster.

use super::column::Column;
use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::wrap::is_velocity_derived;
use crate::Run;
use crate::number::figure;
use crate::segment::stretches;
use crate::statistics::{extent, median};
use crate::torque_fit::least_moving_speed;
use compensator_core::quantity::Quantity;
use std::ops::Range;

/// Minimum number of consecutive rows with the extreme value.
const MIN_CONSECUTIVE_ROWS: usize = 4;

/// Minimum number of such rows in total.
const MIN_ROWS: usize = 12;

/// Minimum share of such rows.
const MIN_SHARE: f64 = 1e-3;

/// Maximum share of rows, away from the ends, that repeat the previous value, and that continue the line of the two before.
const MAX_REPEAT_SHARE: f64 = 0.1;
const MAX_STRAIGHT_SHARE: f64 = 0.5;

/// Minimum last step before the end, as a share of the median step, and the share of the stretches that have it. The end cuts the
/// step off.
const MIN_ARRIVAL: f64 = 0.1;
const MIN_ARRIVING_SHARE: f64 = 0.5;

/// Minimum speed of the position beside a clipped velocity, relative to it.
const MIN_HIDDEN_SPEED: f64 = 1.05;

pub fn saturated(log: &Log) -> Vec<LogFinding> {
    let slow = least_moving_speed(log.data);
    let is_filled = |column: &&Column| {
        // A filled column is constant after its last value.
        log.data.source(&column.name).is_some_and(|source| source.filled > 0)
    };
    let columns = log.columns.iter().filter(|column| !is_filled(column));
    columns.flat_map(|column| of_column(log, column, slow)).collect()
}

fn of_column(log: &Log, column: &Column, slow: f64) -> Vec<LogFinding> {
    let ends = extent(column.values());
    if ends[0] == ends[1] || !is_lively(column, ends) {
        return Vec::new();
    }
    let mut steps: Vec<f64> =
        column.pairs().map(|(one, next)| (next - one).abs()).filter(|step| *step > 0.0).collect();
    let usual = median(&mut steps).unwrap_or_default();
    let count = column.values().count() as f64;
    let at_end = |end: f64| {
        let (mut rows, mut stretches, mut arriving) = (0, 0.0, 0.0);
        for (index, values) in column.runs.iter().enumerate() {
            for stretch in standing(values, end) {
                if !may_be_clipped(log, column, &log.data.runs[index], &stretch, end, slow) {
                    continue;
                }
                let arrives = stretch.start == 0
                    || (end - values[stretch.start - 1]).abs() > MIN_ARRIVAL * usual;
                rows += stretch.len();
                stretches += 1.0;
                arriving += f64::from(u8::from(arrives));
            }
        }
        let is_clipped = rows >= MIN_ROWS
            && rows as f64 >= MIN_SHARE * count
            && arriving >= MIN_ARRIVING_SHARE * stretches;
        is_clipped.then(|| finding(column, end, rows))
    };
    ends.into_iter().filter_map(at_end).collect()
}

fn finding(column: &Column, end: f64, rows: usize) -> LogFinding {
    let words = format!(
        "{} stands at {} {} in {rows} rows and goes no further: it is clipped there. It is taken as it stands.",
        column.name,
        figure(end),
        column.unit
    );
    LogFindingKind::Saturated.finding(&[&column.name], end, &column.unit, words)
}

/// Returns true if a column, away from its ends, rarely repeats a value or continues a line: noise and curves show where it
/// stands by itself.
fn is_lively(column: &Column, ends: [f64; 2]) -> bool {
    let (mut repeats, mut straight, mut inside) = (0usize, 0usize, 0usize);
    for values in &column.runs {
        for row in values.windows(3).filter(|row| !row.iter().any(|value| ends.contains(value))) {
            inside += 1;
            repeats += usize::from(row[1] == row[2]);
            straight += usize::from((row[2] - 2.0 * row[1] + row[0]).abs() <= 1e-9 * row[1].abs());
        }
    }
    let share = |count: usize| count as f64 / inside.max(1) as f64;
    inside > 0 && share(repeats) <= MAX_REPEAT_SHARE && share(straight) <= MAX_STRAIGHT_SHARE
}

/// Returns the stretches of the extreme value.
fn standing(values: &[f64], end: f64) -> impl Iterator<Item = Range<usize>> {
    let same = stretches(values, |one, next| one == next);
    same.filter(move |rows| values[rows.start] == end && rows.len() >= MIN_CONSECUTIVE_ROWS)
}

/// Returns true unless the joint's rest, or its true motion, explains that a column stands.
fn may_be_clipped(
    log: &Log,
    column: &Column,
    run: &Run,
    rows: &Range<usize>,
    end: f64,
    slow: f64,
) -> bool {
    let mean_speed = || {
        let speeds = run.velocity[rows.clone()].iter().map(|velocity| velocity.abs());
        speeds.sum::<f64>() / rows.len() as f64
    };
    let is_derived = is_velocity_derived(log.data);
    match column.quantity {
        Some(Quantity::Position) => !is_derived && mean_speed() > slow,
        Some(Quantity::Velocity) => {
            let Some(position) = run.get(Quantity::Position).filter(|_| !is_derived) else {
                return end != 0.0 && !is_derived;
            };
            let (first, last) = (rows.start, rows.end - 1);
            let took = run.time_s[last] - run.time_s[first];
            let speed = (position[last] - position[first]).abs() / took;
            took > 0.0 && speed > MIN_HIDDEN_SPEED * end.abs() && speed > slow
        }
        Some(Quantity::Torque) => end != 0.0,
        _ => mean_speed() > slow,
    }
}
