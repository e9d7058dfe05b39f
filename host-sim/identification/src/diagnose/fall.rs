//! The one yardstick: how far the squared error falls on rows that no fit has seen.
//!
//! Rows are left out, the model is fitted on the others and judged on them, once without a cause and once
//! with it. The differences over blocks of rows are the observations (a block is several times as long as the
//! residual remembers, so that neighbours do not count twice); their sum is the fall `G`, and its standard
//! error `s` comes from their scatter.
//!
//! What `G / s` means where there is nothing: a cause of `k` coefficients whose test statistic is `T`
//! (chi-square with `k` degrees of freedom) has, to leading order in the number of blocks,
//! `G = (T - 2 k) v` and `s = 2 sqrt(T) v`, `v` the variance of the noise. Seen the other way round,
//! `sqrt(T) = z + sqrt(z^2 + 2 k)` with `z = G / s`: a gain of two standard errors on unseen rows is worth a
//! t of 4.4 on seen ones. That turns `z` into a probability, which then pays for every alternative that was
//! looked at.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// A fall of the squared error on unseen rows, with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fall {
    /// The fall, Nm^2.
    pub value: f64,
    /// Its standard error, Nm^2.
    pub error: f64,
    /// How many observations it is the sum of.
    pub observations: usize,
    /// In standard errors, each observation weighed by the error of its own block.
    evened: f64,
    /// How many ways to weigh the observations the surer was taken of.
    ways: f64,
}

impl Fall {
    /// The sum of independent observations.
    pub fn of(falls: impl Iterator<Item = f64> + Clone) -> Self {
        let observations = falls.clone().count();
        let n = observations as f64;
        let value: f64 = falls.clone().sum();
        if observations < 2 {
            return Self { value, error: f64::INFINITY, observations, evened: 0.0, ways: 1.0 };
        }
        let squares: f64 = falls.map(|fall| (fall - value / n).powi(2)).sum();
        let error = (squares * n / (n - 1.0)).sqrt();
        Self { value, error, observations, evened: 0.0, ways: 1.0 }
    }

    /// Between two models' squared errors, block by block.
    pub fn between(before: &[f64], after: &[f64]) -> Self {
        let pairs = || before.iter().zip(after);
        let mut sizes: Vec<f64> = pairs().map(|(before, after)| before + after).collect();
        sizes.sort_by(f64::total_cmp);
        let middle = sizes.get(sizes.len() / 2).copied().unwrap_or_default();
        let size = |own: f64| (own + middle).max(f64::MIN_POSITIVE);
        let by_size = pairs().map(|(before, after)| (before - after) / size(before + after));
        let evened = Self::of(by_size).in_errors();
        Self { evened, ..Self::of(pairs().map(|(before, after)| before - after)) }
    }

    /// Where a few blocks hold most of the error (one run of four that is fast), the plain sum scatters by those few and says
    /// nothing of all others that agree. Weighed each by the error of its own block none counts more than one: the surer of
    /// the two ways gives the standard error, and is paid for.
    #[must_use]
    pub fn surer(self) -> Self {
        let error = if self.value > 0.0 && self.evened > self.in_errors() {
            self.value / self.evened
        } else {
            self.error
        };
        Self { error, ways: 2.0, ..self }
    }

    /// What it is at the least, two standard errors below. Two causes are compared by this: a large fall that a few
    /// blocks make counts for less than one all blocks agree on.
    pub fn at_least(&self) -> f64 {
        self.value - 2.0 * self.error
    }

    /// In standard errors.
    pub fn in_errors(&self) -> f64 {
        if self.error > 0.0 { self.value / self.error } else { 0.0 }
    }

    /// Probability of as much where there is nothing, for a cause of so many coefficients that was chosen
    /// among so many alternatives.
    pub fn probability(&self, coefficients: usize, alternatives: f64) -> f64 {
        let (z, k) = (self.in_errors(), coefficients.max(1) as f64);
        let freedom = self.observations as f64 - k;
        if z <= 0.0 || freedom < 3.0 {
            return 1.0;
        }
        let statistic = (z + (z * z + 2.0 * k).sqrt()).powi(2);
        let alone = FisherSnedecor::new(k, freedom).map_or(1.0, |f| f.sf(statistic / k));
        (self.ways * alone * alternatives).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fall_knows_its_scatter() {
        let fall = Fall::between(&[2.0, 4.0, 3.0, 3.0], &[1.0, 1.0, 1.0, 1.0]);
        assert_eq!(fall.value, 8.0);
        // The differences 1, 3, 2, 2 scatter by sqrt(2/3); four of them sum up to twice that.
        assert!((fall.error - 2.0 * (2.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!(Fall::of([5.0].into_iter()).in_errors(), 0.0);
    }

    #[test]
    fn two_standard_errors_are_a_t_of_four() {
        let fall = Fall { value: 2.0, error: 1.0, observations: 100_000, evened: 0.0, ways: 1.0 };
        // The two-sided normal probability of 2 + sqrt 6.
        assert!(
            (fall.probability(1, 1.0) / 8.6e-6 - 1.0).abs() < 0.05,
            "{}",
            fall.probability(1, 1.0)
        );
        assert_eq!(fall.probability(1, 1e9), 1.0);
        assert!(fall.probability(6, 1.0) > fall.probability(1, 1.0) * 0.01);
    }

    #[test]
    fn one_large_block_does_not_hide_what_all_others_agree_on() {
        let mut before = vec![1.0; 40];
        before[7] = 1000.0;
        let after: Vec<f64> = before.iter().map(|before| 0.2 * before).collect();
        let fall = Fall::between(&before, &after);
        assert!(fall.probability(1, 1.0) > 0.005, "{}", fall.probability(1, 1.0));
        assert!(fall.surer().probability(1, 1.0) < 1e-6, "{}", fall.surer().probability(1, 1.0));
        assert_eq!(fall.surer().value, fall.value);
        let loss = Fall::between(&after, &before).surer();
        assert_eq!((loss.probability(1, 1.0), loss.at_least() < 0.0), (1.0, true));
    }

    #[test]
    fn a_loss_is_no_gain() {
        assert_eq!(Fall::between(&[1.0; 8], &[2.0; 8]).probability(1, 1.0), 1.0);
    }
}
