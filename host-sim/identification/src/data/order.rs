//! Order of a run's rows in time, and the split of a run into recordings.
//!
//! Inside a recording, time must not go back; a row that does is left out. A log without a `run` column may hold
//! several recordings in sequence. They must be separated, or none of them could be held out of a fit. Only the clock
//! shows them: it pauses for long, or restarts. A restart differs from a row out of order in what follows: the next
//! rows continue from the lower time, in order.

use super::segment::median_step;
use std::ops::Range;

/// Minimum pause between two recordings, s. A logger that drops packets loses less than a second.
pub(super) const MIN_PAUSE_S: f64 = 1.0;

/// Minimum pause between two recordings, median steps.
const MIN_PAUSE_STEPS: f64 = 20.0;

/// Rows that must continue in order after a clock went back, for it to count as restarted.
const RESTART_ROWS: usize = 20;

/// The order of a run's rows in time.
#[derive(Debug, Default, PartialEq)]
pub(super) struct ClockOrder {
    /// Rows that go back, each with the last earlier row that is kept.
    pub backward: Vec<(usize, usize)>,
    /// Rows at which the clock restarts.
    pub restarts: Vec<usize>,
    /// Number of rows that repeat the stamp before them.
    pub repeated: usize,
}

/// Checks the times of a run. `is_one` is true if the file states that it is a single recording.
pub(super) fn check_order(time: &[f64], is_one: bool) -> ClockOrder {
    let mut order = ClockOrder::default();
    let mut last: Option<usize> = None;
    for (row, now) in time.iter().enumerate() {
        if let Some(before) = last {
            if *now < time[before] {
                if is_one || !restarts(&time[row..], time[before]) {
                    order.backward.push((row, before));
                    continue;
                }
                order.restarts.push(row);
            }
            order.repeated += usize::from(*now == time[before]);
        }
        last = Some(row);
    }
    order
}

/// Returns true if the clock continues in order from here, below its time before.
fn restarts(rest: &[f64], before: f64) -> bool {
    let next = rest.get(..RESTART_ROWS).unwrap_or_default();
    !next.is_empty()
        && next.windows(2).all(|pair| pair[0] <= pair[1])
        && next.last().is_some_and(|last| *last < before)
}

/// Splits times into recordings, as ranges of rows. The times must go back only at restarts of the clock.
pub(super) fn recordings(time: &[f64]) -> Vec<Range<usize>> {
    let limit =
        median_step(time).map_or(f64::INFINITY, |step| (MIN_PAUSE_STEPS * step).max(MIN_PAUSE_S));
    let (mut found, mut start) = (Vec::new(), 0);
    for (at, pair) in time.windows(2).enumerate() {
        if pair[1] - pair[0] > limit || pair[1] < pair[0] {
            found.push(start..at + 1);
            start = at + 1;
        }
    }
    found.push(start..time.len());
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn check_order_separates_rows_out_of_order_from_restarts() {
        let steady: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(check_order(&steady, false), ClockOrder::default());
        let twice: Vec<f64> = steady.iter().chain(&steady).copied().collect();
        assert_eq!(check_order(&twice, false).restarts, [100]);
        assert_eq!(check_order(&twice, true).backward.len(), 99, "and the last one repeats");
        let mut slipped = steady.clone();
        slipped[50] = 3.0;
        let expected = ClockOrder { backward: vec![(50, 49)], ..ClockOrder::default() };
        assert_eq!(check_order(&slipped, false), expected);
        let backwards: Vec<f64> = steady.iter().map(|t| -t).collect();
        assert_eq!(check_order(&backwards, false).backward.len(), 99);
    }

    #[test]
    fn recordings_with_long_pauses_are_separate() {
        let mut time: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.01).collect();
        time.extend((0..100).map(|i| 3.0 + f64::from(i) * 0.01));
        time.extend((0..50).map(|i| 0.5 + f64::from(i) * 0.01));
        assert_eq!(recordings(&time), [0..100, 100..200, 200..250]);
        let slow: Vec<f64> = (0..30).map(|i| f64::from(i) * 2.0).collect();
        assert_eq!(recordings(&slow).len(), 1, "steps of two seconds are no pauses");
    }
}
