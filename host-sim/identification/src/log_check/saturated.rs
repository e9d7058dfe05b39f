//! Columns that stand at an end of their range: a clipped sensor, a drive at its limit.
//!
//! At a clipped end many rows hold the very same extreme value, next to each other, while elsewhere the
//! column hardly ever repeats itself.

use super::{Kind, Log, LogFinding};
use crate::number::figure;

/// Rows at the end in a row that are a stand.
const STAND: usize = 4;

/// Rows in stands, at least, and their share of all.
const FEWEST: (usize, f64) = (12, 1e-3);

/// Away from its ends the column repeats the value before in no more than this share of rows.
const REPEATS: f64 = 0.1;

pub fn saturated(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    for column in &log.columns {
        let ends =
            column.values().fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], value| {
                [least.min(value), most.max(value)]
            });
        // Behind its last value a filled column stands.
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
        if inside == 0 || repeats as f64 > REPEATS * inside as f64 {
            continue;
        }
        let rows: usize = column.values().count();
        for end in ends {
            let standing: usize = column.runs.iter().map(|run| standing(run, end)).sum();
            if standing < FEWEST.0 || (standing as f64) < FEWEST.1 * rows as f64 {
                continue;
            }
            found.push(LogFinding {
                kind: Kind::Saturated,
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

/// Rows of a run in stands at a value.
fn standing(run: &[f64], end: f64) -> usize {
    let stands = run.split(|value| *value != end).map(<[f64]>::len);
    stands.filter(|length| *length >= STAND).sum()
}
