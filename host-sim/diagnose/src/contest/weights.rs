//! Weights of the rows, fixed before the contest.
//!
//! Errors differ by kind of row: a joint at rest holds a torque that its motion does not determine, a joint that bends after a
//! reversal is known less well than one that slides. A law of free shape, fitted once, says how large the error of each kind
//! is, and its rows get the inverse as weight. All hypotheses share these weights.

use super::bank::{Bank, Workspace};
use super::law::{Law, Shapes};
use super::rows::{Rows, quantile};

/// Number of rows around a row that decide its kind.
const WINDOW: usize = 9;

/// Fewest judged rows of a kind.
const MIN_ROWS: usize = 50;

/// Further weight of rows at rest, as their errors last as long as the rest.
const REST: f64 = 0.3;

/// Ratio of a median magnitude of normal noise to its standard deviation.
const NORMAL: f64 = 1.4826;

/// What a joint does in a row.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Rest,
    Bend,
    Slide,
}

/// Sets the weights of the rows by the residual of a law.
pub fn weigh(rows: &mut Rows, shapes: &Shapes, law: &Law) {
    let columns = shapes.columns(rows, law);
    let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
    let bank = Bank::new(rows, &columns);
    let all: Vec<usize> = (0..columns.len()).collect();
    let fit = bank.fit(&all, &mut Workspace::default());
    let residual = rows.map(|row| {
        rows.torque[row]
            - columns.iter().zip(&fit).map(|(column, size)| column[row] * size).sum::<f64>()
    });
    let kinds = kinds(rows, &shapes.stops[law.stops[0]]);
    let spread = |kind: Option<Kind>| {
        let own = rows.judged.iter().filter(|row| kind.is_none_or(|kind| kinds[**row] == kind));
        let values: Vec<f64> = own.map(|row| residual[*row].abs()).collect();
        (values.len(), NORMAL * quantile(values, 0.5) + 1e-30)
    };
    let (_, usual) = spread(None);
    let weight = [Kind::Rest, Kind::Bend, Kind::Slide].map(|kind| {
        let (count, own) = spread(Some(kind));
        let weight = if count > MIN_ROWS { (usual / own).min(1.0) } else { 1.0 };
        if kind == Kind::Rest { REST * weight } else { weight }
    });
    for (weighed, kind) in rows.weights.iter_mut().zip(kinds) {
        *weighed *= weight[kind as usize];
    }
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
