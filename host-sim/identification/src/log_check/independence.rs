//! Too few rows, or too few that tell something of their own.
//!
//! Thirty rows are no runs, and a million rows of one steady slide are one measurement. What a friction law
//! is told comes with the motion: a reversal, or another speed. So beside the rows the *events* are counted:
//! changes of direction, and changes of the speed by a tenth of the usual one that last.

use super::{Kind, Log, LogFinding};

/// Fewer rows than this are too few for a law of eight parameters, whatever they hold.
const FEWEST_ROWS: usize = 300;

/// Fewer events than this say nothing of a scatter.
const FEWEST_EVENTS: usize = 4;

/// A change of speed that is an event, as a share of the 95th percentile.
const CHANGE: f64 = 0.1;

pub fn too_little(log: &Log) -> Vec<LogFinding> {
    let rows = log.data.rows;
    let finding = |value: usize, unit: &str, in_words: String| LogFinding {
        kind: Kind::TooLittle,
        columns: vec![log.velocity().into(), log.torque().into()],
        value: value as f64,
        unit: unit.into(),
        corrected: false,
        in_words,
    };
    if rows < FEWEST_ROWS {
        let words = format!(
            "{rows} rows are too few: laws with one parameter more or less cannot be told apart on them."
        );
        return vec![finding(rows, "rows", words)];
    }
    let events = events(log);
    if events < FEWEST_EVENTS {
        let words = format!(
            "{rows} rows hold {events} changes of speed or direction: rows of one steady motion repeat each other \
             and are not independent."
        );
        return vec![finding(events, "changes", words)];
    }
    Vec::new()
}

/// Changes of velocity, each by more than [`CHANGE`] since the last one; each run begins one.
fn events(log: &Log) -> usize {
    let change = CHANGE * log.sensors.speed;
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
