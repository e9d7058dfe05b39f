//! Two hypotheses on the blocks that their fits have not seen.

use super::blocks::Blocks;
use super::regression::Fit;

/// Least share of an error that a logarithm tells from none.
const LEAST_SHARE: f64 = 1e-4;

/// Two hypotheses on held-out blocks.
pub(super) struct HeldOut {
    /// Reduction of the error, in standard errors over the blocks.
    pub errors: f64,
    /// Share of the squared error that is taken.
    pub share: f64,
    /// RMS of what remains.
    pub rest: f64,
}

impl HeldOut {
    /// Compares fits without each fold. Block `n` is in the fold `n` modulo the number of folds.
    pub fn new(blocks: &Blocks, without: &[Fit], with: &[Fit]) -> Self {
        let error =
            |at: usize, of: &[Fit]| blocks.squared_error(at, &of[at % of.len()].coefficients);
        let pairs: Vec<(f64, f64)> =
            (0..blocks.grams.len()).map(|at| (error(at, without), error(at, with))).collect();
        // Relative to the block's own error, because blocks of fast motion have much larger ones.
        let reduction = |(a, b): &(f64, f64)| (a - b) / (a + b).max(f64::MIN_POSITIVE);
        let sums = pairs.iter().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0, sum.1 + pair.1));
        Self {
            errors: in_standard_errors(&pairs.iter().map(reduction).collect::<Vec<_>>()),
            share: 1.0 - sums.1 / f64::max(sums.0, f64::MIN_POSITIVE),
            rest: (sums.1 / blocks.rows.max(1.0)).sqrt(),
        }
    }

    /// Returns the logarithms of the reduction in standard errors and of its share.
    pub fn figures(&self) -> [f64; 2] {
        [self.errors.clamp(0.1, 100.0).ln(), self.share.max(LEAST_SHARE).ln()]
    }
}

/// Returns the mean of values in its standard errors, as for independent values.
fn in_standard_errors(values: &[f64]) -> f64 {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    mean / (variance / count).sqrt().max(f64::MIN_POSITIVE)
}
