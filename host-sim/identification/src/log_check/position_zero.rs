//! A position that was integrated from the velocity and begins at the same value in each run.
//!
//! An encoder that is set to zero before each run tells nothing apart from a joint that always starts there, and is
//! not named. Where the position is a sum of the velocity, the angle of the shaft is not known from run to run, and an effect that is periodic in it has
//! another phase in each.

use super::{Kind, Log, LogFinding};
use crate::number::figure;

pub fn position_zero(log: &Log) -> Vec<LogFinding> {
    if !log.sensors.position_integrated {
        return Vec::new();
    }
    let Some(column) = log.column(log.position()) else { return Vec::new() };
    let starts: Vec<f64> = column.runs.iter().filter_map(|run| run.first().copied()).collect();
    vec![LogFinding {
        kind: Kind::UnitSuspect,
        columns: vec![column.name.clone()],
        value: starts[0],
        unit: column.unit.clone(),
        corrected: false,
        in_words: format!(
            "The position begins at {} in each of {} runs: it was integrated from the velocity, so where the \
             shaft stood is not known from run to run. Nothing is changed.",
            figure(starts[0]),
            starts.len()
        ),
    }]
}
