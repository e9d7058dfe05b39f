//! Logs with too few independent rows.
//!
//! Rows of one steady motion are one measurement, however many there are. A friction law is determined by changes of the
//! motion: reversals and other speeds. So in addition to the rows, the *events* are counted: changes of direction, and
//! lasting changes of speed by a tenth of the usual speed.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;

/// Minimum number of rows for a law of eight parameters.
const MIN_ROWS: usize = 300;

/// Minimum number of events for an estimate of scatter.
const MIN_EVENTS: usize = 4;

/// Minimum change of velocity of an event, as a share of the 95th percentile of speed.
const MIN_CHANGE: f64 = 0.1;

pub fn too_little(log: &Log) -> Vec<LogFinding> {
    let rows = log.data.rows;
    let finding = |value: usize, unit: &str, in_words: String| {
        LogFindingKind::TooLittle.finding(
            &[log.velocity(), log.torque()],
            value as f64,
            unit,
            in_words,
        )
    };
    if rows < MIN_ROWS {
        let words = format!(
            "{rows} rows are too few: laws that differ by one parameter cannot be distinguished with them."
        );
        return vec![finding(rows, "rows", words)];
    }
    let events = events(log);
    if events < MIN_EVENTS {
        let words = format!(
            "{rows} rows hold {events} changes of speed or direction: rows of one steady motion repeat each other \
             and are not independent."
        );
        return vec![finding(events, "changes", words)];
    }
    Vec::new()
}

/// Counts the changes of velocity of at least [`MIN_CHANGE`] since the last one. Each run begins with an event.
fn events(log: &Log) -> usize {
    let change = MIN_CHANGE * log.sensors.speed;
    let mut count = 0;
    for run in &log.data.runs {
        let mut last: Option<f64> = None;
        for velocity in &run.velocity {
            match last {
                Some(last) if (velocity - last).abs() <= change => {}
                _ => {
                    last = Some(*velocity);
                    count += 1;
                }
            }
        }
    }
    count
}
