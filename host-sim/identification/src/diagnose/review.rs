//! Every finding taken out once, and weighed again beside all others.
//!
//! What only correlated with a cause that was not yet in falls here. So does what held-out runs do not
//! need, what whole runs do not agree on, and a curve that is the last bend of a named cause's own effect.

use super::cause::{Claim, Suspect};
use super::finding::Rival;
use super::found::Found;
use super::gram_blocks::CandidateFit;
use super::round::{MATERIAL, Round};
use super::search::{Extension, Search};
use super::train_test::Follows;
use crate::spec::SpecError;

/// Share of the base model's squared residual that a finding beside others must take alone.
pub const MATERIAL_BESIDE: f64 = 0.01;

/// The same for whole runs as observations, which a finding has to pass with all others in. There are
/// few runs, and one candidate left.
const SIGNIFICANT_BY_RUNS: f64 = 0.03;

/// What a curve of any shape must add to what named causes explain, as a share of it: the last bend of
/// their own effect is not another one.
const ANY_SHAPE: f64 = 0.2;

/// Resampled logs the stability is counted over.
const RESAMPLES: usize = 60;

fn is_any_shape(found: &Found) -> bool {
    found.follows.as_ref().is_some_and(Follows::is_any_shape)
}

/// Takes every finding out once, the last one first, and weighs all candidates in its place; returns what
/// did not hold.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn review(search: &Search, extension: &mut Extension) -> Result<Vec<Claim>, SpecError> {
    let Search { log, base, seed, progress } = *search;
    let mut lost_claims = Vec::new();
    let mut left = extension.found.len();
    while left > 0 {
        let index = left - 1;
        let rest = extension.without(search, index)?;
        let Extension { model, found } = &mut *extension;
        let claim = Claim::new(found[index].cause, found[index].follows.as_ref());
        progress(&format!("hearing {} against all others", claim.cause.name()));
        let round = Round::new(log, &rest, seed + 100 + index as u64);
        let same = |candidate: &Suspect| candidate.claim() == claim;
        let own = round
            .fits
            .iter()
            .filter(|fit| same(&round.candidates[fit.candidate]))
            .max_by(|a, b| a.gain_unseen.total_cmp(&b.gain_unseen))
            .cloned();
        let unique = rest.sse - model.sse;
        let helps = model.on_test(log).metrics.sse < rest.on_test(log).metrics.sse;
        let lost = own.as_ref().is_none_or(|fit| {
            let by_runs = round.gram.probability_by_runs(fit.candidate);
            !helps
                || by_runs > SIGNIFICANT_BY_RUNS
                || (found.len() > 1 && unique < MATERIAL_BESIDE * base.sse)
                || (is_any_shape(&found[index]) && unique < ANY_SHAPE * (base.sse - rest.sse))
                || (found.len() > 1 && !round.passes(fit) && unique < 4.0 * MATERIAL * rest.sse)
        });
        if lost {
            // It was in the place of another: gone, and the others are reviewed anew.
            *model = rest;
            let gone = found.remove(index);
            lost_claims.push(Claim::new(gone.cause, gone.follows.as_ref()));
            left = found.len();
            continue;
        }
        left -= 1;
        let Some(mut fit) = own else { continue };
        let candidates = &round.candidates;
        let wins = round.gram.stability(RESAMPLES, seed + 7, |c| candidates[c].weight);
        // Two settings of one cause's grid are the same cause.
        fit.stability = (0..candidates.len())
            .filter(|c| same(&candidates[*c]))
            .map(|c| wins[c])
            .sum::<f64>()
            .min(1.0);
        found[index].share = (unique / base.sse.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        found[index].rivals = rivals(&round, &fit);
        found[index].fit = fit;
    }
    order(&mut extension.found);
    Ok(lost_claims)
}

/// The strongest first, but a gain error of a column after the friction that follows the same column.
fn order(found: &mut Vec<Found>) {
    found.sort_by(|a, b| b.share.total_cmp(&a.share));
    let is_gain_error = |f: &Found| f.follows.as_ref().is_some_and(|follows| !follows.level);
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
fn rivals(round: &Round, fit: &CandidateFit) -> Vec<Rival> {
    /// Nothing could tell two causes apart that share this much of their effect.
    const THE_SAME: f64 = 0.995;
    /// Nor, in practice, these, where the better one is not better by so many standard errors.
    const ALIKE: f64 = 0.8;
    const BETTER: f64 = 3.0;
    let own = &round.candidates[fit.candidate];
    let mut named: Vec<Rival> = Vec::new();
    for (other, candidate) in round.candidates.iter().enumerate() {
        let follows_any = candidate.follows.is_some();
        // A curve over a column of the catalogue can be bent into any of its causes; over a column the
        // catalogue does not know it is another explanation.
        let flexible = follows_any && own.follows.is_none() && candidate.extra.is_none();
        let another_setting = candidate.cause == own.cause && !follows_any;
        let same_column = follows_any && candidate.columns == own.columns;
        if flexible || another_setting || same_column || other == fit.candidate {
            continue;
        }
        let (share, better) = round.gram.confusion(fit.candidate, other);
        if share > THE_SAME || (share > ALIKE && better < BETTER) {
            match named.iter_mut().find(|rival| rival.cause == candidate.cause) {
                Some(known) => known.share = known.share.max(share),
                None => named.push(Rival {
                    cause: candidate.cause,
                    columns: candidate.columns.clone(),
                    share,
                }),
            }
        }
    }
    named.sort_by(|a, b| b.share.total_cmp(&a.share));
    named
}
