//! Inputs of a search for causes, and the extension that it has found so far.

use super::accepted_cause::AcceptedCause;
use super::model::{FitCache, FittedModel, without};
use super::train_test::TrainTest;
use friction_fit::spec::SpecError;

/// Inputs that stay constant during a search.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// The log.
    pub log: &'a TrainTest,
    /// Fits on this log.
    pub fits: &'a FitCache<'a>,
    /// The fitted base law.
    pub base: &'a FittedModel,
    /// Probability at and above which a cause is named.
    pub naming_threshold: f64,
    /// If true, evidence is weighed for the calibration, and no extension is proposed.
    pub only_weighs: bool,
    /// Seed of the random sampler.
    pub seed: u64,
    /// Receives a description of each step of the work.
    pub progress: &'a dyn Fn(&str),
}

/// The base law with the causes accepted so far.
#[derive(Clone, Debug)]
pub struct Extension {
    /// The extended model.
    pub model: FittedModel,
    /// Causes in the model.
    pub found: Vec<AcceptedCause>,
}

impl Extension {
    /// Returns the model without one of the causes and all other parameters refitted.
    ///
    /// # Errors
    /// Returns an error if there are more terms than the core accepts.
    pub fn without(&self, search: &Search, index: usize) -> Result<FittedModel, SpecError> {
        if self.found.len() == 1 {
            return Ok(search.base.clone());
        }
        let gone = &self.found[index];
        let follows = self.model.follows.as_ref().filter(|_| gone.follows.is_none());
        without(search.fits, &self.model, gone.term, follows)
    }
}
