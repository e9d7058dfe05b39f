//! A quantity over time, kept for as long as a screen can show it.
//!
//! A joint says its quantities a thousand times a second; a screen has some hundred dots across. So the
//! past is kept in short buckets, the least and the most of each: a spike of one sample is seen at any
//! window, and ten minutes take a few megabytes. Where nothing was heard there is no bucket, and a chart
//! has a gap. Least and most of all that was heard are kept beside, until they are asked to begin anew.

use std::collections::VecDeque;

/// Length of a bucket, ns.
const BUCKET_NS: u64 = 5_000_000;
/// Longest past that is kept, s.
pub const LONGEST_S: u64 = 600;
/// Buckets that are kept, at most.
const KEPT: usize = (LONGEST_S * 1_000_000_000 / BUCKET_NS) as usize;
/// A value this old is stale, ns, unless values come slower by habit.
const STALE_NS: u64 = 500_000_000;
/// Steps between values beyond which there is a gap, or the last one is stale.
const GAP_STEPS: f64 = 5.0;

#[derive(Clone, Copy, Debug)]
struct Bucket {
    number: u64,
    least: f32,
    most: f32,
}

/// A quantity over time.
#[derive(Clone, Debug, Default)]
pub struct Series {
    buckets: VecDeque<Bucket>,
    last: Option<(u64, f32)>,
    /// The latest value was no number: nobody measures the quantity.
    unmeasured: bool,
    /// Usual time between values, ns.
    step_ns: Option<f64>,
    range: Option<[f32; 2]>,
    line_range: Option<[f32; 2]>,
}

fn widen(range: &mut Option<[f32; 2]>, value: f32) {
    let [least, most] = range.unwrap_or([value, value]);
    *range = Some([least.min(value), most.max(value)]);
}

impl Series {
    /// Takes in a value; one that is no finite number says that nobody measures it.
    pub fn push(&mut self, time_ns: u64, value: f32) {
        self.unmeasured = !value.is_finite();
        if self.unmeasured {
            return;
        }
        if let Some((before_ns, _)) = self.last {
            let step_ns = time_ns.saturating_sub(before_ns) as f64;
            // A pause is no habit.
            let usual_ns = self.step_ns.unwrap_or(step_ns);
            self.step_ns = Some(usual_ns + 0.05 * (step_ns.min(2e9) - usual_ns));
        }
        self.last = Some((time_ns, value));
        widen(&mut self.range, value);
        widen(&mut self.line_range, value);
        let number = time_ns / BUCKET_NS;
        match self.buckets.back_mut() {
            // Stamps may be a little out of order.
            Some(bucket) if number <= bucket.number => {
                bucket.least = bucket.least.min(value);
                bucket.most = bucket.most.max(value);
            }
            _ => {
                if self.buckets.len() == KEPT {
                    self.buckets.pop_front();
                }
                self.buckets.push_back(Bucket { number, least: value, most: value });
            }
        }
    }

    /// The latest value and when it came.
    pub const fn last(&self) -> Option<(u64, f32)> {
        self.last
    }

    /// Whether the latest thing heard was that nobody measures it.
    pub const fn is_unmeasured(&self) -> bool {
        self.unmeasured
    }

    /// Age from which on a value is stale, ns.
    pub fn stale_ns(&self) -> u64 {
        let habit_ns = self.step_ns.map_or(0.0, |step_ns| GAP_STEPS * step_ns);
        (habit_ns as u64).max(STALE_NS)
    }

    /// Least and most since the start, or since they were forgotten.
    pub const fn range(&self) -> Option<[f32; 2]> {
        self.range
    }

    /// Begins least and most anew.
    pub fn forget_range(&mut self) {
        self.range = None;
    }

    /// Least and most since this was last asked.
    pub fn take_line_range(&mut self) -> Option<[f32; 2]> {
        self.line_range.take()
    }

    /// Least and most by column of the window that ends now, the oldest first; and how many columns
    /// without a value are usual, because values come slower than columns.
    pub fn columns(
        &self,
        now_ns: u64,
        window_ns: u64,
        count: usize,
    ) -> (Vec<Option<[f32; 2]>>, usize) {
        let mut columns = vec![None; count];
        let (Some(column_ns), true) = (window_ns.checked_div(count as u64), count > 0) else {
            return (columns, 0);
        };
        let column_ns = column_ns.max(1);
        // Columns keep their places in time, or a chart would flicker as it rolls.
        let end = now_ns / column_ns;
        let first_ns = (end + 1).saturating_sub(count as u64) * column_ns;
        let start = self.buckets.partition_point(|of| (of.number + 1) * BUCKET_NS <= first_ns);
        for bucket in self.buckets.range(start..) {
            let column = (bucket.number * BUCKET_NS).max(first_ns) / column_ns;
            let place = (column + count as u64).checked_sub(end + 1);
            let place = place.and_then(|place| columns.get_mut(place as usize));
            if let Some(range) = place {
                widen(range, bucket.least);
                widen(range, bucket.most);
            }
        }
        let step_ns = self.step_ns.unwrap_or(0.0).max(BUCKET_NS as f64);
        let bridged = (GAP_STEPS * step_ns / column_ns as f64).ceil() as usize;
        (columns, bridged.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn a_spike_of_one_sample_is_seen_at_any_window() {
        let mut series = Series::default();
        for at in 0..20_000u64 {
            series.push(at * MS, if at == 12_345 { 9.0 } else { 1.0 });
        }
        for window_s in [10, 60, 600] {
            let (columns, _) = series.columns(20_000 * MS, window_s * 1000 * MS, 100);
            let peaks = columns.iter().flatten().filter(|[_, most]| *most == 9.0).count();
            assert_eq!(peaks, 1, "{window_s}");
        }
        assert_eq!(series.range(), Some([1.0, 9.0]));
        series.forget_range();
        series.push(20_001 * MS, 2.0);
        assert_eq!(series.range(), Some([2.0, 2.0]));
        assert_eq!(series.take_line_range(), Some([1.0, 9.0]));
        assert_eq!(series.take_line_range(), None);
    }

    #[test]
    fn silence_is_a_gap_that_rolls() {
        let mut series = Series::default();
        (0..1000).for_each(|at| series.push(at * MS, 0.5));
        let filled = |now_ms: u64| {
            let (columns, bridged) = series.columns(now_ms * MS, 2000 * MS, 200);
            assert!(bridged < 10, "{bridged}");
            let first = columns.iter().position(Option::is_some);
            (columns.iter().flatten().count(), first)
        };
        assert_eq!(filled(999), (100, Some(100)));
        assert_eq!(filled(1999), (100, Some(0)));
        assert_eq!(filled(2499), (50, Some(0)));
        assert_eq!(filled(60_000), (0, None));
    }

    #[test]
    fn slow_values_are_no_gaps_and_stale_later() {
        let mut series = Series::default();
        assert_eq!(series.stale_ns(), STALE_NS);
        (0..20).for_each(|at| series.push(at * 1000 * MS, at as f32));
        assert!((4900 * MS..5100 * MS).contains(&series.stale_ns()), "{}", series.stale_ns());
        let (columns, bridged) = series.columns(19_000 * MS, 10_000 * MS, 100);
        assert_eq!(columns.iter().flatten().count(), 10);
        assert!(bridged >= 10, "{bridged}");
    }

    #[test]
    fn what_nobody_measures_is_no_value() {
        let mut series = Series::default();
        series.push(0, 1.0);
        series.push(MS, f32::NAN);
        assert!(series.is_unmeasured());
        assert_eq!((series.last(), series.range()), (Some((0, 1.0)), Some([1.0, 1.0])));
        series.push(2 * MS, 2.0);
        assert!(!series.is_unmeasured());
    }

    #[test]
    fn the_past_is_bounded_and_odd_calls_do_no_harm() {
        let mut series = Series::default();
        (0..2 * KEPT as u64).for_each(|at| series.push(at * BUCKET_NS, 0.0));
        assert_eq!(series.buckets.len(), KEPT);
        series.push(3, 7.0);
        assert_eq!(series.buckets.len(), KEPT);
        for (now_ns, window_ns, count) in [(0, 0, 0), (0, 1, 5), (u64::MAX / 2, 10, 3), (5, 5, 1)] {
            assert_eq!(series.columns(now_ns, window_ns, count).0.len(), count);
        }
    }
}
