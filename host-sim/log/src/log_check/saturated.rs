//! Columns that are clipped at an end of their range: a saturated sensor, a drive at its limit.
//!
//! At a clipped end, many consecutive rows hold exactly the same extreme value, while elsewhere the column rarely
//! repeats itself.

use super::column::extent;
use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::number::figure;

/// Minimum number of consecutive rows with the extreme value.
const MIN_CONSECUTIVE_ROWS: usize = 4;

/// Minimum number of such rows in total.
const MIN_ROWS: usize = 12;

/// Minimum share of such rows.
const MIN_SHARE: f64 = 1e-3;

/// Maximum share of rows, away from the ends, that repeat the previous value.
const MAX_REPEAT_SHARE: f64 = 0.1;

pub fn saturated(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    for column in &log.columns {
        let ends = extent(column.values());
        // A filled column is constant after its last value.
        let filled = log.data.sources.iter().any(|of| of.name == column.name && of.filled > 0);
        if ends[0] == ends[1] || filled {
            continue;
        }
        let (mut repeats, mut inside) = (0usize, 0usize);
        for (before, value) in column.pairs() {
            if !ends.contains(&value) {
                inside += 1;
                repeats += usize::from(before == value);
            }
        }
        if inside == 0 || repeats as f64 > MAX_REPEAT_SHARE * inside as f64 {
            continue;
        }
        let rows: usize = column.values().count();
        for end in ends {
            let standing: usize = column.runs.iter().map(|run| standing(run, end)).sum();
            if standing < MIN_ROWS || (standing as f64) < MIN_SHARE * rows as f64 {
                continue;
            }
            found.push(LogFinding {
                kind: LogFindingKind::Saturated,
                columns: vec![column.name.clone()],
                value: end,
                unit: column.unit.clone(),
                corrected: false,
                in_words: format!(
                    "{} stands at {} {} in {standing} rows and goes no further: it is clipped there. It is taken as \
                     it stands.",
                    column.name,
                    figure(end),
                    column.unit
                ),
            });
        }
    }
    found
}

/// Returns the number of rows in sequences of the extreme value.
fn standing(run: &[f64], end: f64) -> usize {
    let stands = run.split(|value| *value != end).map(<[f64]>::len);
    stands.filter(|length| *length >= MIN_CONSECUTIVE_ROWS).sum()
}
