//! Clocks that repeat stamps or have gaps, and rows that are missing although the clock is regular.
//!
//! No computation with memory crosses a gap (each segment is a track of its own), so a gap is reported but does no
//! harm. Rows lost without a gap do: the position jumps by more than its velocity explains.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::motion::columns::quantile;
use crate::number::figure;
use crate::segments;

/// Minimum share of rows that repeat the previous stamp.
const MIN_REPEATED_SHARE: f64 = 1e-3;

/// Minimum difference between displacement and integrated velocity of a jump, in 99th percentiles of this difference.
const MIN_JUMP_RATIO: f64 = 10.0;

/// Minimum size of a jump, in rows of usual travel.
const MIN_JUMP_ROWS: f64 = 3.0;

pub fn jumps(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    let finding = |columns: Vec<String>, value: f64, unit: &str, in_words: String| LogFinding {
        kind: LogFindingKind::TimeJump,
        columns,
        value,
        unit: unit.into(),
        corrected: false,
        in_words,
    };
    let (mut repeated, mut steps) = (0usize, 0usize);
    let (mut gaps, mut longest) = (0usize, 0.0f64);
    for run in &log.data.runs {
        steps += run.len().saturating_sub(1);
        repeated += run.time_s.windows(2).filter(|w| w[1] == w[0]).count();
        for pair in segments(run).windows(2) {
            gaps += 1;
            longest = longest.max(run.time_s[pair[1].start] - run.time_s[pair[1].start - 1]);
        }
    }
    let time = || vec!["time_s".to_owned()];
    if gaps > 0 {
        let words = format!(
            "The log has {gaps} gaps, the longest of {} s: each segment between them is used separately.",
            figure(longest)
        );
        found.push(finding(time(), longest, "s", words));
    }
    if repeated as f64 > MIN_REPEATED_SHARE * steps as f64 {
        let words = format!(
            "{repeated} rows repeat the stamp of the row before: the clock is coarser than the rows. They are kept."
        );
        found.push(finding(time(), repeated as f64, "rows", words));
    }
    found.extend(lost(log).map(|(count, largest)| {
        let unit = log.data.joint.position_unit();
        let words = format!(
            "At {count} rows the position jumps by up to {} {unit} more than the velocity beside it explains: rows \
             are missing there, though the clock runs on, or the count slipped. Nothing is changed.",
            figure(largest)
        );
        finding(vec![log.position().into(), "time_s".into()], largest, unit, words)
    }));
    found
}

/// Returns how often the position jumps, and the largest jump.
fn lost(log: &Log) -> Option<(usize, f64)> {
    let position = log.column(log.position())?;
    if !log.sensors.agreement.is_some_and(|agreement| agreement.is_clear()) {
        return None;
    }
    let mut off = Vec::new();
    for (run, q) in log.data.runs.iter().zip(&position.runs) {
        for rows in segments(run) {
            for row in rows.start + 1..rows.end {
                let step = run.time_s[row] - run.time_s[row - 1];
                let travel = 0.5 * step * (run.velocity[row] + run.velocity[row - 1]);
                off.push((q[row] - q[row - 1] - travel).abs());
            }
        }
    }
    let usual = quantile(off.iter().copied(), 0.99).max(4.0 * log.sensors.position_noise);
    let least =
        (MIN_JUMP_RATIO * usual).max(MIN_JUMP_ROWS * log.sensors.speed * log.sensors.step_s);
    let count = off.iter().filter(|off| **off > least).count();
    let largest = off.iter().copied().fold(0.0, f64::max);
    (count > 0 && (count as f64) < 0.01 * off.len() as f64).then_some((count, largest))
}
