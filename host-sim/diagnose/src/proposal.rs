//! The proposed extension: it must reduce the error on held-out rows, or it is withdrawn.
//!
//! The search judged models to first order beside one fit. Here base and extension are fitted anew, every run
//! left out once ([`super::left_out`]), or judged on the runs that were set apart. An extension that does not gain so
//! loses its weakest cause, and what is left is judged again, until it gains or there is nothing left.

use super::cause::CauseIdentity;
use super::evaluation::{Gain, gain};
use super::gram_blocks::LeftOut;
use super::left_out::{goes_beyond, predict_left_out, unit};
use super::model::FittedModel;
use super::rules::{self, Rejection, RuleDecision};
use super::search::{Extension, Search};
use super::train_test::TrainTest;
use friction_fit::spec::SpecError;
use friction_fit::{Outcome, Predicted};

/// An extension with a significant gain.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// The model and its causes; without causes if none has a gain.
    pub extension: Extension,
    /// The extended model, fitted to the whole log; `None` if no extension is proposed.
    pub extended: Option<Outcome>,
    /// The base model on held-out rows.
    pub before: Predicted,
    /// The extended one.
    pub after: Predicted,
    /// The gain.
    pub gain: Gain,
    /// What was left out at a time, where nothing is set apart.
    pub left_out: Option<LeftOut>,
    /// Withdrawn causes.
    pub taken_back: Vec<CauseIdentity>,
    /// The rules that withdrew them.
    pub decisions: Vec<RuleDecision>,
    /// Notes on the evaluation, one sentence each.
    pub notes: Vec<String>,
}

/// Evaluates an extension on the whole log and withdraws causes without a gain.
///
/// `given` is what the base makes of the rows to judge by, where it is not to be fitted.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn propose(
    search: &Search,
    log: &TrainTest,
    mut extension: Extension,
    given: Option<Predicted>,
) -> Result<Proposal, SpecError> {
    let (mut taken_back, mut decisions, mut notes) = (Vec::new(), Vec::new(), Vec::new());
    if log.leaves_each_out && goes_beyond(log) {
        let why = "one run is much faster than all others, which do not cover its speeds: a stretch of each run is left out \
                   instead of whole runs";
        notes.push(why.to_owned());
    }
    let (left_out, before, after, gain, extended) = loop {
        let describes = extension.found.iter().any(|found| found.only_describes);
        let way = if describes { LeftOut::Stretches } else { unit(log) };
        let is_judged = log.leaves_each_out && !search.only_weighs;
        let left_out = is_judged.then_some(way);
        let judged = |model: &FittedModel| match left_out {
            Some(way) => predict_left_out(log, model, way),
            None => model.on_test(log),
        };
        let before = given.clone().unwrap_or_else(|| judged(search.base));
        if extension.found.is_empty() {
            break (left_out, before.clone(), before, Gain::default(), None);
        }
        // An impossible value is seen without the fits to parts of the log.
        let follows = extension.model.follows.as_ref().filter(|follows| follows.extra);
        let outcome = super::outcome(&log.following(follows), &extension.model)?;
        let places = (0..extension.found.len()).rev();
        let rejected =
            |place: usize| Some((place, extension.found[place].rejection(&outcome, log)?));
        let (place, rejection) = if let Some(rejected) = places.into_iter().find_map(rejected) {
            rejected
        } else {
            let after = judged(&extension.model);
            let gain = gain(&before, &after, search.seed);
            let Some(rejection) = gains_too_little(log, &before, &gain) else {
                break (left_out, before, after, gain, Some(outcome));
            };
            (extension.found.len() - 1, rejection)
        };
        let gone = &extension.found[place];
        decisions.push(RuleDecision {
            cause: gone.cause,
            columns: gone.columns.clone(),
            rejection,
        });
        taken_back.push(CauseIdentity::new(gone.cause, gone.follows.as_ref()));
        extension.model = extension.without(search, place)?;
        extension.found.remove(place);
    };
    Ok(Proposal {
        extension,
        extended,
        before,
        after,
        gain,
        left_out,
        taken_back,
        decisions,
        notes,
    })
}

/// Returns the rejection of an extension that has no significant gain after a new fit, or a negligible one.
fn gains_too_little(log: &TrainTest, before: &Predicted, gain: &Gain) -> Option<Rejection> {
    let [low, high] = gain.ci95.map(|end| 100.0 * end);
    let value = 100.0 * gain.value;
    if gain.ci95[0] <= rules::NO_GAIN.limit {
        let why = format!(
            "after a new fit, its gain on held-out rows is {value:.1} % (95 % interval {low:.1} to {high:.1} %)"
        );
        return Some(Rejection::new(&rules::NO_GAIN, why));
    }
    let beyond = log.share_beyond_floor(before.metrics.rmse.powi(2));
    let taken = 1.0 - (1.0 - gain.value).powi(2);
    (taken < rules::NEGLIGIBLE.limit * beyond).then(|| {
        let why = format!("after a new fit, its gain on held-out rows is negligible, {value:.1} %");
        Rejection::new(&rules::NEGLIGIBLE, why)
    })
}

#[cfg(test)]
mod tests;
