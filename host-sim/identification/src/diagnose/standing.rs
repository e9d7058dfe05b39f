//! How a fitted model stands on rows it has not seen, without fitting it again.
//!
//! At its optimum a model's residual and derivatives, block by block, say to first order where the optimum
//! would lie without some of the blocks, and so how wrong it would be there ([`super::gram_blocks`]); a step that
//! a fit has not taken is not credited to it. One
//! simulation with derivatives gives the error on every row left out; two models are compared block by
//! block. What is reported in the end is fitted anew ([`super::left_out`]).

use super::cause::Cause;
use super::fall::Fall;
use super::gram_blocks::{GramBlocks, LeftOut};
use super::model::Fitted;
use super::sensitivities::sensitivities;
use super::survey::survey;
use super::train_test::TrainTest;

/// Squared error on unseen rows.
#[derive(Clone, Debug)]
pub struct Standing {
    /// By blocks, a stretch of each run left out at a time.
    pub stretches: Vec<f64>,
    /// By runs, whole runs left out; none where there are fewer than three.
    pub runs: Option<Vec<f64>>,
}

/// By how much one model is better than another.
#[derive(Clone, Copy, Debug)]
pub struct Better {
    /// On stretches left out: it describes.
    pub describes: Fall,
    /// On runs left out: it extrapolates.
    pub extrapolates: Option<Fall>,
}

impl Better {
    /// Weighed as a cause may be: what a wrong law's error has the shape of as well is in every block, and must show in the
    /// plain sum.
    #[must_use]
    pub fn by_way_of(self, cause: &dyn Cause) -> Self {
        if cause.is_imitated() {
            return self;
        }
        Self { describes: self.describes.surer(), extrapolates: self.extrapolates.map(Fall::surer) }
    }
}

impl Standing {
    /// Of what a log's products have as their base.
    pub fn of(gram: &GramBlocks) -> Self {
        let runs = || gram.per_group(&gram.model_unseen(LeftOut::Runs));
        Self {
            stretches: gram.model_unseen(LeftOut::Stretches),
            runs: (gram.groups() >= 3).then(runs),
        }
    }

    /// Of a fitted model, in blocks of `length` rows.
    pub fn of_model(log: &TrainTest, model: &Fitted, length: usize) -> Self {
        let log = &*log.following(model.follows.as_ref());
        let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        Self::of(&survey(log, &at, &[], &[], length))
    }

    /// The squared error of all blocks.
    pub fn sse(&self) -> f64 {
        self.stretches.iter().sum()
    }

    /// By how much this is better than another one on the same blocks.
    pub fn better_than(&self, other: &Self) -> Better {
        let runs = self.runs.as_ref().zip(other.runs.as_ref());
        Better {
            describes: Fall::between(&other.stretches, &self.stretches),
            extrapolates: runs.map(|(own, other)| Fall::between(other, own)),
        }
    }
}
