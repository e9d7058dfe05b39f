//! What a search for causes works on, and what it has come to so far.

use super::found::Found;
use super::model::{Fits, Fitted, without};
use super::train_test::TrainTest;
use crate::spec::SpecError;

/// What stays the same in a search.
#[derive(Clone, Copy)]
pub struct Search<'a> {
    /// The log.
    pub log: &'a TrainTest,
    /// What was fitted on it.
    pub fits: &'a Fits<'a>,
    /// The base law fitted.
    pub base: &'a Fitted,
    /// For what is drawn at random.
    pub seed: u64,
    /// Told what is being done.
    pub progress: &'a dyn Fn(&str),
}

/// The base law with the causes found so far.
#[derive(Clone, Debug)]
pub struct Extension {
    /// The model.
    pub model: Fitted,
    /// The causes in it.
    pub found: Vec<Found>,
}

impl Extension {
    /// The model without one of the causes, everything else fitted again.
    ///
    /// # Errors
    /// If there are more terms than the core takes.
    pub fn without(&self, search: &Search, index: usize) -> Result<Fitted, SpecError> {
        if self.found.len() == 1 {
            return Ok(search.base.clone());
        }
        let gone = &self.found[index];
        let follows = self.model.follows.as_ref().filter(|_| gone.follows.is_none());
        without(search.fits, &self.model, gone.term, follows)
    }
}
