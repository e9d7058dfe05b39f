//! A finding: the cause, how large it is, how sure that is, and one sentence for a person.

use super::cause::definition::Cause;
use super::evidence::Evidence;
use super::extended::{Observation, Size};

/// Another cause that would explain what a finding explains.
#[derive(Clone, Debug)]
pub struct Rival {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns of the log it follows.
    pub columns: Vec<String>,
    /// Share of the finding's effect it can take over.
    pub share: f64,
}

/// One cause of what the model gets wrong.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns of the log it follows.
    pub columns: Vec<String>,
    /// How large it is.
    pub size: Size,
    /// Of a periodic cause, its order with a standard error.
    pub order: Option<(f64, f64)>,
    /// Probability that the best of all causes looks so good where nothing is hidden.
    pub p_value: f64,
    /// Share of resampled logs in which it is the best of all.
    pub stability: f64,
    /// Share of the squared residual that goes when it comes, and that nothing else takes.
    pub share_of_residual: f64,
    /// Causes that would explain the same.
    pub confusable_with: Vec<Rival>,
    /// One sentence.
    pub in_words: String,
    /// Where it shows.
    pub evidence: Option<Evidence>,
}

impl Finding {
    /// Of a cause that is found without a fit of its own.
    pub fn observed(cause: &'static dyn Cause, seen: Observation) -> Self {
        Self {
            cause,
            columns: seen.columns,
            size: seen.size,
            order: None,
            p_value: seen.p_value,
            stability: seen.stability,
            share_of_residual: seen.share_of_residual,
            confusable_with: Vec::new(),
            in_words: seen.in_words,
            evidence: seen.evidence,
        }
    }
}
