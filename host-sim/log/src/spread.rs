//! Rows whose clock is coarser than their rate: several rows share each stamp.
//!
//! The rows of one stamp are spread evenly up to the next stamp. Without this, all but one step in ten is 0, and the
//! rate of the log appears as that of its clock.

use super::segment::median_step;
use std::ops::Range;

/// Minimum mean number of rows of a stamp. Pairs of rows may be two channels, or written twice.
const MIN_ROWS_PER_STAMP: usize = 3;

/// Maximum step between two stamps over which rows are spread, in median steps. A longer one is a gap.
const MAX_STEP: f64 = 1.5;

/// Maximum share of rows equal to the row before them. More are rows written twice.
const MAX_EQUAL_SHARE: f64 = 0.9;

/// Spreads the rows of equal stamps of one recording in time. `values` are its velocities and torques. Returns the
/// number of rows that get another time.
pub(super) fn spread(time: &mut [f64], values: [&[f64]; 2]) -> usize {
    let groups: Vec<Range<usize>> = groups(time);
    if groups.len() < 2 || time.len() < MIN_ROWS_PER_STAMP * groups.len() {
        return 0;
    }
    let repeats = (1..time.len()).filter(|row| time[*row] == time[row - 1]);
    let is_equal = |row: &usize| values.iter().all(|of| of[*row] == of[row - 1]);
    let equal = repeats.clone().filter(is_equal).count();
    if equal as f64 > MAX_EQUAL_SHARE * repeats.count() as f64 {
        return 0;
    }
    let stamps: Vec<f64> = groups.iter().map(|rows| time[rows.start]).collect();
    let Some(step) = median_step(&stamps) else { return 0 };
    let mut sizes: Vec<usize> = groups.iter().map(Range::len).collect();
    let middle = sizes.len() / 2;
    let usual = *sizes.select_nth_unstable(middle).1 as f64;
    for (at, rows) in groups.iter().enumerate() {
        let count = rows.len() as f64;
        let until = stamps.get(at + 1).map_or(step, |next| next - stamps[at]);
        let is_gap = until > MAX_STEP * step;
        let row_step =
            if is_gap || at + 1 == groups.len() { step / usual.max(count) } else { until / count };
        // The log starts and ends anywhere between two stamps.
        let is_first = at == 0 && count < usual && !is_gap;
        let (first, row_step) = if is_first {
            let row_step = step / usual;
            (stamps[at] + until - count * row_step, row_step)
        } else {
            (stamps[at], row_step)
        };
        for (number, row) in rows.clone().enumerate() {
            time[row] = first + number as f64 * row_step;
        }
    }
    time.len() - groups.len()
}

/// Returns the rows of each stamp.
fn groups(time: &[f64]) -> Vec<Range<usize>> {
    let mut start = 0;
    let lengths = time.chunk_by(|a, b| a == b).map(<[f64]>::len);
    let group = |length| {
        start += length;
        start - length..start
    };
    lengths.map(group).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn worst(exact: &[f64], coarse: &mut [f64], values: &[f64]) -> (usize, f64) {
        let count = spread(coarse, [values, values]);
        let off = exact.iter().zip(&*coarse).map(|(a, b)| (a - b).abs());
        (count, off.fold(0.0, f64::max))
    }

    #[test]
    fn spread_with_cut_stamps_restores_times() {
        let exact: Vec<f64> = (7..400).map(|row| f64::from(row) * 0.005).collect();
        let mut coarse: Vec<f64> = exact.iter().map(|t| (t * 10.0 + 1e-9).floor() / 10.0).collect();
        let (count, off) = worst(&exact, &mut coarse, &exact);
        assert_eq!(count, 393 - 20);
        assert!(off < 1e-9, "{off}");
    }

    #[test]
    fn spread_with_pairs_or_rows_written_several_times_changes_nothing() {
        let mut pairs: Vec<f64> = (0..100).map(|row| f64::from(row / 2)).collect();
        let values: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(spread(&mut pairs, [&values, &values]), 0);
        let mut fours: Vec<f64> = (0..100).map(|row| f64::from(row / 4)).collect();
        let held = fours.clone();
        assert_eq!(spread(&mut fours, [&held, &held]), 0);
        assert_eq!(spread(&mut fours, [&held, &values]), 75);
    }
}
