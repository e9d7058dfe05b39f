//! Confidence, accuracy, and the numbers of samples that they require (Ding et al., eq. 6-7).
//!
//! Four counts must be distinguished: `n` sampled *parameter vectors* and `m` *trials* ([`Counts`]), the paper's 8
//! *kinds* of experiment and its 50 *repeats* of each. The paper also uses `m = 50`, but no equation links `m` to the
//! repeats.

/// Confidence and accuracy of a certificate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// Share of the permitted parameter vectors that may violate more than `P0` (eq. 4).
    pub alpha: f64,
    /// Probability that the certificate is wrong.
    pub delta: f64,
    /// Accuracy of an estimated violation probability.
    pub epsilon: f64,
    /// Largest violation probability allowed (eq. 5).
    pub rho: f64,
}

impl Default for Levels {
    /// Returns the paper's levels.
    fn default() -> Self {
        Self { alpha: 0.29, delta: 0.16, epsilon: 0.29, rho: 0.35 }
    }
}

/// Numbers of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// `n`: parameter vectors.
    pub sampled_vectors: usize,
    /// `m`: trials each vector is simulated on.
    pub trials: usize,
}

impl Counts {
    /// Counts of the paper. At its levels, eq. 6 and 7 require 7.4 and 31.5.
    pub const PAPER: Self = Self { sampled_vectors: 8, trials: 50 };

    /// Returns the larger of both values for each count.
    #[must_use]
    pub fn at_least(self, other: Self) -> Self {
        Self {
            sampled_vectors: self.sampled_vectors.max(other.sampled_vectors),
            trials: self.trials.max(other.trials),
        }
    }

    /// Returns the number of simulations for one set of permitted variances.
    pub fn simulations(self) -> usize {
        self.sampled_vectors * self.trials
    }
}

/// Minimum distance of a level from 0 and 1, where the counts would be infinite.
const LEVEL_MARGIN: f64 = 1e-3;

/// Maximum value of each count.
const MAX_COUNT: f64 = 1e5;

/// Limits a level to the open interval from 0 to 1.
fn inside(level: f64) -> f64 {
    if level.is_nan() { LEVEL_MARGIN } else { level.clamp(LEVEL_MARGIN, 1.0 - LEVEL_MARGIN) }
}

impl Levels {
    /// Eq. 6: `n >= log(2/delta) / log(1/(1 - alpha))`.
    pub fn min_sampled_vectors(&self) -> f64 {
        (2.0 / inside(self.delta)).ln() / (1.0 / (1.0 - inside(self.alpha))).ln()
    }

    /// Eq. 7: `m >= ln(4n/delta) / (2 epsilon^2)`, for the `n` that is taken.
    pub fn min_trials(&self, sampled_vectors: usize) -> f64 {
        let vectors = sampled_vectors.max(1) as f64;
        (4.0 * vectors / inside(self.delta)).ln() / (2.0 * inside(self.epsilon).powi(2))
    }

    /// Returns the smallest integer counts.
    pub fn counts(&self) -> Counts {
        let whole = |least: f64| least.ceil().clamp(1.0, MAX_COUNT) as usize;
        let sampled_vectors = whole(self.min_sampled_vectors());
        Counts { sampled_vectors, trials: whole(self.min_trials(sampled_vectors)) }
    }

    /// Returns how many of `sampled_vectors` must have a violation probability of at most `rho`, so that their (1 - alpha)
    /// quantile is at most `rho`.
    pub fn required_passing_vectors(&self, sampled_vectors: usize) -> usize {
        // The offset compensates for rounding, for example of 0.95 x 100.
        let rank = ((1.0 - inside(self.alpha)) * sampled_vectors as f64 - 1e-9).ceil() as usize;
        rank.clamp(1, sampled_vectors.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_paper_levels_are_8_vectors_and_32_trials() {
        let levels = Levels::default();
        assert!((levels.min_sampled_vectors() - 7.37).abs() < 0.01);
        assert!((levels.min_trials(8) - 31.5).abs() < 0.05);
        assert_eq!(levels.counts(), Counts { sampled_vectors: 8, trials: 32 });
        assert_eq!(levels.counts().at_least(Counts::PAPER), Counts::PAPER);
    }

    #[test]
    fn simulations_of_strict_levels_are_124704() {
        let levels = Levels { alpha: 0.05, delta: 0.05, epsilon: 0.05, rho: 0.35 };
        let counts = levels.counts();
        assert_eq!(counts, Counts { sampled_vectors: 72, trials: 1732 });
        assert_eq!(counts.simulations(), 124_704);
    }

    #[test]
    fn counts_of_paper_differ() {
        assert_eq!(Counts::PAPER.simulations(), 400);
        assert_ne!(Counts::PAPER.sampled_vectors, Counts::PAPER.trials);
    }

    #[test]
    fn required_passing_vectors_is_rank_of_quantile() {
        let levels = Levels::default();
        assert_eq!(levels.required_passing_vectors(8), 6);
        assert_eq!(levels.required_passing_vectors(1), 1);
        let strict = Levels { alpha: 0.05, ..levels };
        assert_eq!(strict.required_passing_vectors(100), 95);
        assert_eq!(strict.required_passing_vectors(72), 69);
    }

    #[test]
    fn counts_with_invalid_levels_are_finite() {
        for bad in [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY] {
            let levels = Levels { alpha: bad, delta: bad, epsilon: bad, rho: bad };
            let Counts { sampled_vectors, trials } = levels.counts();
            assert!(sampled_vectors >= 1 && trials >= 1);
            assert!(sampled_vectors <= 100_000 && trials <= 100_000);
        }
    }
}
