//! Impossible values: a 9999 for a failed reading, a flipped bit.
//!
//! The criterion is strict. Such a value is far outside the range of 99 % of its column, occurs in at most three
//! consecutive rows, and differs from the values before and after by as much. Its row is left out.

use super::column::{Column, all};
use super::finding::{LogFinding, LogFindingKind};
use super::rows::{Rows, leave_out};
use crate::Dataset;
use crate::dataset::Place;
use crate::number::figure;
use crate::segment::stretches;
use crate::statistics::{median, quantile_range};

/// Minimum distance from the median, in ranges of the middle 98 %. A shock is a few ranges, a failed reading tens.
const MIN_DISTANCE: f64 = 8.0;

/// Maximum number of consecutive failed rows.
const MAX_CONSECUTIVE_ROWS: usize = 3;

/// Maximum share of such values. A column with more has two levels instead of failures.
const MAX_SHARE: f64 = 0.01;

/// Finds impossible values, and leaves out their rows if `correct` is true.
pub fn outliers(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let mut found = Vec::new();
    let mut rows = Rows::new();
    for column in all(&data) {
        let Some(Failed { places, farthest }) = failed(&column) else { continue };
        let (count, value) = (places.len(), column.runs[farthest.run][farthest.row]);
        let values = if count == 1 { "1 value".into() } else { format!("{count} values") };
        let done = match (correct, count) {
            (false, _) => "left in, as asked",
            (true, 1) => "the row is left out",
            (true, _) => "their rows are left out",
        };
        let words = format!(
            "{values} of {} cannot be (the farthest is {}, in {}, alone between neighbours of \
                 another size): {done}.",
            column.name,
            figure(value),
            farthest.in_words(&data)
        );
        found.push(
            LogFindingKind::Outlier
                .finding(&[&column.name], value, &column.unit, words)
                .corrected(correct),
        );
        rows.extend(places);
    }
    if correct {
        leave_out(&mut data, &rows);
    }
    (data, found)
}

/// The cells of a column with impossible values.
struct Failed {
    places: Vec<Place>,
    /// The one that is farthest from the median.
    farthest: Place,
}

fn failed(column: &Column) -> Option<Failed> {
    let mut all: Vec<f64> = column.values().collect();
    let middle = median(&mut all).unwrap_or_default();
    let span = quantile_range(&mut all, 0.01);
    if span <= 0.0 {
        return None;
    }
    let is_far = |value: f64| (value - middle).abs() > MIN_DISTANCE * span;
    let mut places = Vec::new();
    for (index, run) in column.runs.iter().enumerate() {
        for rows in stretches(run, |one, next| is_far(*one) == is_far(*next)) {
            if is_far(run[rows.start]) && rows.len() <= MAX_CONSECUTIVE_ROWS {
                places.extend(rows.map(|row| Place { run: index, row }));
            }
        }
    }
    let distance = |place: &Place| (column.runs[place.run][place.row] - middle).abs();
    // Of equal distances, the first.
    let farthest = places.iter().rev().max_by(|a, b| distance(a).total_cmp(&distance(b)));
    let farthest = *farthest?;
    let most = (MAX_SHARE * all.len() as f64).max(1.0);
    (places.len() as f64 <= most).then_some(Failed { places, farthest })
}
