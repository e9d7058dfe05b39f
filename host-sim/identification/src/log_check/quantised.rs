//! Columns in coarse steps.
//!
//! Every number in a file has steps; a coarse one is a step that is a share of what the column spans, or, of a
//! position, one whose derivative from row to row is a share of the usual speed. The smoother knows the
//! position's step; of other columns it is only told.

use super::{Kind, Log, LogFinding};
use crate::motion::quantum::quantum;
use crate::number::figure;
use compensator_core::quantity::Quantity;

/// A step of a position a row, as a share of the 95th percentile of speed.
const OF_SPEED: f64 = 0.02;

/// A step of any other column, as a share of what its middle 90 % span.
const OF_RANGE: f64 = 0.02;

pub fn quantised(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    for column in &log.columns {
        let is_position = column.quantity == Some(Quantity::Position);
        let changes = column.runs.iter().any(|run| run.iter().any(|value| *value != run[0]));
        if !changes || column.quantity == Some(Quantity::Acceleration) {
            continue;
        }
        let step = quantum(column.runs.iter().copied());
        let is_coarse = if is_position {
            step > OF_SPEED * log.sensors.speed * log.sensors.step_s
        } else {
            step > OF_RANGE * column.range(0.05)
        };
        if step <= 0.0 || !is_coarse {
            continue;
        }
        let corrected = is_position && log.correct.motion && !log.sensors.exact;
        let done = if corrected {
            "the motion is reconstructed with that in mind"
        } else {
            "it is taken as it stands"
        };
        found.push(LogFinding {
            kind: Kind::Quantised,
            columns: vec![column.name.clone()],
            value: step,
            unit: column.unit.clone(),
            corrected,
            in_words: format!(
                "{} comes in steps of {} {}: {done}.",
                column.name,
                figure(step),
                column.unit
            ),
        });
    }
    found
}
