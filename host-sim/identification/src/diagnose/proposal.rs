//! The proposed extension: it must reduce the error on held-out rows, or it is withdrawn.
//!
//! The search judged models to first order beside one fit. Here base and extension are fitted anew, every run
//! left out once ([`super::left_out`]), or judged on the runs that were set apart. An extension that does not gain so
//! loses its weakest cause, and what is left is judged again, until it gains or there is nothing left.

use super::accepted_cause::AcceptedCause;
use super::cause::CauseIdentity;
use super::evaluation::{Gain, gain};
use super::gram_blocks::LeftOut;
use super::left_out::{goes_beyond, predict_left_out, unit};
use super::model::FittedModel;
use super::round::material;
use super::search::{Extension, Search};
use super::train_test::TrainTest;
use crate::fit::{Outcome, Predicted};
use crate::spec::SpecError;

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
    /// Reasons, one sentence each.
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
    let (mut taken_back, mut notes) = (Vec::new(), Vec::new());
    if log.leaves_each_out && goes_beyond(log) {
        let why = "one run is much faster than all others, which do not cover its speeds: a stretch of each run is left out \
                   instead of whole runs";
        notes.push(why.to_owned());
    }
    let (left_out, before, after, gain, extended) = loop {
        let describes = extension.found.iter().any(|found| found.only_describes);
        let way = if describes { LeftOut::Stretches } else { unit(log) };
        let left_out = log.leaves_each_out.then_some(way);
        let judged = |model: &FittedModel| match left_out {
            Some(way) => predict_left_out(log, model, way),
            None => model.on_test(log),
        };
        let before = given.clone().unwrap_or_else(|| judged(search.base));
        let Some(weakest) = extension.found.len().checked_sub(1) else {
            break (left_out, before.clone(), before, Gain::default(), None);
        };
        let after = judged(&extension.model);
        let gain = gain(&before, &after, search.seed);
        if let Some(why) = gains_too_little(log, &extension.found, &before, &gain) {
            let name = extension.found[weakest].cause.name();
            notes.push(format!(
                "{name} passed with the base model, but after a new fit it {why} on held-out rows ({:.1} %, 95 % interval \
                 {:.1} to {:.1} %): it is not proposed",
                100.0 * gain.value,
                100.0 * gain.ci95[0],
                100.0 * gain.ci95[1]
            ));
            take_back(search, &mut extension, weakest, &mut taken_back)?;
            continue;
        }
        let follows = extension.model.follows.as_ref().filter(|follows| follows.extra);
        let outcome = super::outcome(&log.following(follows), &extension.model)?;
        let places = (0..extension.found.len()).rev();
        let at_bound = |place: usize| Some((place, extension.found[place].at_bound(&outcome)?));
        let Some((place, parameter)) = places.into_iter().find_map(at_bound) else {
            break (left_out, before, after, gain, Some(outcome));
        };
        let name = extension.found[place].cause.name();
        notes.push(format!(
            "{name} passed with the base model, but in the fit to all rows {parameter} is at its bound: it is not proposed"
        ));
        take_back(search, &mut extension, place, &mut taken_back)?;
    };
    Ok(Proposal { extension, extended, before, after, gain, left_out, taken_back, notes })
}

/// Whether an extension fitted anew gains nothing for sure, or less than its causes had to take to enter; the middle of a sentence.
fn gains_too_little(
    log: &TrainTest,
    found: &[AcceptedCause],
    before: &Predicted,
    gain: &Gain,
) -> Option<&'static str> {
    if gain.ci95[0] <= 0.0 {
        return Some("does not reduce the error");
    }
    let beyond = log.share_beyond_floor(before.metrics.rmse.powi(2));
    let least = found.iter().map(|found| material(found.cause, beyond));
    let least = least.fold(f64::INFINITY, f64::min);
    let taken = 1.0 - (1.0 - gain.value).powi(2);
    (taken < least * beyond).then_some("reduces the error by a negligible amount")
}

/// Takes a cause out of an extension.
fn take_back(
    search: &Search,
    extension: &mut Extension,
    index: usize,
    taken_back: &mut Vec<CauseIdentity>,
) -> Result<(), SpecError> {
    extension.model = extension.without(search, index)?;
    let gone = extension.found.remove(index);
    taken_back.push(CauseIdentity::new(gone.cause, gone.follows.as_ref()));
    Ok(())
}
