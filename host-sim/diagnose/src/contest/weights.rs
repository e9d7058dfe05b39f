//! Weights of the rows, fixed before the contest.
//!
//! Errors differ by kind of row: a joint at rest holds a torque that its motion does not determine, a joint that bends after a
//! reversal is known less well than one that slides. A law of free shape, fitted once, says how large the error of each kind
//! is, and its rows get the inverse as weight. Where the motion is uncertain, the driver's law turns its error into an error of
//! the torque that no model avoids, and such rows count less as well. All hypotheses share these weights.

use super::rows::Rows;
use joint_log::statistics::quantile_by_count;

/// Number of rows around a row that decide its kind.
const WINDOW: usize = 9;

/// Fewest judged rows of a kind.
const MIN_ROWS: usize = 50;

/// Further weight of rows at rest, as their errors last as long as the rest.
const REST: f64 = 0.3;

/// Least weight of a row that still holds the unknown torque of a start.
const LEAST_BY_MEMORY: f64 = 0.05;

/// Least weight of a row of uncertain motion: where all rows are such, they still are what there is.
const LEAST_BY_MOTION: f64 = 0.2;

/// Ratio of a median magnitude of normal noise to its standard deviation.
const NORMAL: f64 = 1.4826;

/// What a joint does in a row.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Rest,
    Bend,
    Slide,
}

/// Sets the weights of the rows by what a law leaves of them. `stop` bends where the law does. `motion_error` is the error
/// that comes from the uncertain motion, or empty; `memory` the share of the unknown torque at a start, or empty.
pub fn weigh(
    rows: &mut Rows,
    residual: &[f64],
    stop: &[f64],
    motion_error: &[f64],
    memory: &[f64],
) {
    let kinds = kinds(rows, stop);
    let spread = |kind: Option<Kind>| {
        let of_kind = rows.judged.iter().filter(|row| kind.is_none_or(|kind| kinds[**row] == kind));
        let values: Vec<f64> = of_kind.map(|row| residual[*row].abs()).collect();
        (values.len(), NORMAL * quantile_by_count(values, 0.5).unwrap_or_default() + 1e-30)
    };
    let (_, usual) = spread(None);
    let weight = [Kind::Rest, Kind::Bend, Kind::Slide].map(|kind| {
        let (count, deviation) = spread(Some(kind));
        let weight = if count > MIN_ROWS { (usual / deviation).min(1.0) } else { 1.0 };
        if kind == Kind::Rest { REST * weight } else { weight }
    });
    for (weighed, kind) in rows.weights.iter_mut().zip(kinds) {
        *weighed *= weight[kind as usize];
    }
    for (weighed, memory) in rows.weights.iter_mut().zip(memory) {
        *weighed *= (1.0 - memory.abs()).max(LEAST_BY_MEMORY);
    }
    if motion_error.is_empty() {
        return;
    }
    let usual = usual.max(rows.noise_floor);
    for (weighed, error) in rows.weights.iter_mut().zip(motion_error) {
        *weighed /= (1.0 + (error / usual).powi(2)).sqrt().min(1.0 / LEAST_BY_MOTION);
    }
    let squares = rows.judged.iter().map(|row| (rows.weights[*row] * motion_error[*row]).powi(2));
    let motion = squares.sum::<f64>() / rows.weight().max(f64::MIN_POSITIVE);
    rows.noise_floor = (rows.noise_floor.powi(2) + motion).sqrt();
}

fn kinds(rows: &Rows, stop: &[f64]) -> Vec<Kind> {
    let mut kinds = vec![Kind::Slide; rows.len()];
    for run in &rows.runs {
        for row in run.clone() {
            let from = row.saturating_sub(WINDOW / 2).max(run.start + 1);
            let near = from..(row + WINDOW / 2 + 1).min(run.end);
            let moved = |column: &[f64]| {
                near.clone().map(|row| (column[row] - column[row - 1]).abs()).fold(0.0, f64::max)
            };
            if moved(&rows.position) <= 0.5 * rows.least_step {
                kinds[row] = Kind::Rest;
            } else if moved(stop) > 1e-9 {
                kinds[row] = Kind::Bend;
            }
        }
    }
    kinds
}
