//! Range of the data at a monitoring time (Ding et al., eq. 2 and Fig. 2).
//!
//! The paper repeats one experiment `m` times and takes, at each monitoring time, the smallest and the largest measured
//! torque. Repeats have the same inputs, so this is equivalent to
//!
//! ```text
//! torque of the fitted model  +  range of m residuals
//! ```
//!
//! This form also applies to logs without repeated runs. The residuals are those of the class at similar velocity (speed
//! and direction). Their range is the median range of `m` draws, so that it does not depend on a random draw. A better
//! model has smaller residuals and therefore a narrower range. The bias of a fit is preserved: the range need not
//! contain 0.

/// Maximum number of velocity bins of a class.
const MAX_BINS: usize = 12;

/// Range of the residual by velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Ranges {
    /// Upper velocity of each bin but the last, ascending.
    ends: Vec<f32>,
    /// Smallest and largest residual of each bin, Nm.
    ranges: Vec<(f32, f32)>,
}

/// Returns the median rank of the smallest of `draws` residuals, as a share of all residuals.
pub fn share_beyond(draws: usize) -> f64 {
    1.0 - 0.5f64.powf(1.0 / draws.max(1) as f64)
}

impl Ranges {
    /// Computes the range of `draws` residuals in each velocity bin. `rows` are velocity and residual.
    pub fn new(rows: impl Iterator<Item = (f32, f32)>, draws: usize) -> Self {
        let mut rows: Vec<(f32, f32)> = rows.collect();
        rows.sort_by(|a, b| a.0.total_cmp(&b.0));
        // A bin needs at least as many rows as draws.
        let bins = (rows.len() / draws.max(1)).clamp(1, MAX_BINS);
        let (mut ends, mut ranges) = (Vec::new(), Vec::new());
        let mut begin = 0;
        for bin in 1..=bins {
            let Some(end_velocity) = rows.get((bin * rows.len() / bins).saturating_sub(1)) else {
                break;
            };
            // Rows of equal velocity share a bin, such as those of a joint at rest.
            let end_velocity = end_velocity.0;
            let end = rows.partition_point(|(velocity, _)| *velocity <= end_velocity);
            if end <= begin {
                continue;
            }
            let residuals = rows[begin..end].iter().map(|(_, residual)| *residual);
            ranges.push(range_of(residuals.collect(), draws));
            ends.push(end_velocity);
            begin = end;
        }
        ends.pop();
        Self { ends, ranges }
    }

    /// Returns the same range for all velocities, from `-end` to `end`, Nm.
    pub fn symmetric(end: f32) -> Self {
        Self { ends: Vec::new(), ranges: vec![(-end, end)] }
    }

    /// Returns ranges that are symmetric around the fit, with the larger of both limits. They are used for a fit that is itself
    /// outside its range too often for a certificate.
    #[must_use]
    pub fn around_the_fit(mut self) -> Self {
        for range in &mut self.ranges {
            let end = range.0.abs().max(range.1.abs());
            *range = (-end, end);
        }
        self
    }

    /// Returns the smallest and largest residual at a velocity, Nm.
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
    fn new_with_velocity_dependent_residuals_has_range_of_each_bin() {
        // The residual lies between 0 and the velocity.
        let row = |i: i32| {
            let velocity = (i % 200 - 100) as f32 / 100.0;
            let share = (i * 37 % 101) as f32 / 100.0;
            (velocity, velocity * share)
        };
        let ranges = Ranges::new((0..20_000).map(row), 50);
        assert_eq!(ranges.ranges.len(), MAX_BINS);
        let (low, high) = ranges.at(0.95);
        assert!((0.0..0.1).contains(&low) && (0.85..=1.0).contains(&high), "{low} {high}");
        let (low, high) = ranges.at(-0.95);
        assert!((-1.0..-0.85).contains(&low) && (-0.1..=0.0).contains(&high), "{low} {high}");
        assert_eq!(ranges.at(5.0), ranges.at(0.999));
    }

    #[test]
    fn new_returns_median_range_of_draws() {
        // Of 1001 evenly spaced residuals, the median of the smallest of 50 is the 14th.
        let ranges = Ranges::new((0..1001).map(|i| (0.0, i as f32)), 50);
        assert_eq!(ranges.at(0.0), (13.0, 987.0));
        assert_eq!(ranges.around_the_fit().at(0.0), (-987.0, 987.0));
    }

    #[test]
    fn new_with_rows_at_rest_has_one_bin_for_them() {
        let rows = (0..600).map(|i| (if i < 500 { 0.0 } else { 1.0 }, i as f32));
        let ranges = Ranges::new(rows, 50);
        assert_eq!(ranges.ranges.len(), 2);
        assert!(ranges.at(0.0).1 < 500.0 && ranges.at(1.0).0 >= 500.0);
    }

    #[test]
    fn new_with_few_or_no_rows_has_finite_range() {
        let ranges = Ranges::new([(0.0, 1.0), (1.0, -2.0)].into_iter(), 50);
        assert_eq!(ranges.at(0.5), (-2.0, 1.0));
        assert_eq!(Ranges::new([].into_iter(), 50).at(0.0), (0.0, 0.0));
    }
}
