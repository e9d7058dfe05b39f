//! A quantity over time, for the duration that a screen can show.
//!
//! A joint sends its quantities a thousand times a second, but a screen has a few hundred columns. So values are kept in
//! short buckets with their minimum and maximum. A spike of one sample is visible in any window, and ten minutes take a
//! few megabytes. Without values there is no bucket, and the chart has a gap. The total minimum and maximum are kept
//! until they are reset.

use std::collections::VecDeque;

/// Length of a bucket, ns.
const BUCKET_NS: u64 = 5_000_000;
/// Kept duration, s.
pub const KEPT_S: u64 = 600;
/// Maximum number of buckets.
const MAX_BUCKETS: usize = (KEPT_S * 1_000_000_000 / BUCKET_NS) as usize;
/// Age after which a value is stale, ns, unless the usual period is longer.
const STALE_NS: u64 = 500_000_000;
/// Number of usual periods after which there is a gap or a value is stale.
const GAP_PERIODS: f64 = 5.0;

#[derive(Clone, Copy, Debug)]
struct Bucket {
    number: u64,
    least: f32,
    most: f32,
}

/// A value with the time at which it arrived.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed<T> {
    /// Bus time, ns.
    pub time_ns: u64,
    /// The value.
    pub value: T,
}

/// A quantity over time.
#[derive(Clone, Debug, Default)]
pub struct Series {
    buckets: VecDeque<Bucket>,
    /// The latest value.
    pub last: Option<Timed<f32>>,
    /// True if the joint reports the quantity as not measured: the latest value was NaN.
    pub is_unmeasured: bool,
    /// Usual time between values, ns.
    step_ns: Option<f64>,
    /// Minimum and maximum since the last reset.
    pub range: Option<[f32; 2]>,
    line_range: Option<[f32; 2]>,
}

fn widen(range: &mut Option<[f32; 2]>, value: f32) {
    let [least, most] = range.unwrap_or([value, value]);
    *range = Some([least.min(value), most.max(value)]);
}

impl Series {
    /// Adds a value. A value that is not finite means that the quantity is not measured.
    pub fn push(&mut self, time_ns: u64, value: f32) {
        self.is_unmeasured = !value.is_finite();
        if self.is_unmeasured {
            return;
        }
        if let Some(before) = self.last.replace(Timed { time_ns, value }) {
            let step_ns = time_ns.saturating_sub(before.time_ns) as f64;
            // A pause does not change the usual period.
            let usual_ns = self.step_ns.unwrap_or(step_ns);
            self.step_ns = Some(usual_ns + 0.05 * (step_ns.min(2e9) - usual_ns));
        }
        widen(&mut self.range, value);
        widen(&mut self.line_range, value);
        let number = time_ns / BUCKET_NS;
        match self.buckets.back_mut() {
            // Time stamps may be slightly out of order.
            Some(bucket) if number <= bucket.number => {
                bucket.least = bucket.least.min(value);
                bucket.most = bucket.most.max(value);
            }
            _ => {
                if self.buckets.len() == MAX_BUCKETS {
                    self.buckets.pop_front();
                }
                self.buckets.push_back(Bucket { number, least: value, most: value });
            }
        }
    }

    /// Returns the age after which a value is stale, ns.
    pub fn stale_ns(&self) -> u64 {
        let habit_ns = self.step_ns.map_or(0.0, |step_ns| GAP_PERIODS * step_ns);
        (habit_ns as u64).max(STALE_NS)
    }

    /// Resets the minimum and maximum.
    pub fn reset_range(&mut self) {
        self.range = None;
    }

    /// Returns the minimum and maximum since the last call.
    pub fn take_line_range(&mut self) -> Option<[f32; 2]> {
        self.line_range.take()
    }

    /// Returns the minimum and maximum of each column of the window that ends now, the oldest first. Also returns the usual
    /// number of empty columns, because values may be slower than columns.
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
        // Columns are aligned in time, so that a rolling chart does not flicker.
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
        let bridged = (GAP_PERIODS * step_ns / column_ns as f64).ceil() as usize;
        (columns, bridged.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn columns_with_spike_of_one_sample_show_it_in_any_window() {
        let mut series = Series::default();
        for at in 0..20_000u64 {
            series.push(at * MS, if at == 12_345 { 9.0 } else { 1.0 });
        }
        for window_s in [10, 60, 600] {
            let (columns, _) = series.columns(20_000 * MS, window_s * 1000 * MS, 100);
            let peaks = columns.iter().flatten().filter(|[_, most]| *most == 9.0).count();
            assert_eq!(peaks, 1, "{window_s}");
        }
        assert_eq!(series.range, Some([1.0, 9.0]));
        series.reset_range();
        series.push(20_001 * MS, 2.0);
        assert_eq!(series.range, Some([2.0, 2.0]));
        assert_eq!(series.take_line_range(), Some([1.0, 9.0]));
        assert_eq!(series.take_line_range(), None);
    }

    #[test]
    fn columns_after_silence_have_a_moving_gap() {
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
    fn series_with_slow_values_has_no_gaps_and_later_staleness() {
        let mut series = Series::default();
        assert_eq!(series.stale_ns(), STALE_NS);
        (0..20).for_each(|at| series.push(at * 1000 * MS, at as f32));
        assert!((4900 * MS..5100 * MS).contains(&series.stale_ns()), "{}", series.stale_ns());
        let (columns, bridged) = series.columns(19_000 * MS, 10_000 * MS, 100);
        assert_eq!(columns.iter().flatten().count(), 10);
        assert!(bridged >= 10, "{bridged}");
    }

    #[test]
    fn push_with_nan_reports_not_measured() {
        let mut series = Series::default();
        series.push(0, 1.0);
        series.push(MS, f32::NAN);
        assert!(series.is_unmeasured);
        assert_eq!(
            (series.last, series.range),
            (Some(Timed { time_ns: 0, value: 1.0 }), Some([1.0, 1.0]))
        );
        series.push(2 * MS, 2.0);
        assert!(!series.is_unmeasured);
    }

    #[test]
    fn series_with_many_values_stays_bounded() {
        let mut series = Series::default();
        (0..2 * MAX_BUCKETS as u64).for_each(|at| series.push(at * BUCKET_NS, 0.0));
        assert_eq!(series.buckets.len(), MAX_BUCKETS);
        series.push(3, 7.0);
        assert_eq!(series.buckets.len(), MAX_BUCKETS);
        for (now_ns, window_ns, count) in [(0, 0, 0), (0, 1, 5), (u64::MAX / 2, 10, 3), (5, 5, 1)] {
            assert_eq!(series.columns(now_ns, window_ns, count).0.len(), count);
        }
    }
}
