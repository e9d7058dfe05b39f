//! What is handed out: shown to gain on rows its fit has not seen, or taken back.
//!
//! The search judged models to first order beside one fit. Here base and extension are fitted anew, every run
//! left out once ([`super::left_out`]), or judged on the runs that were set apart. An extension that does not gain so
//! loses its weakest cause, and what is left is judged again, until it gains or there is nothing left.

use super::cause::Claim;
use super::found::Found;
use super::gram_blocks::LeftOut;
use super::judge::{Gain, gain};
use super::left_out::{goes_beyond, predict_left_out, unit};
use super::model::Fitted;
use super::round::material;
use super::search::{Extension, Search};
use super::train_test::TrainTest;
use crate::fit::{Outcome, Predicted};
use crate::spec::SpecError;

/// An extension that gains, with what it gains.
#[derive(Clone, Debug)]
pub struct Offer {
    /// The model and its causes; none where nothing gains.
    pub extension: Extension,
    /// The extended model fitted to the end on the whole log; none where nothing is offered.
    pub extended: Option<Outcome>,
    /// The base model on rows it has not seen.
    pub before: Predicted,
    /// The extended one.
    pub after: Predicted,
    /// The gain.
    pub gain: Gain,
    /// What was left out at a time, where nothing is set apart.
    pub left_out: Option<LeftOut>,
    /// What was taken back.
    pub taken_back: Vec<Claim>,
    /// Why, a sentence each.
    pub notes: Vec<String>,
}

/// Judges an extension on the whole log and takes back what does not gain.
///
/// `given` is what the base makes of the rows to judge by, where it is not to be fitted.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn offer(
    search: &Search,
    log: &TrainTest,
    mut extension: Extension,
    given: Option<Predicted>,
) -> Result<Offer, SpecError> {
    let (mut taken_back, mut notes) = (Vec::new(), Vec::new());
    if log.leaves_each_out && goes_beyond(log) {
        let why = "one run is far faster than all others, which cannot tell what the joint does there: a stretch of each run is \
                   left out instead of whole runs";
        notes.push(why.to_owned());
    }
    let (left_out, before, after, gain, extended) = loop {
        let describes = extension.found.iter().any(|found| found.only_describes);
        let way = if describes { LeftOut::Stretches } else { unit(log) };
        let left_out = log.leaves_each_out.then_some(way);
        let judged = |model: &Fitted| match left_out {
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
                "{name} passed beside the base model, but fitted anew it {why} on rows left out ({:.1} %, 95 % interval \
                 {:.1} to {:.1} %): it is not offered",
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
            "{name} passed beside the base model, but with all rows {parameter} ends at its bound: it is not offered"
        ));
        take_back(search, &mut extension, place, &mut taken_back)?;
    };
    Ok(Offer { extension, extended, before, after, gain, left_out, taken_back, notes })
}

/// Whether an extension fitted anew gains nothing for sure, or less than its causes had to take to enter; the middle of a sentence.
fn gains_too_little(
    log: &TrainTest,
    found: &[Found],
    before: &Predicted,
    gain: &Gain,
) -> Option<&'static str> {
    if gain.ci95[0] <= 0.0 {
        return Some("does not gain");
    }
    let beyond = log.share_beyond_floor(before.metrics.rmse.powi(2));
    let least = found.iter().map(|found| material(found.cause, beyond));
    let least = least.fold(f64::INFINITY, f64::min);
    let taken = 1.0 - (1.0 - gain.value).powi(2);
    (taken < least * beyond).then_some("gains a trifle")
}

/// Takes a cause out of an extension.
fn take_back(
    search: &Search,
    extension: &mut Extension,
    index: usize,
    taken_back: &mut Vec<Claim>,
) -> Result<(), SpecError> {
    extension.model = extension.without(search, index)?;
    let gone = extension.found.remove(index);
    taken_back.push(Claim::new(gone.cause, gone.follows.as_ref()));
    Ok(())
}
