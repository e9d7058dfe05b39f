//! Which causes, one after the other.
//!
//! Each round asks all candidates at once ([`super::survey`]) and lets those that pass be fitted with
//! everything else by the core's own simulation; the one that explains most stays. Then the next round
//! looks at what is left. What only correlated with a cause that was not yet in falls when it is:
//! in the end every finding is taken out once and has to win its place again, against all others.
//!
//! A candidate passes if its blocks agree better than chance lets the best of all candidates agree
//! ([`super::gram_blocks`]), it lowers the error on rows left out of the fit, and by a share that matters.

use super::cause::{Cause, Claim, Suspect};
use super::found::Found;
use super::gram_blocks::CandidateFit;
use super::judge::{noise_floor, paired};
use super::model::{Fitted, with_candidate};
use super::review::{MATERIAL_BESIDE, review};
use super::round::{CandidateScore, MATERIAL, Round};
use super::search::{Extension, Search};
use crate::spec::SpecError;

/// Most causes that are sought.
const MOST_FINDINGS: usize = 5;

/// Most candidates of a round that are fitted.
const MOST_FITTED: usize = 6;

/// Share of the squared residual beyond the noise above which causes the linear fit may underrate are
/// fitted too: where a cause bends the base model's own parameters, its column at size 0 says little.
const STRUCTURE: f64 = 0.15;

/// Unless one that passed explains this share of what is beyond the noise.
const EXPLAINS: f64 = 0.5;

/// What such a fit must take off the squared residual, and by how many standard errors of blocks.
const SECOND_CHANCE: f64 = 0.05;
const CLEARLY: f64 = 3.0;

/// How often the search goes on after the review has taken out what does not hold.
const SEARCHES: usize = 3;

/// The result of the search.
#[derive(Clone, Debug)]
pub struct Selection {
    /// The extended model.
    pub extended: Fitted,
    /// The causes, strongest first.
    pub found: Vec<Found>,
    /// All candidates beside the base law, best first.
    pub scores: Vec<CandidateScore>,
}

/// Searches for causes beside a base law.
///
/// # Errors
/// If the base already has as many terms as the core takes.
pub fn select(search: &Search) -> Result<Selection, SpecError> {
    let mut extension = Extension { model: search.base.clone(), found: Vec::new() };
    let mut scores = Vec::new();
    let mut refuted: Vec<Claim> = Vec::new();
    // Named causes have their say first; a curve of any shape may then have what is left, and shows in
    // the review which of them only stood in for it.
    for allow_any_shape in [false, true] {
        for _ in 0..SEARCHES {
            let before = extension.found.len();
            let admitted = Admitted { refuted: &refuted, allow_any_shape };
            extend(search, &admitted, &mut extension, &mut scores)?;
            if extension.found.len() == before {
                break;
            }
            let lost = review(search, &mut extension)?;
            if lost.is_empty() {
                break;
            }
            refuted.extend(lost);
        }
    }
    Ok(Selection { extended: extension.model, found: extension.found, scores })
}

/// Which candidates a round considers.
struct Admitted<'a> {
    /// Not these: a review has taken them out.
    refuted: &'a [Claim],
    /// Curves of any shape.
    allow_any_shape: bool,
}

impl Admitted<'_> {
    fn has(&self, candidate: &Suspect) -> bool {
        let refuted = self.refuted.contains(&candidate.claim());
        !refuted && (self.allow_any_shape || !candidate.is_any_shape())
    }
}

/// Adds causes as long as there are any that pass. The first round's scores go into `scores`.
fn extend(
    search: &Search,
    admitted: &Admitted,
    extension: &mut Extension,
    scores: &mut Vec<CandidateScore>,
) -> Result<(), SpecError> {
    while extension.found.len() < MOST_FINDINGS {
        let Extension { model, found } = &mut *extension;
        let turn = found.len();
        (search.progress)(&format!("weighing all causes (round {})", turn + 1));
        let mut round = Round::new(search.log, model, search.seed + turn as u64);
        if scores.is_empty() {
            *scores = round.scores();
        }
        let (fits, candidates) = (&mut round.fits, &round.candidates);
        fits.retain(|fit| admitted.has(&candidates[fit.candidate]));
        let least = if found.is_empty() { 0.0 } else { MATERIAL_BESIDE * search.base.sse };
        let Some((chosen, fitted)) = choose(search, model, &round, least)? else { break };
        let candidate = &round.candidates[chosen.candidate];
        found.push(Found {
            cause: candidate.cause,
            term: candidate.term,
            columns: candidate.columns.clone(),
            follows: candidate.follows.clone(),
            fit: chosen,
            share: 0.0,
            rivals: Vec::new(),
        });
        *model = fitted;
    }
    Ok(())
}

/// Fits the candidates that passed and takes the one that explains most.
fn choose(
    search: &Search,
    model: &Fitted,
    round: &Round,
    least: f64,
) -> Result<Option<(CandidateFit, Fitted)>, SpecError> {
    let Search { log, progress, .. } = *search;
    let passed = round.passed();
    let best = passed.first().map_or(0.0, |fit| round.merit(fit));
    let mut variants: Vec<&'static dyn Cause> = Vec::new();
    let mut shortlist: Vec<CandidateFit> = Vec::new();
    for fit in passed {
        let candidate = &round.candidates[fit.candidate];
        let enough = if candidate.cause.is_nonlinear() { 0.2 } else { 0.5 };
        let same = variants.iter().filter(|cause| **cause == candidate.cause).count();
        if round.merit(fit) >= enough * best && same < 2 && shortlist.len() < MOST_FITTED {
            variants.push(candidate.cause);
            shortlist.push(fit.clone());
        }
    }
    if shortlist.len() > 1 && round.merit(&shortlist[0]) > 50.0 * round.merit(&shortlist[1]) {
        shortlist.truncate(1);
    }
    if !model.spec.law.has_bristles() {
        yield_in_sliding(round, &mut shortlist);
    }
    let straight = shortlist.len();
    let noise = noise_floor(&log.train_tracks, log.decimate);
    let excess = model.sse - noise * noise * round.gram.rows as f64;
    if excess > STRUCTURE * model.sse && best < EXPLAINS * excess {
        shortlist.extend(round.second_chances(&variants));
    }
    let mut winner: Option<(f64, CandidateFit, Fitted)> = None;
    let mut before = None;
    for (place, fit) in shortlist.into_iter().enumerate() {
        let candidate = &round.candidates[fit.candidate];
        progress(&format!("fitting {}+{}", model.spec, candidate.cause.name()));
        let fitted = with_candidate(log, model, candidate, &fit)?;
        // What rows left out cost the linear fit beside its fitted ones, the fit's own gain pays too.
        let optimism = (fit.gain - fit.gain_unseen).max(0.0);
        let merit = (model.sse - fitted.sse - optimism) * candidate.weight;
        if place >= straight {
            let model_now = before.get_or_insert_with(|| model.on_train(log));
            let then = fitted.on_train(log);
            let fall = model.sse - fitted.sse;
            if fall < SECOND_CHANCE * model.sse || paired(model_now, &then) < CLEARLY {
                continue;
            }
        }
        if winner.as_ref().is_none_or(|(best, ..)| merit > *best) {
            winner = Some((merit, fit, fitted));
        }
    }
    let Some((merit, fit, fitted)) = winner else { return Ok(None) };
    if merit < (MATERIAL * model.sse).max(least) {
        return Ok(None);
    }
    Ok(Some((fit, fitted)))
}

/// In pure sliding two causes may be one and the same, as an offset of the sensor and a difference between
/// the directions. Where this log cannot tell them apart, the one that yields is left to be named as not
/// told apart from the other.
fn yield_in_sliding(round: &Round, shortlist: &mut Vec<CandidateFit>) {
    let place = |shortlist: &[CandidateFit], cause: &'static dyn Cause| {
        shortlist.iter().position(|fit| round.candidates[fit.candidate].cause == cause)
    };
    for cause in super::cause::ALL {
        let Some(named) = cause.yields_to() else { continue };
        let Some(yielding) = place(shortlist, *cause) else { continue };
        let Some(named) = place(shortlist, named) else { continue };
        let (share, better) =
            round.gram.confusion(shortlist[yielding].candidate, shortlist[named].candidate);
        if share > 0.95 && (better < 3.0 || share > 0.995) {
            shortlist.remove(yielding);
        }
    }
}
