//! What the search and the review ask of a model with a cause: by how much it is better, and whether a parameter is at its bound.

use super::block_errors::{BlockErrors, Improvement};
use super::cause::{Cause, CauseCandidate};
use super::error_reduction::ErrorReduction;
use super::model::FittedModel;
use super::round::Round;
use super::search::Search;
use compensator_core::ParameterId;

/// A parameter of the candidate's term that the fit drove to its bound: there the term stands in for something
/// else.
pub fn at_bound(fitted: &FittedModel, candidate: &CauseCandidate) -> Option<ParameterId> {
    /// Distance from a bound within which a value counts as at the bound, as a share of the bound.
    const BOUND_TOLERANCE: f64 = 0.01;
    let near = |value: f64, bound: f64| {
        bound != 0.0 && bound.abs() < 1e6 && (value - bound).abs() <= BOUND_TOLERANCE * bound.abs()
    };
    let own = candidate.term.parameters().iter().copied();
    own.filter(|id| fitted.free.contains(id)).find(|id| {
        let (info, value) = (id.info(), fitted.parameters.get(*id));
        near(value, info.lower) || near(value, info.upper)
    })
}

/// By how much a model is better than without one of its causes.
pub fn better(
    search: &Search,
    model: &FittedModel,
    rest: &Round,
    cause: &dyn Cause,
) -> Improvement {
    let standing = BlockErrors::of_model(search.log, model, rest.length);
    standing.better_than(&rest.block_errors).weighted_for(cause)
}

/// A fall as a share of another model's squared error on the same unseen rows.
pub fn share(fall: &ErrorReduction, of: &BlockErrors) -> f64 {
    (fall.value / of.sse().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0)
}
