//! Rows that share a stamp: their clock is coarser than their rate, or stands still now and then.
//!
//! The rows of one stamp are spread evenly up to the next stamp. Without this, all but one step in ten is 0, and the
//! rate of the log appears as that of its clock. Of a clock that stands still now and then, only the rows of a stamp are spread
//! after which it goes on where it should be.

use super::segment::stretches;
use super::statistics::median_step;
use std::ops::Range;

/// Minimum mean number of rows of a stamp. Pairs of rows may be two channels, or written twice.
const MIN_ROWS_PER_STAMP: usize = 3;

/// Maximum step between two stamps over which rows are spread, in median steps. A longer one is a gap.
const MAX_STEP: f64 = 1.5;

/// Maximum share of rows equal to the row before them. More are rows written twice.
const MAX_EQUAL_SHARE: f64 = 0.9;

/// Maximum difference of the stamp after a halt from the one that is due, in usual steps.
const MAX_RELEASE_ERROR: f64 = 0.5;

/// Spreads the rows of equal stamps of one recording in time. `values` are its velocities and torques. Returns the
/// number of rows that get another time.
pub(super) fn spread(time: &mut [f64], values: [&[f64]; 2]) -> usize {
    let groups: Vec<Range<usize>> = stretches(time, |one, next| one == next).collect();
    let is_equal = |row: &usize| values.iter().all(|of| of[*row] == of[row - 1]);
    if groups.len() < 2 || time.len() < MIN_ROWS_PER_STAMP * groups.len() {
        return released(time, &groups, &is_equal);
    }
    let repeats = (1..time.len()).filter(|row| time[*row] == time[row - 1]);
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

/// Spreads the rows during which a clock stood still: its next stamp is as many usual steps later as it has rows. Returns the
/// number of rows that get another time.
fn released(time: &mut [f64], groups: &[Range<usize>], is_equal: &dyn Fn(&usize) -> bool) -> usize {
    let Some(step) = median_step(time) else { return 0 };
    let mut moved = 0;
    for pair in groups.windows(2).filter(|pair| pair[0].len() > 1) {
        let (rows, start) = (pair[0].clone(), time[pair[0].start]);
        let (count, until) = (rows.len() as f64, time[pair[1].start] - start);
        let goes_on = (until - count * step).abs() < MAX_RELEASE_ERROR * step;
        if goes_on && !(rows.start + 1..rows.end).all(|row| is_equal(&row)) {
            moved += rows.len() - 1;
            rows.clone()
                .for_each(|row| time[row] = start + (row - rows.start) as f64 * until / count);
        }
    }
    moved
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
    fn spread_with_clock_that_stands_still_restores_times_where_it_goes_on() {
        let exact: Vec<f64> = (0..400).map(|row| f64::from(row) * 0.01).collect();
        let mut halting = exact.clone();
        for (from, rows) in [(50, 2), (90, 12), (200, 5)] {
            (from..from + rows).for_each(|row| halting[row] = exact[from]);
        }
        let (count, off) = worst(&exact, &mut halting, &exact);
        assert_eq!(count, 1 + 11 + 4);
        assert!(off < 1e-9, "{off}");
        // Rows of a burst, after which the clock goes on one step later.
        let mut burst: Vec<f64> =
            exact.iter().map(|t| if *t > 1.0 { t - 0.03 } else { *t }).collect();
        (98..101).for_each(|row| burst[row] = exact[98]);
        let kept = burst.clone();
        assert_eq!(spread(&mut burst, [&exact, &exact]), 0, "{kept:?}");
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
