//! Confidence, accuracy, and how many samples they take (Ding et al., eq. 6-7).
//!
//! Four counts are easily mixed up and are kept apart here: `n` sampled *parameter vectors* and `m`
//! *trials* ([`Counts`]); the paper's 8 *kinds* of experiment and its 50 *repeats* of each ([`Campaign`]).
//! That `m` was chosen to be 50 as well is a coincidence of the paper's, not an equation.

/// What a certificate is to hold for.
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
    /// The paper's.
    fn default() -> Self {
        Self { alpha: 0.29, delta: 0.16, epsilon: 0.29, rho: 0.35 }
    }
}

/// How much is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counts {
    /// `n`: parameter vectors.
    pub sampled_vectors: usize,
    /// `m`: trials each vector is simulated on.
    pub trials: usize,
}

impl Counts {
    /// What the paper took at its levels, where eq. 6 and 7 ask for 7.4 and 31.5.
    pub const PAPER: Self = Self { sampled_vectors: 8, trials: 50 };

    /// Each count at least as in `other`.
    #[must_use]
    pub fn at_least(self, other: Self) -> Self {
        Self {
            sampled_vectors: self.sampled_vectors.max(other.sampled_vectors),
            trials: self.trials.max(other.trials),
        }
    }

    /// Simulations one set of permitted variances takes.
    pub fn simulations(self) -> usize {
        self.sampled_vectors * self.trials
    }
}

/// What was measured in the paper (Table II): neither count follows from the levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Campaign {
    /// Kinds of experiment: combinations of speed, side load and pressure.
    pub kinds: usize,
    /// Repeats of each.
    pub repeats: usize,
}

impl Campaign {
    /// The paper's 400 runs.
    pub const PAPER: Self = Self { kinds: 8, repeats: 50 };

    /// Runs in all.
    pub fn runs(self) -> usize {
        self.kinds * self.repeats
    }
}

/// Levels are kept this far from 0 and 1, where the counts would be infinite.
const EDGE: f64 = 1e-3;

/// No certificate takes more of either.
const MOST: f64 = 1e5;

fn inside(level: f64) -> f64 {
    if level.is_nan() { EDGE } else { level.clamp(EDGE, 1.0 - EDGE) }
}

impl Levels {
    /// Eq. 6: `n >= log(2/delta) / log(1/(1 - alpha))`.
    pub fn least_sampled_vectors(&self) -> f64 {
        (2.0 / inside(self.delta)).ln() / (1.0 / (1.0 - inside(self.alpha))).ln()
    }

    /// Eq. 7: `m >= ln(4n/delta) / (2 epsilon^2)`, for the `n` that is taken.
    pub fn least_trials(&self, sampled_vectors: usize) -> f64 {
        let vectors = sampled_vectors.max(1) as f64;
        (4.0 * vectors / inside(self.delta)).ln() / (2.0 * inside(self.epsilon).powi(2))
    }

    /// The least whole counts.
    pub fn counts(&self) -> Counts {
        let whole = |least: f64| least.ceil().clamp(1.0, MOST) as usize;
        let sampled_vectors = whole(self.least_sampled_vectors());
        Counts { sampled_vectors, trials: whole(self.least_trials(sampled_vectors)) }
    }

    /// How many of `sampled_vectors` must violate no more than `rho` for their (1 - alpha) quantile
    /// to be within it.
    pub fn vectors_that_must_pass(&self, sampled_vectors: usize) -> usize {
        // A hair off, so that 0.95 x 100 is not 95.00000000000001.
        let rank = ((1.0 - inside(self.alpha)) * sampled_vectors as f64 - 1e-9).ceil() as usize;
        rank.clamp(1, sampled_vectors.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_levels_ask_for_7_4_vectors_and_31_5_trials() {
        let levels = Levels::default();
        assert!((levels.least_sampled_vectors() - 7.37).abs() < 0.01);
        assert!((levels.least_trials(8) - 31.5).abs() < 0.05);
        assert_eq!(levels.counts(), Counts { sampled_vectors: 8, trials: 32 });
        assert_eq!(levels.counts().at_least(Counts::PAPER), Counts::PAPER);
    }

    #[test]
    fn strict_levels_ask_for_124704_simulations() {
        let levels = Levels { alpha: 0.05, delta: 0.05, epsilon: 0.05, rho: 0.35 };
        let counts = levels.counts();
        assert_eq!(counts, Counts { sampled_vectors: 72, trials: 1732 });
        assert_eq!(counts.simulations(), 124_704);
    }

    #[test]
    fn four_counts_are_apart() {
        assert_eq!(Counts::PAPER.simulations(), 400);
        assert_eq!(Campaign::PAPER.runs(), 400);
        assert_ne!(Counts::PAPER.sampled_vectors, Counts::PAPER.trials);
    }

    #[test]
    fn a_quantile_is_a_rank() {
        let levels = Levels::default();
        assert_eq!(levels.vectors_that_must_pass(8), 6);
        assert_eq!(levels.vectors_that_must_pass(1), 1);
        let strict = Levels { alpha: 0.05, ..levels };
        assert_eq!(strict.vectors_that_must_pass(100), 95);
        assert_eq!(strict.vectors_that_must_pass(72), 69);
    }

    #[test]
    fn levels_at_the_edge_give_counts_all_the_same() {
        for bad in [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY] {
            let levels = Levels { alpha: bad, delta: bad, epsilon: bad, rho: bad };
            let Counts { sampled_vectors, trials } = levels.counts();
            assert!(sampled_vectors >= 1 && trials >= 1);
            assert!(sampled_vectors <= 100_000 && trials <= 100_000);
        }
    }
}
