//! One round: all candidates beside a fitted model.

use super::candidate::Beside;
use super::cause::{Cause, Suspect, suspects};
use super::fall::Fall;
use super::gram_blocks::{Asked, CandidateFit, GramBlocks};
use super::model::Fitted;
use super::other_laws;
use super::sensitivities::sensitivities;
use super::standing::{Better, Standing};
use super::survey::{block_length, survey};
use super::thresholds::{CHANCE, EXTRAPOLATES, IMITATED, MATERIAL};
use super::train_test::TrainTest;

/// Runs from which on their scatter is an error.
const MANY: usize = 5;

/// Share of the squared error beyond the floor that a cause must take to be more than a trifle, where that is `beyond` of
/// all of it.
pub fn material(cause: &dyn Cause, beyond: f64) -> f64 {
    if cause.is_imitated() { MATERIAL.max(IMITATED * beyond) } else { MATERIAL }
}

/// What a candidate got in a round, for the report.
#[derive(Clone, Debug)]
pub struct CandidateScore {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns it needs.
    pub columns: Vec<String>,
    /// Where it follows a column of its own choice: as a share of the level.
    pub level: bool,
    /// Of a periodic cause, the order.
    pub order: Option<f64>,
    /// The linear fit.
    pub fit: CandidateFit,
    /// Fall of the squared error on unseen rows as a share of it.
    pub share: f64,
    /// Standard error of that share.
    pub share_error: f64,
    /// What stood against it; empty where it passed.
    pub against: String,
    /// Whether it passed.
    pub passed: bool,
}

/// A fitted model with all its candidates.
pub struct Round {
    /// Who is weighed.
    pub candidates: Vec<Suspect>,
    /// What is known of them.
    pub gram: GramBlocks,
    /// How they did.
    pub fits: Vec<CandidateFit>,
    /// How those did that are only there to be held against their own cause.
    foils: Vec<CandidateFit>,
    /// The model on unseen rows.
    pub standing: Standing,
    /// Rows of a block.
    pub length: usize,
    /// Squared error beyond the floor, Nm^2.
    pub excess: f64,
    only_describe: Vec<bool>,
}

impl Round {
    /// Asks all candidates beside a model.
    pub fn new(log: &TrainTest, model: &Fitted) -> Self {
        let log = &*log.following(model.follows.as_ref());
        let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        let beside = Beside { log, spec: &model.spec, at: &at };
        let candidates = suspects(&beside);
        let length = block_length(log, &at);
        let gram = survey(log, &at, &candidates, &other_laws::columns(&beside), length);
        let asked: Vec<Asked> = candidates
            .iter()
            .map(|own| Asked { comparisons: own.comparisons, evened: !own.cause.is_imitated() })
            .collect();
        let all = gram.try_all(&asked).into_iter();
        let all = all.filter(|fit| !candidates[fit.candidate].is_only_rival);
        let (foils, fits) = all.partition(|fit| candidates[fit.candidate].is_foil);
        let standing = Standing::of(&gram);
        let excess = log.beyond_floor(standing.sse());
        let only_describe = candidates.iter().map(|c| log.can_only_describe(&c.columns)).collect();
        Self { candidates, gram, fits, foils, standing, length, excess, only_describe }
    }

    /// What stands against a model with this candidate in it, that is so much better.
    pub fn against(&self, candidate: usize, better: &Better, probability: f64) -> Option<String> {
        let Better { describes, extrapolates } = better;
        if describes.value <= 0.0 {
            return Some("gains nothing on unseen rows".into());
        }
        if probability >= CHANCE {
            return Some(format!("may be chance, p = {probability:.2}"));
        }
        let beyond = self.excess / self.standing.sse().max(f64::MIN_POSITIVE);
        let least = material(self.candidates[candidate].cause, beyond);
        if describes.value < least * self.excess {
            let share = 100.0 * describes.value / self.excess;
            return Some(format!("a trifle, {share:.1} % of what is beyond the floor"));
        }
        // The scatter of three or four runs says nothing of itself.
        let enough = |runs: &Fall| if runs.observations < MANY { 0.0 } else { EXTRAPOLATES };
        let fails = |runs: &Fall| runs.value <= 0.0 || runs.in_errors() < enough(runs);
        if !self.only_describe[candidate] && extrapolates.as_ref().is_some_and(fails) {
            return Some("fails on runs left out".into());
        }
        None
    }

    fn stands_against(&self, fit: &CandidateFit) -> Option<String> {
        let better = Better { describes: fit.unseen, extrapolates: fit.unseen_runs };
        self.against(fit.candidate, &better, fit.p_value)
    }

    /// What would look like this candidate without its cause, and does as well; a sentence's end.
    pub fn foiled(&self, candidate: usize) -> Option<String> {
        let cause = self.candidates[candidate].cause;
        let is_own = |fit: &&CandidateFit| self.candidates[fit.candidate].cause == cause;
        let own = self.fits.iter().filter(is_own).map(|fit| fit.unseen.at_least());
        let own = own.fold(f64::NEG_INFINITY, f64::max);
        let as_good = |foil: &&CandidateFit| {
            foil.unseen.at_least() >= own || self.gram.alike(candidate, foil.candidate).is_some()
        };
        let foil = self.foils.iter().filter(is_own).find(as_good);
        foil.map(|_| "bristles of several stiffnesses explain as much".into())
    }

    /// Whether a candidate's column changes too seldom to be judged by runs left out.
    pub fn only_describes(&self, candidate: usize) -> bool {
        self.only_describe[candidate]
    }

    /// What a fall counts for when candidates are compared.
    pub fn merit(&self, candidate: usize, better: &Better) -> f64 {
        better.describes.at_least() * self.candidates[candidate].weight
    }

    /// The same of the linear fit.
    pub fn promised(&self, fit: &CandidateFit) -> f64 {
        fit.unseen.at_least() * self.candidates[fit.candidate].weight
    }

    /// The best setting of each cause the linear fit may underrate and that is not among `tried`.
    pub fn second_chances(&self, tried: &[&'static dyn Cause]) -> Vec<CandidateFit> {
        let mut chances: Vec<CandidateFit> = Vec::new();
        let mut order: Vec<&CandidateFit> = self.fits.iter().collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for fit in order {
            let cause = self.candidates[fit.candidate].cause;
            let had = |t: &CandidateFit| self.candidates[t.candidate].cause == cause;
            let may = cause.is_underrated() && fit.gain > MATERIAL * self.excess;
            if may && !tried.contains(&cause) && !chances.iter().any(had) {
                chances.push(fit.clone());
            }
        }
        chances
    }

    /// Candidates that passed, the best first.
    pub fn passed(&self) -> Vec<&CandidateFit> {
        let passed = self.fits.iter().filter(|fit| self.stands_against(fit).is_none());
        let mut passed: Vec<&CandidateFit> = passed.collect();
        passed.sort_by(|a, b| self.promised(b).total_cmp(&self.promised(a)));
        passed
    }

    /// All of them for the report, the best first.
    pub fn scores(&self) -> Vec<CandidateScore> {
        let sse = self.standing.sse().max(f64::MIN_POSITIVE);
        let mut scores: Vec<CandidateScore> = self
            .fits
            .iter()
            .map(|fit| {
                let candidate = &self.candidates[fit.candidate];
                let against = self.stands_against(fit);
                CandidateScore {
                    cause: candidate.cause,
                    columns: candidate.columns.clone(),
                    level: candidate.follows.as_ref().is_some_and(|follows| follows.level),
                    order: candidate.order,
                    share: fit.unseen.value / sse,
                    share_error: fit.unseen.error / sse,
                    passed: against.is_none(),
                    against: against.unwrap_or_default(),
                    fit: fit.clone(),
                }
            })
            .collect();
        scores.sort_by(|a, b| b.share.total_cmp(&a.share));
        scores
    }
}

#[cfg(test)]
mod tests {
    use super::super::cause::ALL;
    use super::*;

    #[test]
    fn what_a_wrong_law_looks_like_must_take_more_the_more_is_left() {
        let of = |name: &str| *ALL.iter().find(|cause| cause.name() == name).expect("a cause");
        for beyond in [0.05, 0.5, 1.0] {
            assert_eq!(material(of("pressure-coulomb"), beyond), MATERIAL);
        }
        assert_eq!(material(of("quadratic-drag"), 0.05), MATERIAL);
        assert_eq!(material(of("quadratic-drag"), 1.0), IMITATED);
        assert!(material(of("quadratic-drag"), 0.5) < IMITATED);
    }
}
