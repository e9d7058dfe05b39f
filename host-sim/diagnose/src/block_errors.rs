//! Held-out errors of a fitted model, to first order and without refitting.
//!
//! The residual and its derivatives are evaluated at the optimum, block by block. To first order,
//! they predict the optimum without some of the blocks, and the error on these blocks
//! ([`super::gram_blocks`]). A step that the fit has not taken does not count as an improvement.
//!
//! One simulation with derivatives gives the error on every held-out row. Two models are compared
//! block by block. Reported errors come from refits ([`super::left_out`]). All errors are sums of
//! squares in Nm^2.

use super::cause::Cause;
use super::error_reduction::ErrorReduction;
use super::gram_blocks::{GramBlocks, LeftOut};
use super::model::FittedModel;
use super::sensitivities::sensitivities;
use super::survey::survey;
use super::train_test::TrainTest;

/// Squared errors of a model on held-out rows, Nm^2.
#[derive(Clone, Debug)]
pub struct BlockErrors {
    /// By block, with one stretch of each run held out at a time.
    pub stretches: Vec<f64>,
    /// By group of runs, with whole runs held out; `None` for fewer than three groups.
    pub runs: Option<Vec<f64>>,
}

/// Error reduction of one model relative to another.
#[derive(Clone, Copy, Debug)]
pub struct Improvement {
    /// Reduction on held-out stretches: shows whether the model describes.
    pub describes: ErrorReduction,
    /// Reduction on held-out runs: shows whether the model extrapolates. `None` for fewer than
    /// three groups.
    pub extrapolates: Option<ErrorReduction>,
}

impl Improvement {
    /// Returns the improvement with the block weighting that the cause allows.
    ///
    /// A cause that is confounded with model error keeps the plain sum. Model error occurs in every
    /// block, so block weights would make it significant.
    #[must_use]
    pub fn weighted_for(self, cause: &dyn Cause) -> Self {
        if cause.is_confounded_with_model_error() {
            return self;
        }
        Self {
            describes: self.describes.block_weighted_error(),
            extrapolates: self.extrapolates.map(ErrorReduction::block_weighted_error),
        }
    }
}

impl BlockErrors {
    /// Returns the errors of the base model, from its Gram blocks.
    pub fn of(gram: &GramBlocks) -> Self {
        let runs = || gram.per_group(&gram.model_unseen(LeftOut::Runs));
        Self {
            stretches: gram.model_unseen(LeftOut::Stretches),
            runs: (gram.groups() >= 3).then(runs),
        }
    }

    /// Returns the errors of a fitted model, in blocks of `length` rows.
    pub fn of_model(log: &TrainTest, model: &FittedModel, length: usize) -> Self {
        let log = &*log.following(model.follows.as_ref());
        let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        Self::of(&survey(log, &at, &[], &[], length))
    }

    /// Returns the sum of the squared errors on held-out stretches over all blocks, Nm^2.
    pub fn sse(&self) -> f64 {
        self.stretches.iter().sum()
    }

    /// Returns the improvement over another model on the same blocks.
    pub fn better_than(&self, other: &Self) -> Improvement {
        let runs = self.runs.as_ref().zip(other.runs.as_ref());
        Improvement {
            describes: ErrorReduction::between(&other.stretches, &self.stretches),
            extrapolates: runs.map(|(own, other)| ErrorReduction::between(other, own)),
        }
    }
}
