//! Which causes, one after the other.
//!
//! Each round evaluates all candidates at once ([`super::survey`]). Those that pass are fitted with everything else by the
//! core's own simulation, and the one that explains most of rows it has not seen stays. A review follows: every finding is
//! taken out once and has to win its place again ([`super::review`]), because what only correlated with a cause that was
//! not yet in falls when it is.
//!
//! The linear fit beside the model only says which candidate is worth a fit, and where that begins. Whether a cause
//! enters is decided by the fitted model, on the same yardstick ([`super::block_errors`]). When the search ends, causes
//! below the naming threshold are removed (`SearchState::decide`), and it starts again without them.

use super::accepted_cause::AcceptedCause;
use super::block_errors::BlockErrors;
use super::cause::{Cause, CauseCandidate, CauseIdentity};
use super::gram_blocks::CandidateFit;
use super::improvement::at_bound;
use super::model::{FittedModel, with_candidate};
use super::review::review;
use super::round::{CandidateScore, Round};
use super::rules::{self, Rejection, RuleDecision};
use super::search::{Extension, Search};
use super::thresholds::SHORTLISTED;
use friction_fit::spec::SpecError;

/// Most causes that are sought.
const MOST_FINDINGS: usize = 5;

/// Most candidates of a round that are fitted: what a diagnosis may take, not what decides.
const MOST_FITTED: usize = 6;

/// How often the search continues after the review has removed a cause.
const SEARCHES: usize = 3;

/// Probability at and above which the search continues after a cause. What comes after a less likely one explains even
/// less. If the decision removes that cause, the search starts again without it.
const CONTINUED: f64 = 0.15;

/// How often the search goes on after a cause below the naming threshold was removed.
const DECISIONS: usize = 3;

/// The result of the search.
#[derive(Clone, Debug)]
pub struct Selection {
    /// The extended model.
    pub extended: FittedModel,
    /// The causes, strongest first.
    pub found: Vec<AcceptedCause>,
    /// All candidates beside the base law, best first.
    pub scores: Vec<CandidateScore>,
    /// Causes that a rule rejected after their fit.
    pub decisions: Vec<RuleDecision>,
    /// Accepted causes as the calibration last weighed them, with those below its threshold.
    pub weighed: Vec<AcceptedCause>,
}

/// Searches for causes beside a base law; none of those that are `refuted` already.
///
/// # Errors
/// If the base already has as many terms as the core takes.
pub fn select(search: &Search, refuted: &[CauseIdentity]) -> Result<Selection, SpecError> {
    let mut extension = Extension { model: search.base.clone(), found: Vec::new() };
    let mut state = SearchState { refuted: refuted.to_vec(), ..SearchState::default() };
    for _ in 0..DECISIONS {
        state.search(search, &mut extension)?;
        remember(&mut state.weighed, extension.found.clone());
        if !state.decide(search, &mut extension)? {
            break;
        }
    }
    let SearchState { scores, decisions, weighed, .. } = state;
    Ok(Selection { extended: extension.model, found: extension.found, scores, decisions, weighed })
}

/// Adds causes to those that were weighed before; the last weighing of a cause counts.
pub fn remember(weighed: &mut Vec<AcceptedCause>, found: Vec<AcceptedCause>) {
    for found in found {
        let identity = |own: &AcceptedCause| CauseIdentity::new(own.cause, own.follows.as_ref());
        match weighed.iter_mut().find(|own| identity(own) == identity(&found)) {
            Some(own) => *own = found,
            None => weighed.push(found),
        }
    }
}

/// What a search has gathered besides its model.
#[derive(Default)]
struct SearchState {
    refuted: Vec<CauseIdentity>,
    scores: Vec<CandidateScore>,
    decisions: Vec<RuleDecision>,
    weighed: Vec<AcceptedCause>,
}

impl SearchState {
    /// Adds causes one by one and reviews all after each, until none passes or one is unlikely. Named causes come first. A
    /// curve of any shape may then have what is left, and shows in the review which of them only stood in for it.
    fn search(&mut self, search: &Search, extension: &mut Extension) -> Result<(), SpecError> {
        for allow_any_shape in [false, true] {
            let mut losses = 0;
            while extension.found.len() < MOST_FINDINGS && losses < SEARCHES {
                let mut turn = Turn {
                    search,
                    refuted: &self.refuted,
                    allow_any_shape,
                    scores: &mut self.scores,
                    decisions: &mut self.decisions,
                };
                if !turn.add(extension)? {
                    break;
                }
                let lost = review(search, extension, &self.refuted)?;
                losses += usize::from(!lost.is_empty());
                self.refuted.extend(lost);
                if extension.found.iter().any(|found| found.probability < CONTINUED) {
                    return Ok(());
                }
            }
        }
        Ok(())
    }

    /// Removes the least likely cause below the naming threshold and reviews the others, until there is none. Returns true
    /// if one was removed, because it may have hidden another.
    fn decide(&mut self, search: &Search, extension: &mut Extension) -> Result<bool, SpecError> {
        let mut has_removed = false;
        loop {
            let found = extension.found.iter().enumerate();
            let weakest = found.min_by(|a, b| a.1.probability.total_cmp(&b.1.probability));
            let weakest = weakest.filter(|(_, own)| own.probability < search.naming_threshold);
            let Some((index, _)) = weakest else { return Ok(has_removed) };
            extension.model = extension.without(search, index)?;
            let gone = extension.found.remove(index);
            self.refuted.push(CauseIdentity::new(gone.cause, gone.follows.as_ref()));
            let why = format!(
                "a probability of {:.2} is below the naming threshold of {:.2}",
                gone.probability, search.naming_threshold
            );
            self.decisions.push(RuleDecision {
                cause: gone.cause,
                columns: gone.columns,
                rejection: Rejection::new(&rules::BELOW_THRESHOLD, why),
            });
            let lost = review(search, extension, &self.refuted)?;
            self.refuted.extend(lost);
            has_removed = true;
        }
    }
}

/// A search with some claims out of it.
struct Turn<'a> {
    search: &'a Search<'a>,
    /// Not these: a review has taken them out.
    refuted: &'a [CauseIdentity],
    /// Curves of any shape.
    allow_any_shape: bool,
    scores: &'a mut Vec<CandidateScore>,
    decisions: &'a mut Vec<RuleDecision>,
}

impl Turn<'_> {
    fn admits(&self, candidate: &CauseCandidate) -> bool {
        let refuted = self.refuted.contains(&candidate.claim());
        !refuted && (self.allow_any_shape || !candidate.is_any_shape())
    }

    /// Adds the best cause that passes; returns false if none does. The first round's scores are kept.
    fn add(&mut self, extension: &mut Extension) -> Result<bool, SpecError> {
        let Extension { model, found } = &mut *extension;
        (self.search.progress)(&format!("evaluating all causes (round {})", found.len() + 1));
        let mut round = Round::new(self.search.log, model);
        if self.scores.is_empty() {
            *self.scores = round.scores();
        }
        let candidates = &round.candidates;
        round.fits.retain(|fit| self.admits(&candidates[fit.candidate]));
        let Some((chosen, fitted)) = self.choose(model, &round)? else { return Ok(false) };
        let candidate = &round.candidates[chosen.candidate];
        found.push(AcceptedCause::chosen(candidate, chosen));
        *model = fitted;
        Ok(true)
    }

    /// Who is worth a fit, the most promising first, at most two settings of a cause.
    fn queue(&self, model: &FittedModel, round: &Round) -> Vec<CandidateFit> {
        let mut variants: Vec<&'static dyn Cause> = Vec::new();
        let mut queue: Vec<CandidateFit> = Vec::new();
        for fit in round.passed() {
            let cause = round.candidates[fit.candidate].cause;
            if variants.iter().filter(|own| **own == cause).count() < 2 {
                variants.push(cause);
                queue.push(fit.clone());
            }
        }
        if !model.spec.law.has_bristles() {
            yield_in_sliding(round, &mut queue);
        }
        queue
    }

    /// Fits who is worth it and takes the one that explains most of rows it has not seen. The queue goes on until
    /// who is next promises much less than the best so far has shown; what the linear fit may underrate gets its
    /// turn where that leaves structure.
    fn choose(
        &mut self,
        model: &FittedModel,
        round: &Round,
    ) -> Result<Option<(CandidateFit, FittedModel)>, SpecError> {
        let mut winner: Option<Winner> = None;
        let shown = |winner: &Option<Winner>| winner.as_ref().map_or(0.0, |winner| winner.merit);
        let mut tried: Vec<&'static dyn Cause> = Vec::new();
        for fit in self.queue(model, round) {
            let cause = round.candidates[fit.candidate].cause;
            let enough = if cause.is_nonlinear() { 0.25 * SHORTLISTED } else { SHORTLISTED };
            if tried.len() < MOST_FITTED && round.linear_merit(&fit) >= enough * shown(&winner) {
                tried.push(cause);
                self.fit(model, round, fit, &mut winner)?;
            }
        }
        if shown(&winner) < SHORTLISTED * round.excess {
            for fit in round.poorly_linearised_fits(&tried) {
                self.fit(model, round, fit, &mut winner)?;
            }
        }
        Ok(winner.map(|winner| (winner.fit, winner.fitted)))
    }

    /// Fits one candidate with everything else and lets it win if nothing stands against it and it is the best.
    fn fit(
        &mut self,
        model: &FittedModel,
        round: &Round,
        mut fit: CandidateFit,
        winner: &mut Option<Winner>,
    ) -> Result<(), SpecError> {
        let Search { log, fits, progress, .. } = *self.search;
        let candidate = &round.candidates[fit.candidate];
        progress(&format!("fitting {}+{}", model.spec, candidate.cause.name()));
        let fitted = with_candidate(fits, model, candidate, &fit)?;
        let better =
            BlockErrors::of_model(log, &fitted, round.length).better_than(&round.block_errors);
        let better = better.weighted_for(candidate.cause);
        let all = round.candidates.len() as f64 * candidate.comparisons;
        let probability = better.describes.probability(candidate.regressors.len(), all);
        let bound = at_bound(&fitted, candidate).map(|id| {
            let why = format!("its fit ends at the bound of {}", id.name());
            Rejection::new(&rules::AT_BOUND, why)
        });
        let contradicted = || {
            let why = candidate.cause.contradicted(&fitted.parameters)?;
            Some(Rejection::new(&rules::CONTRADICTED, why))
        };
        let rejection = bound
            .or_else(contradicted)
            .or_else(|| round.rejection(fit.candidate, &better, probability))
            .or_else(|| round.explained_by_null_model(fit.candidate));
        if let Some(rejection) = rejection {
            if fit.p_value < rules::NOT_SIGNIFICANT.limit {
                let columns = candidate.columns.clone();
                self.decisions.push(RuleDecision { cause: candidate.cause, columns, rejection });
            }
            return Ok(());
        }
        let merit = round.merit(fit.candidate, &better);
        if winner.as_ref().is_none_or(|best| merit > best.merit) {
            (fit.unseen, fit.unseen_runs) = (better.describes, better.extrapolates);
            fit.p_value = probability;
            *winner = Some(Winner { merit, fit, fitted });
        }
        Ok(())
    }
}

/// The best of a round so far.
struct Winner {
    merit: f64,
    fit: CandidateFit,
    fitted: FittedModel,
}

/// In pure sliding two causes may be identical, for example an offset of the sensor and a difference between
/// the directions. If this log cannot distinguish them, the yielding one is removed here and later named as confounded with
/// the other.
fn yield_in_sliding(round: &Round, shortlist: &mut Vec<CandidateFit>) {
    let place = |shortlist: &[CandidateFit], cause: &'static dyn Cause| {
        shortlist.iter().position(|fit| round.candidates[fit.candidate].cause == cause)
    };
    for cause in super::cause::ALL {
        let Some(named) = cause.yields_to() else { continue };
        let Some(yielding) = place(shortlist, *cause) else { continue };
        let Some(named) = place(shortlist, named) else { continue };
        if round.gram.alike(shortlist[yielding].candidate, shortlist[named].candidate).is_some() {
            shortlist.remove(yielding);
        }
    }
}

#[cfg(test)]
mod tests;
