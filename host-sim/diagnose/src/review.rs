//! Every finding taken out once, and weighed again beside all others.
//!
//! What only correlated with a cause that was not yet in falls here: with all others in, it must still gain on
//! rows left out, by the same rules it entered by. So does a curve that is the last bend of a named cause's
//! own effect. Each finding that stays is compared with the causes that would explain the same.

use super::accepted_cause::AcceptedCause;
use super::block_errors::{BlockErrors, Improvement};
use super::calibration::Calibration;
use super::cause::{CauseCandidate, CauseIdentity};
use super::cause_evidence::CauseEvidence;
use super::finding::ConfoundedCause;
use super::gram_blocks::CandidateFit;
use super::improvement::{at_bound, better, share};
use super::model::{FittedModel, with_candidate, without};
use super::round::Round;
use super::rules;
use super::search::{Extension, Search};
use super::thresholds::{ALIKE, BETTER, SHORTLISTED};
use super::train_test::FollowedColumn;
use friction_fit::spec::SpecError;

/// Resampled logs the stability is counted over.
const RESAMPLES: usize = 60;

fn is_any_shape(found: &AcceptedCause) -> bool {
    found.follows.as_ref().is_some_and(FollowedColumn::is_any_shape)
}

fn identity(found: &AcceptedCause) -> CauseIdentity {
    CauseIdentity::new(found.cause, found.follows.as_ref())
}

/// Takes every finding out once, the last one first, and weighs all candidates in its place; returns what
/// did not hold. The findings that stay have their evidence and probability.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn review(
    search: &Search,
    extension: &mut Extension,
    refuted: &[CauseIdentity],
) -> Result<Vec<CauseIdentity>, SpecError> {
    let mut lost_claims = refuted.to_vec();
    let mut left = extension.found.len();
    let corrected = corrected(search, extension)?;
    while left > 0 {
        let index = left - 1;
        let place = Place::new(search, extension, index)?;
        let own = place.own.clone().filter(|own| place.holds(search, own, corrected.as_ref()));
        let Some(own) = own else {
            // It was in the place of another: gone, and the others are reviewed anew.
            extension.model = place.rest;
            lost_claims.push(identity(&extension.found.remove(index)));
            left = extension.found.len();
            continue;
        };
        let Extension { model, found } = &mut *extension;
        let Place { rest, round, .. } = &place;
        if let Some((instead, fitted)) = displaced(search, model, rest, round, &own, &lost_claims)?
        {
            lost_claims.push(identity(&found[index]));
            *model = fitted;
            found[index] = instead;
            left = found.len();
            continue;
        }
        let reviewed = place.reviewed(search, model, own)?;
        found[index] = reviewed;
        left -= 1;
    }
    order(&mut extension.found);
    Ok(lost_claims.split_off(refuted.len()))
}

/// The place of a finding: all candidates beside the model without it.
struct Place {
    found: AcceptedCause,
    rest: FittedModel,
    round: Round,
    /// The best candidate of the same cause in this round.
    own: Option<CandidateFit>,
    /// Improvement by the finding.
    better: Improvement,
    /// Errors of the base law.
    base: BlockErrors,
}

impl Place {
    fn new(search: &Search, extension: &Extension, index: usize) -> Result<Self, SpecError> {
        let found = extension.found[index].clone();
        (search.progress)(&format!("comparing {} with all other causes", found.cause.name()));
        let rest = extension.without(search, index)?;
        let round = Round::new(search.log, &rest);
        let claim = identity(&found);
        let own = round.fits.iter().filter(|fit| round.candidates[fit.candidate].claim() == claim);
        let own = own.max_by(|a, b| a.unseen.value.total_cmp(&b.unseen.value)).cloned();
        let better = better(search, &extension.model, &round, found.cause);
        let base = BlockErrors::of_model(search.log, search.base, round.length);
        Ok(Self { found, rest, round, own, better, base })
    }

    /// Returns true if no rule rejects the finding. `corrected` is the base law with the measurement error of the torque,
    /// if there is one.
    fn holds(&self, search: &Search, own: &CandidateFit, corrected: Option<&FittedModel>) -> bool {
        let candidate = &self.round.candidates[own.candidate];
        let takes = self.better.describes;
        // It is asked about by name here: no other candidate, only its own settings, are paid for.
        let p = takes.probability(candidate.regressors.len(), candidate.comparisons);
        let error = match corrected.filter(|_| !is_misreading(&self.found)) {
            Some(model) => BlockErrors::of_model(search.log, model, self.round.length).sse(),
            None => self.base.sse(),
        };
        let named = self.base.sse() - self.round.block_errors.sse();
        self.round.rejection(own.candidate, &self.better, p).is_none()
            && takes.value >= rules::NEGLIGIBLE.limit * search.log.beyond_floor(error)
            && (!is_any_shape(&self.found) || takes.value >= rules::ANY_SHAPE.limit * named)
    }

    /// Returns the finding with what this review shows.
    fn reviewed(
        self,
        search: &Search,
        model: &FittedModel,
        own: CandidateFit,
    ) -> Result<AcceptedCause, SpecError> {
        let Self { mut found, rest, round, better, base, .. } = self;
        let mut rivals = rivals(&round, &own);
        rivals.extend(fitted_rivals(search, model, &rest, &round, &own, &rivals)?);
        rivals.sort_by(|a, b| b.share.total_cmp(&a.share));
        let claim = identity(&found);
        let stability = stability(search, &round, &claim, &rivals);
        found.share = share(&better.describes, &base);
        found.only_describes = round.only_describes(own.candidate)
            && better.extrapolates.is_some_and(|runs| runs.value <= 0.0);
        let error_over_floor = search.log.error_over_floor(model.sse);
        found.evidence = CauseEvidence {
            stability,
            confused_share: rivals.first().map_or(0.0, |rival| rival.share),
            rival_promise: rival_promise(&round, &claim, better.describes.value),
            share_beyond_floor: better.describes.value / search.log.beyond_floor(base.sse()),
            error_over_floor,
            ..round.evidence(&own, &better)
        };
        found.probability = Calibration::current().finding.probability(&found.evidence);
        found.rivals = rivals;
        let p_value = own.p_value.min(found.fit.p_value);
        let (unseen, unseen_runs) = (better.describes, better.extrapolates);
        found.fit = CandidateFit { stability, unseen, unseen_runs, p_value, ..own };
        Ok(found)
    }
}

/// Returns the share of resampled logs in which a cause has the largest gain. All settings of the cause count, and the
/// causes that the log cannot distinguish from it.
fn stability(
    search: &Search,
    round: &Round,
    claim: &CauseIdentity,
    rivals: &[ConfoundedCause],
) -> f64 {
    let candidates = &round.candidates;
    let wins = round.gram.stability(RESAMPLES, search.seed + 7, |c| candidates[c].weight);
    let is_rival = |candidate: &CauseCandidate| {
        let mut rivals = rivals.iter();
        rivals.any(|rival| rival.cause == candidate.cause && rival.columns == candidate.columns)
    };
    // A curve over the same columns is a less specific statement of the same effect.
    let own = candidates.iter().find(|candidate| candidate.claim() == *claim);
    let is_own_curve = |candidate: &CauseCandidate| {
        let same = own.is_some_and(|own| own.columns == candidate.columns);
        candidate.follows.is_some() && candidate.extra.is_none() && same
    };
    let counts = |candidate: &CauseCandidate| {
        candidate.claim() == *claim || is_rival(candidate) || is_own_curve(candidate)
    };
    let own = (0..candidates.len()).filter(|c| counts(&candidates[*c]));
    own.map(|c| wins[c]).sum::<f64>().min(1.0)
}

/// Returns the largest reduction that another named cause promises in a finding's place, relative to what the finding takes.
fn rival_promise(round: &Round, claim: &CauseIdentity, takes: f64) -> f64 {
    let others = round.passed().into_iter().filter(|fit| {
        let other = &round.candidates[fit.candidate];
        other.cause != claim.cause && !other.is_any_shape()
    });
    others.map(|fit| fit.unseen.value).fold(0.0, f64::max) / takes.max(f64::MIN_POSITIVE)
}

/// A torque that follows a column whichever way the joint moves: calibration or a load, no friction.
fn is_misreading(found: &AcceptedCause) -> bool {
    found.follows.as_ref().is_some_and(|follows| !follows.level)
}

/// Returns the base law with the measurement error of the torque only, if there is one besides other causes. A friction
/// cause may be small compared with such an error, for example a wrong area of a bore, and still be relevant.
fn corrected(search: &Search, extension: &Extension) -> Result<Option<FittedModel>, SpecError> {
    if extension.found.len() < 2 || !extension.found.iter().any(is_misreading) {
        return Ok(None);
    }
    let mut model = extension.model.clone();
    for other in extension.found.iter().filter(|found| !is_misreading(found)) {
        let follows = model.follows.clone();
        model = without(search.fits, &model, other.term, follows.as_ref())?;
    }
    Ok(Some(model))
}

/// The cause that does better in a finding's place now that all others are in: of those whose columns pass and share the
/// finding's effect the best, and the one it yields to, however little its column promises. Which of two came first was
/// decided beside a model that lacked the others.
fn displaced(
    search: &Search,
    model: &FittedModel,
    rest: &FittedModel,
    round: &Round,
    own: &CandidateFit,
    lost: &[CauseIdentity],
) -> Result<Option<(AcceptedCause, FittedModel)>, SpecError> {
    let cause = round.candidates[own.candidate].cause;
    let may = |fit: &CandidateFit| {
        let candidate = &round.candidates[fit.candidate];
        let is_in = rest.spec.terms.contains(&candidate.term) || candidate.cause == cause;
        let yields = candidate.cause.yields_to() == Some(cause);
        !is_in && !yields && candidate.follows.is_none() && !lost.contains(&candidate.claim())
    };
    let alike =
        |fit: &CandidateFit| round.gram.confusion(own.candidate, fit.candidate).0 > SHORTLISTED;
    let passed = round.passed().into_iter().find(|fit| may(fit) && alike(fit));
    let of_the_column = |fit: &&CandidateFit| {
        let (other, own) = (&round.candidates[fit.candidate], &round.candidates[own.candidate]);
        let is_level = own.follows.as_ref().is_some_and(|follows| follows.level);
        is_level && other.columns == own.columns && may(fit)
    };
    let by_name = round.passed().into_iter().find(of_the_column);
    let named = cause.yields_to().and_then(|named| {
        let settings =
            round.fits.iter().filter(|fit| round.candidates[fit.candidate].cause == named);
        settings.filter(|fit| may(fit)).max_by(|a, b| a.gain.total_cmp(&b.gain))
    });
    let mut best = (BlockErrors::of_model(search.log, model, round.length), None);
    let merit =
        |standing: &BlockErrors| standing.better_than(&round.block_errors).describes.at_least();
    for fit in passed.into_iter().chain(named).chain(by_name) {
        let candidate = &round.candidates[fit.candidate];
        let fitted = with_candidate(search.fits, rest, candidate, fit)?;
        let standing = BlockErrors::of_model(search.log, &fitted, round.length);
        // A cause of the catalogue goes before a curve over its own column that is little better.
        let is_by_name = by_name.is_some_and(|named| named.candidate == fit.candidate);
        let handicap = if is_by_name && best.1.is_none() { ALIKE } else { 1.0 };
        let is_it = at_bound(&fitted, candidate).is_none()
            && candidate.cause.contradicted(&fitted.parameters).is_none();
        if is_it && merit(&standing) > handicap * merit(&best.0) {
            best = (standing, Some((fit, fitted)));
        }
    }
    let (standing, Some((fit, fitted))) = best else { return Ok(None) };
    let mut fit = fit.clone();
    let cause = round.candidates[fit.candidate].cause;
    let better = standing.better_than(&round.block_errors).weighted_for(cause);
    (fit.unseen, fit.unseen_runs) = (better.describes, better.extrapolates);
    Ok(Some((AcceptedCause::chosen(&round.candidates[fit.candidate], fit), fitted)))
}

/// The strongest first, by what each takes alone at the least, where what this log cannot tell from another counts
/// [`SHORTLISTED`]: the first is what somebody acts on. (A servo's load, measured, before an imbalance that takes a third more and may be
/// an inertia or a delay.) What has a name comes before what only follows a column: it says what to mend. (The damper's play, measured,
/// before its tension.) And a gain error of a column comes after the friction that follows the same column.
fn order(found: &mut Vec<AcceptedCause>) {
    let weight = |found: &AcceptedCause| if found.rivals.is_empty() { 1.0 } else { SHORTLISTED };
    let strength = |found: &AcceptedCause| weight(found) * found.fit.unseen.at_least();
    let is_nameless = |found: &AcceptedCause| found.follows.is_some();
    found.sort_by(|a, b| {
        is_nameless(a).cmp(&is_nameless(b)).then(strength(b).total_cmp(&strength(a)))
    });
    let is_gain_error =
        |f: &AcceptedCause| f.follows.as_ref().is_some_and(|follows| !follows.level);
    for index in 0..found.len() {
        let friction = (index + 1..found.len()).find(|other| {
            found[*other].columns == found[index].columns && !is_gain_error(&found[*other])
        });
        if let Some(other) = friction.filter(|_| is_gain_error(&found[index])) {
            let friction = found.remove(other);
            found.insert(index, friction);
        }
    }
}

/// Causes that would explain what a finding explains.
fn rivals(round: &Round, fit: &CandidateFit) -> Vec<ConfoundedCause> {
    let own = &round.candidates[fit.candidate];
    let mut named: Vec<ConfoundedCause> = Vec::new();
    for (other, candidate) in round.candidates.iter().enumerate() {
        let follows_any = candidate.follows.is_some();
        // A curve over a column of the catalogue can be bent into any of its causes; over a column the
        // catalogue does not know it is another explanation.
        let flexible = follows_any && own.follows.is_none() && candidate.extra.is_none();
        let another_setting = candidate.cause == own.cause && !follows_any;
        let same_column = follows_any && candidate.columns == own.columns;
        if flexible
            || another_setting
            || same_column
            || candidate.is_null_model
            || other == fit.candidate
        {
            continue;
        }
        if let Some(share) = round.gram.alike(fit.candidate, other) {
            match named.iter_mut().find(|rival| rival.cause == candidate.cause) {
                Some(known) => known.share = known.share.max(share),
                None => named.push(ConfoundedCause {
                    cause: candidate.cause,
                    columns: candidate.columns.clone(),
                    share,
                }),
            }
        }
    }
    named
}

/// Causes whose settings the linear fit knows too little of to say whether they explain the same: fitted in the
/// finding's place, and held against it on unseen rows.
fn fitted_rivals(
    search: &Search,
    model: &FittedModel,
    rest: &FittedModel,
    round: &Round,
    fit: &CandidateFit,
    known: &[ConfoundedCause],
) -> Result<Vec<ConfoundedCause>, SpecError> {
    let own = round.candidates[fit.candidate].cause;
    let own_standing = BlockErrors::of_model(search.log, model, round.length);
    let mut found: Vec<ConfoundedCause> = Vec::new();
    for cause in super::cause::ALL.iter().copied().filter(|c| c.is_nonlinear() && *c != own) {
        let settings = round.fits.iter().filter(|f| round.candidates[f.candidate].cause == cause);
        let best = settings.max_by(|a, b| a.unseen.value.total_cmp(&b.unseen.value));
        let Some(best) = best.filter(|_| known.iter().all(|rival| rival.cause != cause)) else {
            continue;
        };
        // What changes the same parameters over the same rows is asked however little its columns promise.
        let is_kin = own.is_nonlinear() && cause.acts_on() == own.acts_on();
        if !is_kin && round.gram.confusion(fit.candidate, best.candidate).0 < SHORTLISTED {
            continue;
        }
        let candidate = &round.candidates[best.candidate];
        let fitted = with_candidate(search.fits, rest, candidate, best)?;
        let standing = BlockErrors::of_model(search.log, &fitted, round.length);
        let all = own_standing.better_than(&round.block_errors).describes.value;
        let share = standing.better_than(&round.block_errors).describes.value / all;
        if share > ALIKE
            && own_standing.better_than(&standing).describes.in_standard_errors() < BETTER
        {
            let columns = candidate.columns.clone();
            found.push(ConfoundedCause { cause, columns, share: share.min(1.0) });
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests;
