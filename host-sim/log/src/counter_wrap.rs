//! Clocks that are counters of a limited width: after their largest value they go on from their smallest.
//!
//! Microseconds in 32 bits wrap after 72 minutes, milliseconds in 16 bits after 66 s. A wrap differs from a new recording in
//! what it skips: with the range of the counter added, the next row comes one step after the row before.

use super::segment::GAP_FACTOR;
use super::statistics::median_step;

/// Widths of counters, bits.
const WIDTHS_BITS: [i32; 3] = [16, 31, 32];

/// Lengths of a count, s, of a clock that the logger converted to seconds.
const COUNT_LENGTHS_S: [f64; 6] = [1.0, 1e-3, 1e-4, 1e-6, 1e-7, 1e-9];

/// Minimum range of a counter, steps between rows. With fewer rows in a range, a short recording looks like one.
const MIN_RANGE_STEPS: f64 = 40.0;

/// Minimum range of a counter that wraps many times after equal steps, steps between rows, and number and share of such wraps. No
/// one records a new run every few rows.
const MIN_SHORT_RANGE_STEPS: f64 = 3.0;
const MIN_SHORT_WRAPS: usize = 10;
const MIN_SHORT_SHARE: f64 = 0.9;

/// Maximum difference of the step across a short wrap from the usual step, as a share of it.
const MAX_SHORT_DIFFERENCE: f64 = 0.5;

/// A clock that wraps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ClockWrap {
    /// Width of its counter, bits.
    pub bits: i32,
    /// Its range, s.
    pub range_s: f64,
    /// Number of wraps.
    pub count: usize,
}

/// Continues the times of a run, in the order of the file, across the wraps of their counter. `count_s` is the length of a
/// count if the column's unit states it.
pub(super) fn unwrap_times(time: &mut [f64], count_s: Option<f64>) -> Option<ClockWrap> {
    let first = time.windows(2).position(|pair| pair[1] < pair[0])?;
    let step = median_step(time)?;
    let longest = GAP_FACTOR * step;
    let lengths = count_s.as_ref().map_or(&COUNT_LENGTHS_S[..], std::slice::from_ref);
    let ranges =
        WIDTHS_BITS.iter().flat_map(|bits| lengths.iter().map(|s| (*bits, 2f64.powi(*bits) * s)));
    let mut ranges = ranges.filter(|(_, range)| *range >= MIN_SHORT_RANGE_STEPS * step);
    let wraps_shortly = |[before, after]: [f64; 2], range: f64| {
        (after + range - before - step).abs() < MAX_SHORT_DIFFERENCE * step
    };
    let wraps = |[before, after]: [f64; 2], range: f64| {
        // Both ends of an unsigned and of a signed counter.
        let is_at_end = [range, 0.5 * range].iter().any(|end| (end - before).abs() <= longest);
        after < before && is_at_end && (0.0..=longest).contains(&(after + range - before))
    };
    // Any step back may be the first wrap; the others are rows out of order, or new recordings.
    let steps = time.windows(2).skip(first).map(|pair| [pair[0], pair[1]]);
    let back: Vec<[f64; 2]> = steps.filter(|[before, after]| after < before).collect();
    let is_counter = |(_, range): &(i32, f64)| {
        if *range >= MIN_RANGE_STEPS * step {
            return back.iter().any(|step| wraps(*step, *range));
        }
        let count = back.iter().filter(|step| wraps_shortly(**step, *range)).count();
        count >= MIN_SHORT_WRAPS && count as f64 >= MIN_SHORT_SHARE * back.len() as f64
    };
    let (bits, range_s) = ranges.find(is_counter)?;
    let is_short = range_s < MIN_RANGE_STEPS * step;
    let (mut count, mut before) = (0, time[0]);
    for value in time.iter_mut() {
        let raw = *value;
        count += usize::from(match is_short {
            true => raw < before && (raw + range_s - before) < 0.5 * range_s,
            false => wraps([before, raw], range_s),
        });
        before = raw;
        *value += count as f64 * range_s;
    }
    Some(ClockWrap { bits, range_s, count })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unwrapped(time: &[f64], count_s: Option<f64>) -> (Option<ClockWrap>, Vec<f64>) {
        let mut time = time.to_vec();
        (unwrap_times(&mut time, count_s), time)
    }

    #[test]
    fn unwrap_times_of_counters_continues_them() {
        for (bits, count_s, given, step, is_signed) in [
            (32, 1e-6, Some(1e-6), 0.005, false),
            (32, 1e-6, None, 0.005, true),
            (31, 1e-6, None, 0.001, false),
            (16, 1e-3, Some(1e-3), 0.01, false),
            (16, 1e-6, Some(1e-6), 0.000_5, false),
            (16, 1e-6, Some(1e-6), 0.01, false),
            (16, 1e-6, Some(1e-6), 0.005, true),
        ] {
            let range = 2f64.powi(bits) * count_s;
            let low = if is_signed { -0.5 * range } else { 0.0 };
            let start = low + range - 100.3 * step;
            let exact: Vec<f64> = (0..400).map(|row| start + step * f64::from(row)).collect();
            let counted: Vec<f64> =
                exact.iter().map(|t| (t - low).rem_euclid(range) + low).collect();
            let (wrap, time) = unwrapped(&counted, given);
            let wrap = wrap.unwrap_or_else(|| panic!("{bits} bits of {count_s} s"));
            assert_eq!((wrap.bits, wrap.range_s), (bits, range));
            let steps = time.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(
                steps.into_iter().all(|length| (length - step).abs() < 1e-6),
                "{bits} of {count_s} s"
            );
        }
    }

    #[test]
    fn unwrap_times_with_new_recording_changes_nothing() {
        let twice: Vec<f64> = (0..400).map(|row| 0.005 * f64::from(row % 200)).collect();
        assert_eq!(unwrapped(&twice, None), (None, twice.clone()));
        let late: Vec<f64> = (0..400).map(|row| 4294.0 + 0.005 * f64::from(row % 200)).collect();
        assert_eq!(unwrapped(&late, None), (None, late.clone()));
        let steady: Vec<f64> = (0..400).map(f64::from).collect();
        assert_eq!(unwrapped(&steady, None), (None, steady.clone()));
    }
}
