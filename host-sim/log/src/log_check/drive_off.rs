//! A torque of exactly 0 while the joint moves: the drive was off, and something else moved the joint.
//!
//! A joint that coasts has no torque either, but then inertia and friction add up to zero. So the law of the other rows decides:
//! it expects a torque in these rows, and no law follows all rows. A torque with few digits is 0 near each reversal; such rows
//! do not follow each other.

use super::LogFindingKind;
use super::column::telling_column;
use super::finding::LogFinding;
use super::rows::{Rows, first_in_words, leave_out};
use crate::dataset::Place;
use crate::motion::quantum;
use crate::segment::stretches;
use crate::torque_fit::{MIN_ROWS, fit, moving_rows};
use crate::{Dataset, Part};
use compensator_core::quantity::Quantity;

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
    let (count, place) = (off.len(), first_in_words(&off, &data));
    let name = Quantity::Torque.name(data.joint);
    let column = match telling_column(&data, |place| off.contains(&place)) {
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

/// Returns the rows in which the drive was off.
fn rows_off(data: &Dataset) -> Option<Rows> {
    let mut parts = parts_without_torque(data);
    if parts.is_empty() {
        return None;
    }
    let zero = rows_of(&parts);
    let moving = moving_rows(data);
    let (off, on): (Vec<_>, Vec<_>) = moving.iter().partition(|row| zero.contains(&row.place));
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
    let moves: Rows = off.iter().map(|row| row.place).collect();
    parts.retain(|part| {
        let rows = place(part, part.rows.start)..place(part, part.rows.end);
        moves.range(rows).next().is_some()
    });
    is_off.then(|| rows_of(&parts))
}

/// Returns the parts of the runs whose torque is exactly 0 for several rows.
fn parts_without_torque(data: &Dataset) -> Vec<Part> {
    let mut parts = Vec::new();
    for (index, run) in data.runs.iter().enumerate() {
        for rows in stretches(&run.torque, |one, next| (*one == 0.0) == (*next == 0.0)) {
            if run.torque[rows.start] == 0.0 && rows.len() >= MIN_CONSECUTIVE_ROWS {
                parts.push(Part { run: index, rows });
            }
        }
    }
    parts
}

fn rows_of(parts: &[Part]) -> Rows {
    parts.iter().flat_map(|part| part.rows.clone().map(|row| place(part, row))).collect()
}

fn place(part: &Part, row: usize) -> Place {
    Place { run: part.run, row }
}
