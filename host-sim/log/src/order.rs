//! Order of a run's rows in time, and the split of a run into recordings.
//!
//! Inside a recording, time must not go back; a row that does is left out. A log without a `run` column may hold
//! several recordings in sequence. They must be separated, or none of them could be held out of a fit. Only the clock
//! shows them: it pauses for long, or restarts. A restart differs from a row out of order in what follows: the next
//! rows continue from the lower time, in order.
//!
//! A database or a parallel writer may export the rows of one recording in another order. They are sorted if three
//! conditions hold. The rows out of order are more than may be bad, so that leaving them out is no remedy. The sorted
//! clock is regular, without new repeated stamps or gaps, and no block of rows in order has other rows in between: two
//! recordings with overlapping clocks would have them. And the clock does not simply run backwards, which is another
//! fault.

use super::segment::{GAP_FACTOR, stretches};
use super::statistics::median_step;
use std::ops::Range;

/// Minimum pause between two recordings, s. A logger that drops packets loses less than a second.
pub(super) const MIN_PAUSE_S: f64 = 1.0;

/// Minimum pause between two recordings, median steps.
const MIN_PAUSE_STEPS: f64 = 20.0;

/// Rows that must continue in order after a clock went back, for it to count as restarted.
const RESTART_ROWS: usize = 20;

/// Minimum share of steps between half and twice the median for a clock to be regular.
const REGULAR_STEP_SHARE: f64 = 0.9;

/// Maximum share of steps that go back. A clock that counts down has more, and shuffled rows have half.
const MAX_BACKWARD_SHARE: f64 = 0.8;

/// Returns the order that sorts the rows of a run by time, if they are one recording in another order. Rows of equal
/// time keep their order. `max_bad_share` is the share of rows that may be left out instead.
pub(super) fn sorting_order(time: &[f64], max_bad_share: f64) -> Option<Vec<usize>> {
    let rows = time.len();
    let backward = time.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let late = late_rows(time);
    if late as f64 <= max_bad_share * rows as f64
        || backward as f64 > MAX_BACKWARD_SHARE * rows as f64
    {
        return None;
    }
    let mut order: Vec<usize> = (0..rows).collect();
    order.sort_by(|a, b| time[*a].total_cmp(&time[*b]));
    let sorted: Vec<f64> = order.iter().map(|row| time[*row]).collect();
    let step = median_step(&sorted)?;
    let repeats = |time: &[f64]| time.windows(2).filter(|pair| pair[1] == pair[0]).count();
    let gaps =
        |time: &[f64]| time.windows(2).filter(|pair| pair[1] - pair[0] > GAP_FACTOR * step).count();
    let is_regular = |pair: &&[f64]| {
        let length = pair[1] - pair[0];
        length == 0.0 || (0.5 * step..=2.0 * step).contains(&length)
    };
    let regular = sorted.windows(2).filter(is_regular).count();
    let is_one_recording = repeats(&sorted) <= repeats(time)
        && gaps(&sorted) <= gaps(time)
        && regular as f64 >= REGULAR_STEP_SHARE * (rows - 1) as f64
        && are_blocks_apart(time, &sorted, GAP_FACTOR * step);
    is_one_recording.then_some(order)
}

/// Returns true if no block of rows in order, without a step above `longest`, has as many rows of other blocks between its own as
/// a second recording at the same rate has. Single rows that come late leave a few places in a block.
fn are_blocks_apart(time: &[f64], sorted: &[f64], longest: f64) -> bool {
    let blocks = time.chunk_by(|before, now| before <= now && now - before <= longest);
    let is_apart = |block: &[f64]| {
        let between = |limit: f64| sorted.partition_point(|time| *time < limit);
        let (first, last) = (block[0], block[block.len() - 1]);
        let inside = sorted[between(first)..].iter().take_while(|time| **time <= last).count();
        2 * inside <= 3 * block.len()
    };
    blocks.filter(|block| block.len() >= RESTART_ROWS).all(is_apart)
}

/// Returns the number of rows that come after a later stamp.
pub(super) fn late_rows(time: &[f64]) -> usize {
    let mut latest = f64::NEG_INFINITY;
    let is_late = |now: &&f64| {
        latest = latest.max(**now);
        **now < latest
    };
    time.iter().filter(is_late).count()
}

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
    stretches(time, |one, next| one <= next && next - one <= limit).collect()
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
    fn sorting_order_with_rows_of_one_recording_sorts_them() {
        let steady: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.01).collect();
        let shuffled: Vec<f64> = (0..200).map(|i| steady[i * 77 % 200]).collect();
        let order = sorting_order(&shuffled, 0.05).unwrap();
        assert!(order.iter().enumerate().all(|(place, row)| shuffled[*row] == steady[place]));
        let blocks = [&steady[100..], &steady[..100]].concat();
        assert_eq!(sorting_order(&blocks, 0.05).unwrap()[0], 100);
        assert_eq!(late_rows(&blocks), 100);
        let twice: Vec<f64> = shuffled.iter().flat_map(|time| [*time, *time]).collect();
        let order = sorting_order(&twice, 0.05).unwrap();
        assert!(
            order.chunks(2).all(|pair| pair[1] == pair[0] + 1),
            "equal stamps keep their order"
        );
    }

    #[test]
    fn sorting_order_with_another_fault_returns_none() {
        let steady: Vec<f64> = (0..200).map(|i| f64::from(i) * 0.01).collect();
        assert_eq!(sorting_order(&steady, 0.05), None);
        let backwards: Vec<f64> = steady.iter().rev().copied().collect();
        assert_eq!(sorting_order(&backwards, 0.05), None);
        let again: Vec<f64> = steady.iter().chain(&steady).copied().collect();
        assert_eq!(sorting_order(&again, 0.05), None, "two recordings");
        let overlapping: Vec<f64> =
            steady.iter().copied().chain(steady.iter().map(|t| t + 0.503)).collect();
        assert_eq!(sorting_order(&overlapping, 0.05), None, "two recordings with one clock");
        let between: Vec<f64> =
            steady.iter().copied().chain(steady.iter().map(|t| t + 0.005)).collect();
        assert_eq!(sorting_order(&between, 0.05), None, "two recordings whose clocks interleave");
        let mut jitter = steady.clone();
        jitter.swap(50, 53);
        assert_eq!(sorting_order(&jitter, 0.05), None, "a few rows are bad rows");
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
