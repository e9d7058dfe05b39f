//! Every finding taken out once, and weighed again beside all others.
//!
//! What only correlated with a cause that was not yet in falls here: with all others in, it must still gain on
//! rows left out, by the same rules it entered by. So does a curve that is the last bend of a named cause's
//! own effect. Each finding that stays is compared with the causes that would explain the same.

use super::accepted_cause::AcceptedCause;
use super::block_errors::BlockErrors;
use super::cause::{CauseCandidate, CauseIdentity};
use super::finding::ConfoundedCause;
use super::gram_blocks::CandidateFit;
use super::model::{FittedModel, with_candidate, without};
use super::round::Round;
use super::search::{Extension, Search};
use super::select::{at_bound, better, share};
use super::thresholds::{ALIKE, ANY_SHAPE, BETTER, MATERIAL, SHORTLISTED};
use super::train_test::FollowedColumn;
use crate::spec::SpecError;

/// Resampled logs the stability is counted over.
const RESAMPLES: usize = 60;

/// Minimum share of resampled logs in which a cause must be the best of all candidates, if it removes less than
/// [`MATERIAL`] of the whole squared error. Near the floor some candidate always gains about a percent.
const MIN_STABILITY: f64 = 0.05;

fn is_any_shape(found: &AcceptedCause) -> bool {
    found.follows.as_ref().is_some_and(FollowedColumn::is_any_shape)
}

/// Takes every finding out once, the last one first, and weighs all candidates in its place; returns what
/// did not hold.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn review(search: &Search, extension: &mut Extension) -> Result<Vec<CauseIdentity>, SpecError> {
    let Search { log, base, seed, progress, .. } = *search;
    let mut lost_claims = Vec::new();
    let mut left = extension.found.len();
    let corrected = corrected(search, extension)?;
    while left > 0 {
        let index = left - 1;
        let rest = extension.without(search, index)?;
        let Extension { model, found } = &mut *extension;
        let claim = CauseIdentity::new(found[index].cause, found[index].follows.as_ref());
        progress(&format!("comparing {} with all other causes", claim.cause.name()));
        let round = Round::new(log, &rest);
        let same = |candidate: &CauseCandidate| candidate.claim() == claim;
        let own = round
            .fits
            .iter()
            .filter(|fit| same(&round.candidates[fit.candidate]))
            .max_by(|a, b| a.unseen.value.total_cmp(&b.unseen.value))
            .cloned();
        let better = better(search, model, &round, claim.cause);
        let unique = better.describes;
        let all = BlockErrors::of_model(log, base, round.length);
        let read = match &corrected {
            Some(model) if !is_misreading(&found[index]) => {
                BlockErrors::of_model(log, model, round.length)
            }
            _ => all.clone(),
        };
        let lost = own.as_ref().is_none_or(|fit| {
            let candidate = &round.candidates[fit.candidate];
            // It is asked about by name here: no other candidate, only its own settings, are paid for.
            let p = unique.probability(candidate.regressors.len(), candidate.comparisons);
            let named = all.sse() - round.block_errors.sse();
            round.rejection_reason(fit.candidate, &better, p).is_some()
                || unique.value < MATERIAL * log.beyond_floor(read.sse())
                || (is_any_shape(&found[index]) && unique.value < ANY_SHAPE * named)
                || unique.at_least() <= 0.0
                || !stands_alone(&round, fit)
                || is_dominated(&round, &claim, unique.value)
        });
        if !lost
            && let Some(own) = &own
            && let Some((instead, fitted)) =
                displaced(search, model, &rest, &round, own, &lost_claims)?
        {
            *model = fitted;
            found[index] = instead;
            lost_claims.push(claim);
            left = found.len();
            continue;
        }
        if lost {
            // It was in the place of another: gone, and the others are reviewed anew.
            *model = rest;
            let gone = found.remove(index);
            lost_claims.push(CauseIdentity::new(gone.cause, gone.follows.as_ref()));
            left = found.len();
            continue;
        }
        let candidates = &round.candidates;
        let wins = round.gram.stability(RESAMPLES, seed + 7, |c| candidates[c].weight);
        // Two settings of one cause's grid are the same cause.
        let stability: f64 =
            (0..candidates.len()).filter(|c| same(&candidates[*c])).map(|c| wins[c]).sum();
        let taken = share(&unique, &all);
        if stability < MIN_STABILITY && taken < MATERIAL && !is_any_shape(&found[index]) {
            *model = rest;
            let gone = found.remove(index);
            lost_claims.push(CauseIdentity::new(gone.cause, gone.follows.as_ref()));
            left = found.len();
            continue;
        }
        left -= 1;
        let Some(mut fit) = own else { continue };
        fit.stability = stability.min(1.0);
        (fit.unseen, fit.unseen_runs) = (better.describes, better.extrapolates);
        fit.p_value = fit.p_value.min(found[index].fit.p_value);
        found[index].share = taken;
        found[index].only_describes = round.only_describes(fit.candidate)
            && better.extrapolates.is_some_and(|runs| runs.value <= 0.0);
        let mut named = rivals(&round, &fit);
        named.extend(fitted_rivals(search, model, &rest, &round, &fit, &named)?);
        named.sort_by(|a, b| b.share.total_cmp(&a.share));
        found[index].rivals = named;
        found[index].fit = fit;
    }
    order(&mut extension.found);
    Ok(lost_claims)
}

/// Of what a candidate gains, so much must be left where laws of other shapes have taken theirs. On drawn worlds what was there
/// kept 0.37 and more, what was not 0.13 and less or nearly all; twice as much takes a true drag,
/// half as much lets one drag pass that is not there.
const MIN_INDEPENDENT_SHARE: f64 = 0.25;

/// Whether a candidate is more than a part of what a law of another shape would explain. Not asked where what the columns
/// promise is not what a fit gains: of causes that bend the bristles themselves, of ripples, and where they promise nothing.
fn stands_alone(round: &Round, fit: &CandidateFit) -> bool {
    let cause = round.candidates[fit.candidate].cause;
    let by_itself = round.gram.beside_other_laws(fit.candidate).value;
    cause.is_nonlinear()
        || cause.is_poorly_linearised()
        || fit.unseen.value <= 0.0
        || by_itself >= MIN_INDEPENDENT_SHARE * fit.unseen.value
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

/// Whether another named cause passes in a finding's place and promises more than twice what the finding takes, and yet was
/// not taken, for its own fit did not keep that: what is there is neither, and the finding stands in for it.
fn is_dominated(round: &Round, claim: &CauseIdentity, takes: f64) -> bool {
    let others = round.passed().into_iter().filter(|fit| {
        let other = &round.candidates[fit.candidate];
        other.cause != claim.cause && !other.is_any_shape()
    });
    let most = others.map(|fit| fit.unseen.value).fold(0.0, f64::max);
    takes < SHORTLISTED * most
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
