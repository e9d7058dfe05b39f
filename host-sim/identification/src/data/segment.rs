//! Where a run is one unbroken stretch, and where it is not.
//!
//! A logger that drops packets leaves a gap. Across it, a difference quotient is an average over
//! whatever happened meanwhile, a filter rings as after a step, and a bristle state is simply
//! unknown. So everything that has a memory works on *segments*: stretches of a run in which no
//! step is longer than [`GAP_FACTOR`] times the usual one. The usual step is the median, because
//! the mean is what gaps spoil; steps of zero (a coarse clock repeats its stamps) are not counted,
//! or a clock of 1 ms at 5 kHz would make the median zero and every step a gap.

use std::ops::Range;

use super::dataset::Run;

/// A step longer than this many median steps is a gap. A log that jitters stays well below twice
/// the median; a lost packet of a few samples is still bridged by a smooth motion; longer is not.
pub const GAP_FACTOR: f64 = 5.0;

/// The unbroken stretches of a run, as row ranges in order; together they are all its rows.
pub fn segments(run: &Run) -> Vec<Range<usize>> {
    segments_of(&run.time_s)
}

/// As [`segments`], by the times alone.
pub(super) fn segments_of(time: &[f64]) -> Vec<Range<usize>> {
    if time.is_empty() {
        return Vec::new();
    }
    let longest = median_step(time).map_or(f64::INFINITY, |step| GAP_FACTOR * step);
    let mut found = Vec::new();
    let mut start = 0;
    for at in 1..time.len() {
        if time[at] - time[at - 1] > longest {
            found.push(start..at);
            start = at;
        }
    }
    found.push(start..time.len());
    found
}

/// The median of the steps that are not zero, in s; `None` if there is none.
pub(super) fn median_step(time: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        time.windows(2).map(|pair| pair[1] - pair[0]).filter(|&step| step > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    Some(*steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(time_s: &[f64]) -> Run {
        Run { time_s: time_s.to_vec(), ..Run::default() }
    }

    /// The segments as (first row, row after the last).
    fn cut(run: &Run) -> Vec<(usize, usize)> {
        segments(run).into_iter().map(|rows| (rows.start, rows.end)).collect()
    }

    #[test]
    fn a_run_is_cut_where_a_step_is_longer_than_five_usual_ones() {
        assert_eq!(cut(&run(&[0.0, 1.0, 2.0, 7.0, 8.0, 9.0])), [(0, 6)], "just five is no gap");
        assert_eq!(cut(&run(&[0.0, 1.0, 2.0, 7.5, 8.5, 9.5])), [(0, 3), (3, 6)]);
    }

    #[test]
    fn repeated_stamps_do_not_make_every_step_a_gap() {
        assert_eq!(cut(&run(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0])), [(0, 8)]);
        assert_eq!(cut(&run(&[3.0, 3.0, 3.0])), [(0, 3)]);
    }

    #[test]
    fn short_runs() {
        assert!(cut(&run(&[])).is_empty());
        assert_eq!(cut(&run(&[1.0])), [(0, 1)]);
    }
}
