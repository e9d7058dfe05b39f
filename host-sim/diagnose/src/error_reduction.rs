//! Reduction of the squared error on held-out rows.
//!
//! Some rows are held out. The model is fitted to the other rows and evaluated on the held-out
//! rows, without and with a cause. The differences of the squared errors by block of rows are the
//! observations. A block is several times as long as the residual autocorrelation time, so that
//! blocks are nearly independent. The sum of the observations is the error reduction `G`, in Nm^2.
//! Their scatter gives its standard error `s`.
//!
//! Under the null hypothesis, a cause of `k` coefficients has a test statistic `T` (chi-square with
//! `k` degrees of freedom). To leading order in the number of blocks, `G = (T - 2 k) v` and
//! `s = 2 sqrt(T) v`, where `v` is the noise variance. The inverse is
//! `sqrt(T) = z + sqrt(z^2 + 2 k)` with `z = G / s`. For one coefficient, two standard errors on
//! held-out rows therefore correspond to a t statistic of 4.4 on training rows.
//!
//! The statistic gives a probability. This probability is multiplied by the number of tested
//! alternatives.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Reduction of the squared error on held-out rows, with its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ErrorReduction {
    /// The reduction, Nm^2.
    pub value: f64,
    /// Its standard error, Nm^2.
    pub error: f64,
    /// Number of observations in the sum.
    pub observations: usize,
}

impl ErrorReduction {
    /// Returns the sum of independent observations, with its standard error.
    pub fn of(falls: impl Iterator<Item = f64> + Clone) -> Self {
        let observations = falls.clone().count();
        let n = observations as f64;
        let value: f64 = falls.clone().sum();
        if observations < 2 {
            return Self { value, error: f64::INFINITY, observations };
        }
        let squares: f64 = falls.map(|fall| (fall - value / n).powi(2)).sum();
        let error = (squares * n / (n - 1.0)).sqrt();
        Self { value, error, observations }
    }

    /// Returns the reduction in standard errors.
    pub fn in_standard_errors(&self) -> f64 {
        if self.error > 0.0 { self.value / self.error } else { 0.0 }
    }

    /// Returns the probability of this reduction under the null hypothesis.
    ///
    /// The cause has this number of coefficients and was chosen from this number of alternatives.
    /// Returns 1 for a reduction that is not positive and for too few observations.
    pub fn probability(&self, coefficients: usize, alternatives: f64) -> f64 {
        let (z, k) = (self.in_standard_errors(), coefficients.max(1) as f64);
        let freedom = self.observations as f64 - k;
        if z <= 0.0 || freedom < 3.0 {
            return 1.0;
        }
        let statistic = (z + (z * z + 2.0 * k).sqrt()).powi(2);
        let alone = FisherSnedecor::new(k, freedom).map_or(1.0, |f| f.sf(statistic / k));
        (alone * alternatives).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_four_observations_has_standard_error_of_scatter() {
        let fall = ErrorReduction::of([1.0, 3.0, 2.0, 2.0].into_iter());
        assert_eq!(fall.value, 8.0);
        // The standard deviation is sqrt(2/3). The sum of four has twice that.
        assert!((fall.error - 2.0 * (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(ErrorReduction::of([5.0].into_iter()).in_standard_errors(), 0.0);
    }

    #[test]
    fn probability_of_two_standard_errors_matches_normal_tail() {
        let fall = ErrorReduction { value: 2.0, error: 1.0, observations: 100_000 };
        // Two-sided normal probability of 2 + sqrt 6.
        assert!(
            (fall.probability(1, 1.0) / 8.6e-6 - 1.0).abs() < 0.05,
            "{}",
            fall.probability(1, 1.0)
        );
        assert_eq!(fall.probability(1, 1e9), 1.0);
        assert!(fall.probability(6, 1.0) > fall.probability(1, 1.0) * 0.01);
    }

    #[test]
    fn probability_of_negative_reduction_is_one() {
        assert_eq!(ErrorReduction::of([-1.0; 8].into_iter()).probability(1, 1.0), 1.0);
    }
}
