//! Rows in the order of their clock, and where one start ends and the next begins.
//!
//! Inside a run time must not go back; a row that does is left out. A log without a `run` column may still hold
//! several starts, one behind the other, and a fit that took them for one run could hold none of them out. They show
//! in the clock alone: it pauses for long, or begins anew. A clock that begins anew differs from a row that is out of
//! order by what follows: rows that go on from there, in order, below where the clock had been.

use super::segment::median_step;
use std::ops::Range;

/// A pause that ends a start, s, and in usual steps. A logger that drops packets loses less than a second.
pub(super) const PAUSE: (f64, f64) = (1.0, 20.0);

/// Rows that must go on from where a clock went back to, for it to have begun anew.
const GOES_ON: usize = 20;

/// What became of the rows of a run.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Order {
    /// Rows that go back, each with the row before it that stays.
    pub back: Vec<(usize, usize)>,
    /// Rows with which the clock begins anew.
    pub anew: Vec<usize>,
    /// Rows that repeat the stamp before them.
    pub repeated: usize,
}

/// Looks through the times of a run; `is_one` where the file says that it is a single one.
pub(super) fn order(time: &[f64], is_one: bool) -> Order {
    let mut order = Order::default();
    let mut last: Option<usize> = None;
    for (row, now) in time.iter().enumerate() {
        if let Some(before) = last {
            if *now < time[before] {
                if is_one || !begins_anew(&time[row..], time[before]) {
                    order.back.push((row, before));
                    continue;
                }
                order.anew.push(row);
            }
            order.repeated += usize::from(*now == time[before]);
        }
        last = Some(row);
    }
    order
}

/// Whether the clock goes on from here, below where it had been.
fn begins_anew(rest: &[f64], before: f64) -> bool {
    let next = rest.get(..GOES_ON).unwrap_or_default();
    !next.is_empty()
        && next.windows(2).all(|pair| pair[0] <= pair[1])
        && next.last().is_some_and(|last| *last < before)
}

/// The starts in times that never go back but where they begin anew: ranges of rows.
pub(super) fn starts(time: &[f64]) -> Vec<Range<usize>> {
    let limit = median_step(time).map_or(f64::INFINITY, |step| (PAUSE.1 * step).max(PAUSE.0));
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
    fn a_row_out_of_order_is_left_out_and_a_new_start_is_not() {
        let steady: Vec<f64> = (0..100).map(f64::from).collect();
        assert_eq!(order(&steady, false), Order::default());
        let twice: Vec<f64> = steady.iter().chain(&steady).copied().collect();
        assert_eq!(order(&twice, false).anew, [100]);
        assert_eq!(order(&twice, true).back.len(), 99, "and the last one repeats");
        let mut slipped = steady.clone();
        slipped[50] = 3.0;
        assert_eq!(order(&slipped, false), Order { back: vec![(50, 49)], ..Order::default() });
        let backwards: Vec<f64> = steady.iter().map(|t| -t).collect();
        assert_eq!(order(&backwards, false).back.len(), 99);
    }

    #[test]
    fn starts_are_told_apart_by_long_pauses() {
        let mut time: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.01).collect();
        time.extend((0..100).map(|i| 3.0 + f64::from(i) * 0.01));
        time.extend((0..50).map(|i| 0.5 + f64::from(i) * 0.01));
        assert_eq!(starts(&time), [0..100, 100..200, 200..250]);
        let slow: Vec<f64> = (0..30).map(|i| f64::from(i) * 2.0).collect();
        assert_eq!(starts(&slow).len(), 1, "steps of two seconds are no pauses");
    }
}
