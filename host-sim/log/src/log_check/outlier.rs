//! Impossible values: a 9999 for a failed reading, a flipped bit.
//!
//! The criterion is strict. Such a value is far outside the range of 99 % of its column, occurs in at most three
//! consecutive rows, and differs from the values before and after by as much. Its row is left out.

use super::column::{Column, all};
use super::finding::{LogFinding, LogFindingKind};
use crate::number::figure;
use crate::statistics::{median, quantile_range};
use crate::{Dataset, Run};
use std::collections::BTreeSet;

/// Minimum distance from the median, in ranges of the middle 98 %. A shock is a few ranges, a failed reading tens.
const MIN_DISTANCE: f64 = 8.0;

/// Maximum number of consecutive failed rows.
const MAX_CONSECUTIVE_ROWS: usize = 3;

/// Maximum share of such values. A column with more has two levels instead of failures.
const MAX_SHARE: f64 = 0.01;

/// Finds impossible values, and leaves out their rows if `correct` is true.
pub fn outliers(data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let mut found = Vec::new();
    let mut rows: BTreeSet<(usize, usize)> = BTreeSet::new();
    for column in all(&data) {
        let Some((places, farthest)) = failed(&column) else { continue };
        let (count, (index, row)) = (places.len(), farthest);
        let farthest = column.runs[index][row];
        let place = place(&data.runs[index], row);
        let values = if count == 1 { "1 value".into() } else { format!("{count} values") };
        let done = match (correct, count) {
            (false, _) => "left in, as asked",
            (true, 1) => "the row is left out",
            (true, _) => "their rows are left out",
        };
        let words = format!(
            "{values} of {} cannot be (the farthest is {}, in {place}, alone between neighbours of \
                 another size): {done}.",
            column.name,
            figure(farthest)
        );
        found.push(
            LogFindingKind::Outlier
                .finding(&[&column.name], farthest, &column.unit, words)
                .corrected(correct),
        );
        rows.extend(places);
    }
    if !correct || rows.is_empty() {
        return (data, found);
    }
    let mut kept = data;
    let of_run =
        |index: usize| rows.range((index, 0)..(index + 1, 0)).map(|(_, row)| *row).collect();
    let of_runs: Vec<BTreeSet<usize>> = (0..kept.runs.len()).map(of_run).collect();
    leave_out(&mut kept, &of_runs);
    (kept, found)
}

/// Leaves rows of each run out. A velocity that was derived from the position stays.
pub(super) fn leave_out(data: &mut Dataset, bad: &[BTreeSet<usize>]) {
    for (run, bad) in data.runs.iter_mut().zip(bad).filter(|(_, bad)| !bad.is_empty()) {
        let keep = |column: &Vec<f64>| -> Vec<f64> {
            let rows = column.iter().enumerate().filter(|(row, _)| !bad.contains(row));
            rows.map(|(_, value)| *value).collect()
        };
        *run = run.with_columns(keep);
        data.bad_rows.count += bad.len();
    }
    data.runs.retain(|run| !run.is_empty());
    data.rows = data.runs.iter().map(Run::len).sum();
}

/// Returns a row in words.
pub(super) fn place(run: &Run, row: usize) -> String {
    format!("run {} at {} s", run.name, figure(run.time_s[row]))
}

/// Returns the first of some rows of each run in words; an empty text for none.
pub(super) fn first_place(data: &Dataset, rows: &[BTreeSet<usize>]) -> String {
    let first = data.runs.iter().zip(rows).find_map(|(run, rows)| Some(place(run, *rows.first()?)));
    first.unwrap_or_default()
}

/// A cell, as (run, row).
type Place = (usize, usize);

/// Returns the cells with impossible values, and the farthest of them.
fn failed(column: &Column) -> Option<(Vec<Place>, Place)> {
    let mut all: Vec<f64> = column.values().collect();
    let middle = median(&mut all).unwrap_or_default();
    let span = quantile_range(&mut all, 0.01);
    if span <= 0.0 {
        return None;
    }
    let is_far = |value: f64| (value - middle).abs() > MIN_DISTANCE * span;
    let (mut places, mut farthest) = (Vec::new(), (0.0, (0, 0)));
    for (index, run) in column.runs.iter().enumerate() {
        let mut row = 0;
        while row < run.len() {
            let end = (row..run.len()).find(|at| !is_far(run[*at])).unwrap_or(run.len());
            if end > row && end - row <= MAX_CONSECUTIVE_ROWS {
                places.extend((row..end).map(|row| (index, row)));
                for at in row..end {
                    let distance = (run[at] - middle).abs();
                    if distance > farthest.0 {
                        farthest = (distance, (index, at));
                    }
                }
            }
            row = end.max(row + 1);
        }
    }
    let most = (MAX_SHARE * all.len() as f64).max(1.0);
    (!places.is_empty() && places.len() as f64 <= most).then_some((places, farthest.1))
}
