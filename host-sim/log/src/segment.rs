//! Segments: parts of a run without gaps.
//!
//! A logger that drops packets leaves a gap. Across a gap, a difference quotient averages over unknown motion, a filter
//! rings as after a step, and a bristle state is unknown. So every computation with memory works on *segments*: parts
//! of a run in which no step is longer than [`GAP_FACTOR`] median steps. The median is used because gaps distort the
//! mean. Steps of zero (a coarse clock repeats its stamps) are excluded: with a clock of 1 ms at 5 kHz, the median would
//! be zero and every step a gap.

use std::ops::Range;

use super::dataset::Run;
use super::statistics::median_step;

/// Minimum length of a gap, median steps. The jitter of a log stays well below twice the median. A few lost samples do
/// not matter for a smooth motion; longer losses do.
pub const GAP_FACTOR: f64 = 5.0;

/// Returns the segments of a run as row ranges in order. Together they cover all rows. A piece ([`Run::pieces`]) ends a segment
/// too.
pub fn segments(run: &Run) -> Vec<Range<usize>> {
    let mut found = segments_of(&run.time_s);
    if run.pieces.is_empty() {
        return found;
    }
    let split = |rows: Range<usize>| {
        let pieces = stretches(&run.pieces[rows.clone()], |one, next| one == next);
        pieces.map(move |piece| rows.start + piece.start..rows.start + piece.end)
    };
    found = found.into_iter().flat_map(split).collect();
    found
}

/// Returns the stretches of alike values as row ranges in order.
pub(super) fn stretches<T>(
    values: &[T],
    are_alike: impl Fn(&T, &T) -> bool,
) -> impl Iterator<Item = Range<usize>> {
    let mut end = 0;
    values.chunk_by(are_alike).map(move |alike| {
        end += alike.len();
        end - alike.len()..end
    })
}

/// Returns the segments of a run, given its times.
pub(super) fn segments_of(time: &[f64]) -> Vec<Range<usize>> {
    if time.is_empty() {
        return Vec::new();
    }
    // Without a long step among the positive ones there is no gap, whatever their median.
    let steps = time.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0);
    let [least, most] = steps.fold([f64::INFINITY, 0.0], |[least, most], step| {
        [f64::min(least, step), f64::max(most, step)]
    });
    if most <= GAP_FACTOR * least {
        return std::iter::once(0..time.len()).collect();
    }
    let longest = median_step(time).map_or(f64::INFINITY, |step| GAP_FACTOR * step);
    stretches(time, |one, next| next - one <= longest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(time_s: &[f64]) -> Run {
        Run { time_s: time_s.to_vec(), ..Run::default() }
    }

    /// Returns the segments as (first row, row after the last).
    fn bounds(run: &Run) -> Vec<(usize, usize)> {
        segments(run).into_iter().map(|rows| (rows.start, rows.end)).collect()
    }

    #[test]
    fn segments_with_step_over_five_medians_splits_run() {
        assert_eq!(bounds(&run(&[0.0, 1.0, 2.0, 7.0, 8.0, 9.0])), [(0, 6)], "just five is no gap");
        assert_eq!(bounds(&run(&[0.0, 1.0, 2.0, 7.5, 8.5, 9.5])), [(0, 3), (3, 6)]);
    }

    #[test]
    fn segments_with_repeated_stamps_ignores_zero_steps() {
        assert_eq!(bounds(&run(&[0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0])), [(0, 8)]);
        assert_eq!(bounds(&run(&[3.0, 3.0, 3.0])), [(0, 3)]);
    }

    #[test]
    fn segments_with_short_run_returns_at_most_one() {
        assert!(bounds(&run(&[])).is_empty());
        assert_eq!(bounds(&run(&[1.0])), [(0, 1)]);
    }
}
