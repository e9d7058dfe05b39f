//! A torque of exactly 0 while the joint moves: the drive was off, and something else moved the joint.
//!
//! A joint that coasts has no torque either, but then inertia and friction add up to zero. So the law of the other rows decides:
//! it expects a torque in these rows, and no law follows all rows. A torque with few digits is 0 near each reversal; such rows
//! do not follow each other.

use super::LogFindingKind;
use super::column::telling_column;
use super::finding::LogFinding;
use super::outlier::{first_place, leave_out};
use super::torque_fit::{MIN_ROWS, fit, moving_rows};
use crate::Dataset;
use crate::motion::quantum::quantum;
use compensator_core::quantity::Quantity;
use std::collections::BTreeSet;

/// Minimum number of consecutive rows with a torque of 0.
const MIN_CONSECUTIVE_ROWS: usize = 6;

/// Minimum torque that the law expects in them: in errors of the law, and in steps of the column.
const MIN_EXPECTED_ERRORS: f64 = 3.0;
const MIN_EXPECTED_QUANTA: f64 = 3.0;

/// Minimum error of the law of all rows, relative to that of the law of the rows with a torque.
const MIN_SCATTER_RATIO: f64 = 1.5;

/// Finds rows in which the drive was off, and leaves them out if `correct` is true.
pub fn drive_off(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let Some(off) = rows_off(&data) else { return (data, Vec::new()) };
    let count: usize = off.iter().map(BTreeSet::len).sum();
    let name = Quantity::Torque.name(data.joint);
    let place = first_place(&data, &off);
    let is_off: Vec<Vec<bool>> = data
        .runs
        .iter()
        .zip(&off)
        .map(|(run, off)| (0..run.len()).map(|row| off.contains(&row)).collect())
        .collect();
    let column = match telling_column(&data, &is_off) {
        Some([on, _]) => format!("; --where {on} reads the others only"),
        None => String::new(),
    };
    let done = if correct { "They are left out" } else { "They are left in, as asked" };
    let words = format!(
        "{name} is exactly 0 in {count} rows in which the joint moves (first in {place}): the drive was off. {done}{column}."
    );
    let finding =
        LogFindingKind::DriveOff.finding(&[name], count as f64, "rows", words).corrected(correct);
    if correct {
        leave_out(&mut data, &off);
    }
    (data, vec![finding])
}

/// Returns the rows of each run in which the drive was off.
fn rows_off(data: &Dataset) -> Option<Vec<BTreeSet<usize>>> {
    let mut zero: Vec<BTreeSet<usize>> = Vec::new();
    for run in &data.runs {
        let (mut rows, mut at) = (BTreeSet::new(), 0);
        for same in run.torque.chunk_by(|one, next| (*one == 0.0) == (*next == 0.0)) {
            if same[0] == 0.0 && same.len() >= MIN_CONSECUTIVE_ROWS {
                rows.extend(at..at + same.len());
            }
            at += same.len();
        }
        zero.push(rows);
    }
    if zero.iter().all(BTreeSet::is_empty) {
        return None;
    }
    let moving = moving_rows(data);
    let (off, on): (Vec<_>, Vec<_>) =
        moving.iter().partition(|row| zero[row.run].contains(&row.row));
    if off.len() < MIN_ROWS {
        return None;
    }
    let law = fit(on.iter().map(|row| (row.regressors, row.torque)))?;
    let squares: f64 = off.iter().map(|row| law.torque(row).powi(2)).sum();
    let expected = (squares / off.len() as f64).sqrt();
    let step = quantum(data.runs.iter().map(|run| run.torque.as_slice()));
    let of_all = fit(moving.iter().map(|row| (row.regressors, row.torque)))?;
    let no_law_follows_all = of_all.scatter > MIN_SCATTER_RATIO * law.scatter;
    let is_off = no_law_follows_all
        && expected > MIN_EXPECTED_ERRORS * law.scatter
        && expected > MIN_EXPECTED_QUANTA * step;
    // A rest without torque may be one of a drive that is on.
    let moves: BTreeSet<(usize, usize)> = off.iter().map(|row| (row.run, row.row)).collect();
    for (index, rows) in zero.iter_mut().enumerate() {
        let all: Vec<usize> = rows.iter().copied().collect();
        for stretch in all.chunk_by(|one, next| one + 1 == *next) {
            if !stretch.iter().any(|row| moves.contains(&(index, *row))) {
                stretch.iter().for_each(|row| {
                    rows.remove(row);
                });
            }
        }
    }
    is_off.then_some(zero)
}
