//! A torque sensor that was zeroed anew before each run: its offset differs from run to run.
//!
//! One law with an offset for each run is compared with one law for all. The offsets must differ by many of their own errors,
//! which the parts of each run show, and take a large part of what the one law leaves. A force on the joint that differs from run
//! to run is alike. So the report names both. A column with one value in each run may name the cause, and nothing is changed.

use super::LogFindingKind;
use super::column::{Column, all};
use super::finding::LogFinding;
use crate::Dataset;
use crate::number::figure;
use crate::statistics::{extent, quantile};
use crate::torque_fit::{MIN_ROWS, MovingRow, Regressors, fit, moves_both_ways, moving_rows};
use compensator_core::quantity::Quantity;

/// Maximum error of the law with an offset for each run, relative to that with one.
const MAX_SCATTER_RATIO: f64 = 0.6;

/// Minimum spread of the offsets, in their errors.
const MIN_SPREAD_ERRORS: f64 = 5.0;

/// Parts of a run whose offsets show their error.
const PARTS: usize = 4;

/// Finds an offset that differs from run to run, and subtracts it if `correct` is true.
pub fn run_offset(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let Some(offsets) = offsets(&data) else { return (data, Vec::new()) };
    let [least, most] = extent(offsets.iter().copied());
    let (name, unit) = (Quantity::Torque.name(data.joint), data.joint.torque_unit());
    let done = if correct { "It is subtracted" } else { "Nothing is changed" };
    let words = format!(
        "The offset of {name} differs from run to run, from {} to {} {unit}: its sensor was zeroed before each run, or the \
             load of the joint changed. {done}, so the offset of another run is not known.",
        figure(least),
        figure(most)
    );
    let finding =
        LogFindingKind::OffsetPerRun.finding(&[name], most - least, unit, words).corrected(correct);
    if correct {
        for (run, offset) in data.runs.iter_mut().zip(&offsets) {
            run.torque.iter_mut().for_each(|torque| *torque -= offset);
        }
    }
    (data, vec![finding])
}

/// Returns the offset of each run.
fn offsets(data: &Dataset) -> Option<Vec<f64>> {
    if data.runs.len() < 2 || has_column_of_runs(data) {
        return None;
    }
    let rows = moving_rows(data);
    let runs: Vec<&[MovingRow]> =
        rows.chunk_by(|one, next| one.place.run == next.place.run).collect();
    let is_long = |run: &&[MovingRow]| run.len() >= MIN_ROWS && moves_both_ways(run.iter());
    if runs.len() < data.runs.len() || !runs.iter().all(is_long) {
        return None;
    }
    let common = fit(rows.iter().map(|row| (row.regressors, row.torque)))?;
    let means: Vec<(Regressors, f64)> = runs
        .iter()
        .map(|run| {
            let count = run.len() as f64;
            let regressors: Regressors = run.iter().map(|row| row.regressors).sum();
            (regressors / count, run.iter().map(|row| row.torque).sum::<f64>() / count)
        })
        .collect();
    let centred = |row: &MovingRow| {
        let (regressors, torque) = &means[row.place.run];
        (row.regressors - regressors, row.torque - torque)
    };
    let centred_fit = fit(rows.iter().map(centred))?;
    if centred_fit.scatter > MAX_SCATTER_RATIO * common.scatter {
        return None;
    }
    let offsets: Vec<f64> = means
        .iter()
        .map(|(regressors, torque)| torque - centred_fit.coefficients.dot(regressors))
        .collect();
    // What a part of a run leaves beside its offset.
    let part_error = |run: &&[MovingRow]| {
        let parts = run.chunks(run.len().div_ceil(PARTS));
        let left = |part: &[MovingRow]| {
            let left = part.iter().map(|row| {
                let (regressors, torque) = centred(row);
                torque - centred_fit.coefficients.dot(&regressors)
            });
            left.sum::<f64>() / part.len() as f64
        };
        parts.map(|part| left(part).powi(2)).sum::<f64>() / (PARTS * (PARTS - 1)) as f64
    };
    let error = (runs.iter().map(part_error).sum::<f64>() / runs.len() as f64).sqrt();
    let mean = offsets.iter().sum::<f64>() / offsets.len() as f64;
    let squares: f64 = offsets.iter().map(|offset| (offset - mean).powi(2)).sum();
    let spread = (squares / (offsets.len() - 1) as f64).sqrt();
    (spread > MIN_SPREAD_ERRORS * error).then_some(offsets)
}

/// Returns true if a covariate differs from run to run by more than inside of them: it may be the cause.
fn has_column_of_runs(data: &Dataset) -> bool {
    let is_motion =
        |column: &Column| column.is_motion() || column.quantity == Some(Quantity::Torque);
    all(data).iter().filter(|column| !is_motion(column)).any(|column| {
        let sorted = |run: &&[f64]| {
            [0.1, 0.5, 0.9].map(|share| quantile(&mut run.to_vec(), share).unwrap_or_default())
        };
        let runs: Vec<[f64; 3]> = column.runs.iter().map(sorted).collect();
        let inside = runs.iter().map(|[low, _, high]| high - low).sum::<f64>() / runs.len() as f64;
        let [least, most] = extent(runs.iter().map(|[_, middle, _]| *middle));
        most - least > inside
    })
}
