//! Clocks that repeat stamps or have gaps.
//!
//! No computation with memory crosses a gap (each segment is a track of its own), so a gap is reported but does no harm.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::number::figure;
use crate::segment::segments_of;

/// Minimum share of rows that repeat the previous stamp.
const MIN_REPEATED_SHARE: f64 = 1e-3;

pub fn jumps(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    let finding = |value: f64, unit: &str, in_words: String| {
        LogFindingKind::TimeJump.finding(&["time_s"], value, unit, in_words)
    };
    let (mut repeated, mut steps) = (0usize, 0usize);
    let (mut gaps, mut longest) = (0usize, 0.0f64);
    for run in &log.data.runs {
        steps += run.len().saturating_sub(1);
        repeated += run.time_s.windows(2).filter(|w| w[1] == w[0]).count();
        for pair in segments_of(&run.time_s).windows(2) {
            gaps += 1;
            longest = longest.max(run.time_s[pair[1].start] - run.time_s[pair[1].start - 1]);
        }
    }
    if gaps > 0 {
        let words = format!(
            "The log has {gaps} gap{}, the longest of {} s: each segment between them is used separately.",
            if gaps == 1 { "" } else { "s" },
            figure(longest)
        );
        found.push(finding(longest, "s", words));
    }
    if repeated as f64 > MIN_REPEATED_SHARE * steps as f64 {
        let words = format!(
            "{repeated} rows repeat the stamp of the row before: the clock is coarser than the rows. They are kept."
        );
        found.push(finding(repeated as f64, "rows", words));
    }
    found
}
