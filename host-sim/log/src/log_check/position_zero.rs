//! Positions that were integrated from the velocity, with the same start value in each run.
//!
//! An encoder that is reset before each run looks like a joint that always starts at the same place; this is not
//! reported. If the position is a sum of the velocity, the true shaft angle is unknown, and an effect that is periodic
//! in it has a different phase in each run.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::number::figure;

pub fn position_zero(log: &Log) -> Vec<LogFinding> {
    if !log.sensors.position_integrated {
        return Vec::new();
    }
    let Some(column) = log.column(log.position()) else { return Vec::new() };
    let starts: Vec<f64> = column.runs.iter().filter_map(|run| run.first().copied()).collect();
    let words = format!(
        "The position begins at {} in each of {} runs: it was integrated from the velocity, so where the \
             shaft stood is not known from run to run. Nothing is changed.",
        figure(starts[0]),
        starts.len()
    );
    vec![LogFindingKind::UnitSuspect.finding(&[&column.name], starts[0], &column.unit, words)]
}
