//! The data's range at a monitoring time (Ding et al., eq. 2 and Fig. 2).
//!
//! The paper repeats one experiment `m` times and takes, at each monitoring time, the smallest and
//! the largest torque that was measured. Repeats have the same inputs, so that is the same as
//!
//! ```text
//! what the fitted model gives there  +  the range of m residuals
//! ```
//!
//! and in this form it also holds where no two runs are alike, as in most logs: the residuals are those of
//! the class at like velocity (speed and direction), and their range is the median one of `m` drawn from
//! them, so that no luck of a draw is in it. A model that knows more has smaller residuals, hence a narrower
//! range. A fit that is off there stays off: 0 need not lie in the range.

use statrs::distribution::{ContinuousCDF, Normal};

/// The most velocity bins of a class.
const BINS: usize = 12;

/// The range of the residual by velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranges {
    /// Where a bin ends, ascending; the last has no end.
    ends: Vec<f32>,
    /// Smallest and largest residual of each bin, Nm.
    ranges: Vec<(f32, f32)>,
}

/// The share of all residuals that the smallest of `draws` is above as often as below.
fn share_beyond(draws: usize) -> f64 {
    1.0 - 0.5f64.powf(1.0 / draws.max(1) as f64)
}

impl Ranges {
    /// The ranges of `draws` residuals in each bin of velocity. `rows` are velocity and residual.
    pub fn new(rows: impl Iterator<Item = (f32, f32)>, draws: usize) -> Self {
        let mut rows: Vec<(f32, f32)> = rows.collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        // With fewer rows than draws a range would be that of the bin, not of the draws.
        let bins = (rows.len() / draws.max(1)).clamp(1, BINS);
        let (mut ends, mut ranges) = (Vec::new(), Vec::new());
        let mut begin = 0;
        for bin in 1..=bins {
            let Some(end_velocity) = rows.get((bin * rows.len() / bins).saturating_sub(1)) else {
                break;
            };
            // Equal velocities belong together: a joint at rest is one bin.
            let end_velocity = end_velocity.0;
            let end = rows.partition_point(|(velocity, _)| *velocity <= end_velocity);
            if end <= begin {
                continue;
            }
            let own = rows[begin..end].iter().map(|(_, residual)| *residual);
            ranges.push(range_of(own.collect(), draws));
            ends.push(end_velocity);
            begin = end;
        }
        ends.pop();
        Self { ends, ranges }
    }

    /// The range of `draws` numbers of white noise, at every velocity. `noise` is its standard
    /// deviation, Nm.
    pub fn of_noise(noise: f64, draws: usize) -> Self {
        let end = noise * Normal::standard().inverse_cdf(1.0 - share_beyond(draws));
        Self { ends: Vec::new(), ranges: vec![(-end as f32, end as f32)] }
    }

    /// The same laid around the fit: as far to either side as the farther end. For a fit that is itself
    /// outside so often that nothing could be certified.
    #[must_use]
    pub fn around_the_fit(mut self) -> Self {
        for range in &mut self.ranges {
            let end = range.0.abs().max(range.1.abs());
            *range = (-end, end);
        }
        self
    }

    /// Smallest and largest residual at a velocity, Nm.
    pub fn at(&self, velocity: f32) -> (f32, f32) {
        let bin = self.ends.partition_point(|end| *end < velocity);
        self.ranges.get(bin).copied().unwrap_or((0.0, 0.0))
    }
}

fn range_of(mut residuals: Vec<f32>, draws: usize) -> (f32, f32) {
    residuals.sort_by(f32::total_cmp);
    let last = residuals.len() - 1;
    let beyond = ((share_beyond(draws) * residuals.len() as f64) as usize).min(last / 2);
    (residuals[beyond], residuals[last - beyond])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_velocity_has_the_range_of_its_own_rows() {
        // The residual is within the velocity's size, and its sign is the velocity's at one end.
        let row = |i: i32| {
            let velocity = (i % 200 - 100) as f32 / 100.0;
            let share = (i * 37 % 101) as f32 / 100.0;
            (velocity, velocity * share)
        };
        let ranges = Ranges::new((0..20_000).map(row), 50);
        assert_eq!(ranges.ranges.len(), BINS);
        let (low, high) = ranges.at(0.95);
        assert!((0.0..0.1).contains(&low) && (0.85..=1.0).contains(&high), "{low} {high}");
        let (low, high) = ranges.at(-0.95);
        assert!((-1.0..-0.85).contains(&low) && (-0.1..=0.0).contains(&high), "{low} {high}");
        assert_eq!(ranges.at(5.0), ranges.at(0.999));
    }

    #[test]
    fn the_range_is_the_median_one_of_so_many_draws() {
        // Of 1001 evenly spread residuals, the smallest of 50 is below the 14th as often as not.
        let ranges = Ranges::new((0..1001).map(|i| (0.0, i as f32)), 50);
        assert_eq!(ranges.at(0.0), (13.0, 987.0));
        let (low, high) = Ranges::of_noise(2.0, 50).at(0.0);
        assert!(low == -high && (high - 4.41).abs() < 0.01, "{high}");
        assert!(Ranges::of_noise(2.0, 1732).at(0.0).1 > 6.0);
        assert_eq!(ranges.around_the_fit().at(0.0), (-987.0, 987.0));
    }

    #[test]
    fn a_joint_at_rest_is_one_bin() {
        let rows = (0..600).map(|i| (if i < 500 { 0.0 } else { 1.0 }, i as f32));
        let ranges = Ranges::new(rows, 50);
        assert_eq!(ranges.ranges.len(), 2);
        assert!(ranges.at(0.0).1 < 500.0 && ranges.at(1.0).0 >= 500.0);
    }

    #[test]
    fn few_rows_or_none_have_a_range_too() {
        let ranges = Ranges::new([(0.0, 1.0), (1.0, -2.0)].into_iter(), 50);
        assert_eq!(ranges.at(0.5), (-2.0, 1.0));
        assert_eq!(Ranges::new([].into_iter(), 50).at(0.0), (0.0, 0.0));
    }
}
