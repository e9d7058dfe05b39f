//! How well blocks of rows agree by chance.

use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// What each block says of a candidate.
pub struct BlockScores {
    /// Per block.
    pub blocks: Vec<DVector<f64>>,
    /// What of the candidate's columns the base has.
    pub shared: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

impl BlockScores {
    /// Puts the blocks' scores together.
    pub fn new(blocks: Vec<DVector<f64>>, shared: DMatrix<f64>) -> Self {
        let k = blocks.first().map_or(0, DVector::len);
        let variance: DMatrix<f64> =
            blocks.iter().fold(DMatrix::zeros(k, k), |sum, score| sum + score * score.transpose());
        let largest = variance.diagonal().max().max(f64::MIN_POSITIVE);
        let ridged = variance + DMatrix::identity(k, k) * (1e-9 * largest);
        let inverse = Cholesky::new(ridged).map_or(DMatrix::zeros(k, k), |c| c.inverse());
        Self { blocks, shared, inverse }
    }

    /// Number of coefficients.
    pub fn width(&self) -> usize {
        self.inverse.nrows()
    }

    /// `u' V^-1 u`, with the signs of the blocks changed where given.
    pub fn agreement(&self, signs: Option<&[f64]>) -> f64 {
        let k = self.width();
        let mut sum: DVector<f64> = DVector::zeros(k);
        for (index, score) in self.blocks.iter().enumerate() {
            sum.axpy(signs.map_or(1.0, |signs| signs[index]), score, 1.0);
        }
        sum.dot(&(&self.inverse * &sum))
    }
}

/// Probability of an agreement of `blocks` blocks on `width` coefficients: Hotelling's test.
pub fn probability(agreement: f64, width: usize, blocks: usize) -> f64 {
    let (n, k) = (blocks as f64, width as f64);
    if n < k + 3.0 {
        return 1.0;
    }
    // V has the mean in it: an agreement of all blocks is n, and the variance about the mean 0.
    let about_mean = (n - 1.0) * agreement / (n - agreement).max(1e-9 * n);
    let ratio = about_mean * (n - k) / (k * (n - 1.0));
    FisherSnedecor::new(k, n - k).map_or(1.0, |f| f.sf(ratio.max(0.0)))
}

/// How small the smallest probability of a family gets where nothing is hidden: a Gumbel
/// distribution fitted to what the flipped logs gave.
pub struct Chance {
    location: f64,
    scale: f64,
}

impl Chance {
    /// From the largest `-ln p` of each flipped log.
    pub fn of_largest(largest: &[f64]) -> Self {
        const EULER: f64 = 0.577_215_664_901_532_9;
        let n = largest.len().max(1) as f64;
        let mean = largest.iter().sum::<f64>() / n;
        let variance = largest.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        let scale = (variance.sqrt() * 6f64.sqrt() / std::f64::consts::PI).max(0.5);
        Self { location: mean - EULER * scale, scale }
    }

    /// Probability that the best of all candidates reaches `p_alone` where nothing is hidden.
    pub fn of(&self, p_alone: f64) -> f64 {
        let reached = -p_alone.max(f64::MIN_POSITIVE).ln();
        let rate = (-(reached - self.location) / self.scale).exp();
        -(-rate).exp_m1()
    }
}
