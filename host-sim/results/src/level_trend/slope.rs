//! Robust slope: the median of the slopes of all pairs of points, with an interval and a test of Kendall.
//!
//! Sources: Sen, "Estimates of the regression coefficient based on Kendall's tau", JASA 63, 1968. Hamed and Rao, "A modified
//! Mann-Kendall trend test for autocorrelated data", J. Hydrology 204, 1998: entries that follow each other share their
//! temperature, so the variance of the test grows with the autocorrelation of the residuals. Marriott and Pope, "Bias in the
//! estimation of autocorrelations", Biometrika 41, 1954: the residuals of a fitted line show less of it than there is.

use joint_log::statistics::median_of_sorted;
use statrs::distribution::{ContinuousCDF, Normal};

/// Minimum number of points. Fewer cannot be significant in a fleet.
pub const MIN_ENTRIES: usize = 6;

/// Maximum number of points; of more, every n-th is used.
const MAX_POINTS: usize = 1000;

/// Largest autocorrelation that is accounted for: beyond it, the points are one observation.
const MAX_AUTOCORRELATION: f64 = 0.95;

/// Slope of a line through points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobustSlope {
    /// Change per unit of time.
    pub slope: f64,
    /// Ends of the slope's interval.
    pub interval: [f64; 2],
    /// Probability of a slope of this size without a trend.
    pub p_value: f64,
    /// Value of the line at the first point.
    pub first: f64,
    /// Value of the line at the last point.
    pub last: f64,
    /// Time from the first to the last point.
    pub span: f64,
}

impl RobustSlope {
    /// Returns the slope and its interval as shares of the value at the first point.
    pub fn relative(&self) -> Self {
        let interval = self.interval.map(|end| end / self.first);
        Self { slope: self.slope / self.first, interval, ..*self }
    }
}

/// Fits a line to points in the order of time, with an interval of this confidence. `None` if there are too few.
pub fn robust_slope(points: &[(f64, f64)], confidence: f64) -> Option<RobustSlope> {
    let step = points.len().div_ceil(MAX_POINTS).max(1);
    let points: Vec<(f64, f64)> = points.iter().copied().step_by(step).collect();
    let count = points.len();
    if count < MIN_ENTRIES {
        return None;
    }
    let mut slopes = Vec::with_capacity(count * (count - 1) / 2);
    let mut score = 0.0;
    for (at, (time, value)) in points.iter().enumerate() {
        for (later_time, later) in &points[at + 1..] {
            slopes.push((later - value) / (later_time - time));
            score += (later - value).partial_cmp(&0.0).map_or(0.0, |order| f64::from(order as i8));
        }
    }
    slopes.sort_by(f64::total_cmp);
    let slope = median_of_sorted(&slopes);
    let mut offsets: Vec<f64> = points.iter().map(|(time, value)| value - slope * time).collect();
    let residuals = offsets.clone();
    offsets.sort_by(f64::total_cmp);
    let line = |time: f64| median_of_sorted(&offsets) + slope * time;
    let number = count as f64;
    let correlation = autocorrelation(&residuals);
    let inflation = (1.0 + correlation) / (1.0 - correlation);
    let deviation = (number * (number - 1.0) * (2.0 * number + 5.0) / 18.0 * inflation).sqrt();
    let normal = Normal::new(0.0, 1.0).ok()?;
    let half = normal.inverse_cdf(0.5 + 0.5 * confidence) * deviation;
    let place = |of: f64| (of.max(0.0) as usize).min(slopes.len() - 1);
    let pairs = slopes.len() as f64;
    let low = slopes[place((0.5 * (pairs - half)).floor() - 1.0)];
    let high = slopes[place((0.5 * (pairs + half)).ceil())];
    // The correction for continuity.
    let score = (score.abs() - 1.0).max(0.0);
    let (first, last) = (points[0].0, points[count - 1].0);
    Some(RobustSlope {
        slope,
        interval: [low, high],
        p_value: 2.0 * normal.cdf(-score / deviation),
        first: line(first),
        last: line(last),
        span: last - first,
    })
}

/// Returns the autocorrelation of neighbours, less the bias of a few residuals of a line, `-(2 + 4 r) / n`; 0 if it is negative.
fn autocorrelation(values: &[f64]) -> f64 {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let square: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    let product: f64 = values.windows(2).map(|pair| (pair[0] - mean) * (pair[1] - mean)).sum();
    // Points exactly on a line leave rounding errors.
    let rounding = values.len() as f64 * (1e-9 * mean).powi(2);
    if square <= rounding || product <= 0.0 {
        return 0.0;
    }
    let found = product / square;
    (found + (2.0 + 4.0 * found) / values.len() as f64).min(MAX_AUTOCORRELATION)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::noise::noise;

    /// Returns points with this slope and noise whose neighbours have this correlation.
    fn points(
        count: usize,
        slope: f64,
        correlation: f64,
        noise: &mut impl FnMut() -> f64,
    ) -> Vec<(f64, f64)> {
        let mut deviation = noise();
        let fresh = (1.0 - correlation * correlation).sqrt();
        (0..count)
            .map(|at| {
                deviation = correlation * deviation + fresh * noise();
                (at as f64, 4.0 + slope * at as f64 + 0.1 * deviation)
            })
            .collect()
    }

    #[test]
    fn robust_slope_of_a_line_with_outliers_is_that_of_the_line() {
        let mut line = points(30, 0.05, 0.0, &mut noise(3));
        line[4].1 = 40.0;
        line[20].1 = 0.1;
        let found = robust_slope(&line, 0.95).unwrap();
        assert!((found.slope - 0.05).abs() < 0.01, "{found:?}");
        assert!(found.interval[0] < 0.05 && 0.05 < found.interval[1] && found.p_value < 1e-6);
        assert!((found.first - 4.0).abs() < 0.1 && (found.last - 5.45).abs() < 0.1, "{found:?}");
        assert_eq!(found.span, 29.0);
        assert_eq!(robust_slope(&line[..5], 0.95), None);
    }

    #[test]
    fn robust_slope_without_a_trend_is_significant_as_rarely_as_it_states() {
        let mut noise = noise(7);
        // Entries that wander with the water temperature are the hardest case.
        for (correlation, most) in [(0.0, 0.08), (0.6, 0.08), (0.9, 0.1)] {
            let significant = (0..400).filter(|_| {
                let found = robust_slope(&points(80, 0.0, correlation, &mut noise), 0.95).unwrap();
                assert!(found.interval[0] <= found.slope && found.slope <= found.interval[1]);
                found.p_value < 0.05
            });
            let share = significant.count() as f64 / 400.0;
            assert!(share < most, "{share} at a correlation of {correlation}");
        }
    }

    #[test]
    fn robust_slope_of_a_constant_is_zero() {
        let level: Vec<(f64, f64)> = (0..9).map(|at| (f64::from(at), 2.0)).collect();
        let found = robust_slope(&level, 0.95).unwrap();
        assert_eq!((found.slope, found.interval, found.p_value), (0.0, [0.0; 2], 1.0));
    }
}
