//! Columns with coarse quantisation.
//!
//! Every number in a file is quantised. A column is coarse if its step is a relevant share of its range. A position is
//! coarse if its difference from row to row has steps of a relevant share of the usual speed. The smoother allows for
//! the position's step; the steps of other columns are only reported.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::motion::quantum;
use crate::number::figure;
use compensator_core::quantity::Quantity;

/// Minimum step of a position per row, as a share of the 95th percentile of speed.
const MIN_SPEED_SHARE: f64 = 0.02;

/// Minimum step of any other column, as a share of the range of its middle 90 %.
const MIN_RANGE_SHARE: f64 = 0.02;

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
            step > MIN_SPEED_SHARE * log.sensors.speed * log.sensors.step_s
        } else {
            step > MIN_RANGE_SHARE * column.range(0.05)
        };
        if step <= 0.0 || !is_coarse {
            continue;
        }
        let corrected = is_position && log.correct.motion && !log.sensors.exact;
        let done = if corrected {
            "the motion is reconstructed with that step"
        } else {
            "it is taken as it stands"
        };
        let words =
            format!("{} comes in steps of {} {}: {done}.", column.name, figure(step), column.unit);
        found.push(
            LogFindingKind::Quantised
                .finding(&[&column.name], step, &column.unit, words)
                .corrected(corrected),
        );
    }
    found
}
