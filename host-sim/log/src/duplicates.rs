//! Rows that a file holds twice: written twice by the logger, or in parts of a file that overlap.
//!
//! Such rows would give their samples twice the weight, and a part that occurs twice would be on both sides of a split.
//! Rows of one stamp may be measurements of a clock that is coarser than the rows, so equal neighbours are left out only if
//! nearly all rows that repeat a stamp are equal. Rows far apart are left out in blocks that move.

use super::clean::OpenRun;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

/// Minimum share of rows equal to a row above, among those that repeat its stamp.
const MIN_EQUAL_SHARE: f64 = 0.9;

/// Minimum number of rows in order that a file repeats further down. Fewer may be a joint at rest at the start of two
/// recordings.
const MIN_BLOCK_ROWS: usize = 20;

/// Removes the rows of a run that repeat an earlier row in all columns. Returns their number.
pub(super) fn remove_duplicates(run: &mut OpenRun) -> usize {
    let time = &run.required[0];
    if time.windows(2).all(|pair| pair[1] > pair[0]) {
        return 0;
    }
    let keep = kept_rows(run);
    let removed = keep.iter().filter(|keep| !**keep).count();
    if removed > 0 {
        run.retain(&keep);
        run.accepted -= removed;
    }
    removed
}

/// Returns the bits of a row's values.
fn bits(run: &OpenRun, row: usize) -> impl Iterator<Item = u64> {
    let optional = run.optional.iter().map(move |column| column.get(row));
    let values = run.required.iter().map(move |column| column.get(row)).chain(optional);
    values
        .map(|value| value.copied().filter(|value| !value.is_nan()).map_or(u64::MAX, f64::to_bits))
}

/// Returns for each row whether it is kept.
fn kept_rows(run: &OpenRun) -> Vec<bool> {
    let time = &run.required[0];
    let mut rows: HashMap<u64, usize> = HashMap::new();
    // The earlier row that each row repeats.
    let earlier: Vec<Option<usize>> = (0..time.len())
        .map(|row| {
            let mut hasher = DefaultHasher::new();
            bits(run, row).for_each(|bits| bits.hash(&mut hasher));
            let first = *rows.entry(hasher.finish()).or_insert(row);
            (first < row && bits(run, first).eq(bits(run, row))).then_some(first)
        })
        .collect();
    // The first of the neighbours with the stamp of each row.
    let mut group = vec![0; time.len()];
    for row in 1..time.len() {
        group[row] = if time[row] == time[row - 1] { group[row - 1] } else { row };
    }
    let is_near = |row: usize| earlier[row].is_some_and(|earlier| earlier >= group[row]);
    let is_far = |row: usize| earlier[row].is_some_and(|earlier| earlier < group[row]);
    let repeats = (0..time.len()).filter(|row| group[*row] < *row).count();
    let equal = (0..time.len()).filter(|row| is_near(*row)).count();
    let are_written_twice = equal as f64 >= MIN_EQUAL_SHARE * repeats as f64;
    let mut keep: Vec<bool> =
        (0..time.len()).map(|row| !(are_written_twice && is_near(row))).collect();
    let mut start = 0;
    while start < time.len() {
        let length = (start..time.len()).take_while(|row| is_far(*row)).count();
        let motion = &run.required[1][start..start + length];
        if length >= MIN_BLOCK_ROWS && motion.windows(2).any(|pair| pair[0] != pair[1]) {
            keep[start..start + length].fill(false);
        }
        start += length.max(1);
    }
    keep
}
