//! A position that begins at the same value in each run: it was integrated, or the logger was set to zero.
//!
//! Then the angle of the shaft is not known from run to run, and an effect that is periodic in it has
//! another phase in each.

use super::{Kind, Log, LogFinding};
use crate::number::figure;

/// Runs it takes to call it no chance.
const FEWEST_RUNS: usize = 3;

/// First values are the same within this share of what the runs travel.
const SAME: f64 = 1e-6;

pub fn position_zero(log: &Log) -> Vec<LogFinding> {
    let Some(column) = log.column(log.position()) else { return Vec::new() };
    let starts: Vec<f64> = column.runs.iter().filter_map(|run| run.first().copied()).collect();
    let ends: Vec<f64> = column.runs.iter().filter_map(|run| run.last().copied()).collect();
    let spread = |values: &[f64]| {
        let most = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        most - values.iter().copied().fold(f64::INFINITY, f64::min)
    };
    let travel = column.range(0.0);
    // Runs that also end alike go to and fro between the same places, which is no fault.
    let alike = spread(&starts) <= SAME * travel && spread(&ends) > 1e-2 * travel;
    if starts.len() < FEWEST_RUNS || !alike || travel <= 0.0 {
        return Vec::new();
    }
    vec![LogFinding {
        kind: Kind::UnitSuspect,
        columns: vec![column.name.clone()],
        value: starts[0],
        unit: column.unit.clone(),
        corrected: false,
        in_words: format!(
            "The position begins at {} in each of {} runs: it was integrated or set to zero there, so where the \
             shaft stood is not known from run to run. Nothing is changed.",
            figure(starts[0]),
            starts.len()
        ),
    }]
}
