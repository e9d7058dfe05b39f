//! One round: all candidates beside a fitted model.

use super::block_errors::{BlockErrors, Improvement};
use super::candidate::FitContext;
use super::cause::{Cause, CauseCandidate, cause_candidates};
use super::error_reduction::ErrorReduction;
use super::gram_blocks::{CandidateFit, CandidateOptions, GramBlocks};
use super::model::FittedModel;
use super::other_laws;
use super::sensitivities::sensitivities;
use super::survey::{block_length, survey};
use super::thresholds::{CHANCE, CONFOUNDED_MATERIAL, EXTRAPOLATES, MATERIAL};
use super::train_test::TrainTest;

/// Minimum number of held-out runs for which their scatter is used as a standard error.
const MIN_RUNS_FOR_SCATTER: usize = 5;

/// Returns the minimum share of the squared error above the floor that a cause must remove to be material. `beyond` is the
/// part of the squared error that lies above the floor, 0 to 1.
pub fn material(cause: &dyn Cause, beyond: f64) -> f64 {
    if cause.is_confounded_with_model_error() {
        MATERIAL.max(CONFOUNDED_MATERIAL * beyond)
    } else {
        MATERIAL
    }
}

/// Result of a candidate in a round, for the report.
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
    /// Reduction of the squared error on held-out rows, as a share of the squared error.
    pub share: f64,
    /// Standard error of that share.
    pub share_error: f64,
    /// Reason for the rejection; empty if the candidate passed.
    pub rejected_because: String,
    /// True if the candidate passed all criteria.
    pub passed: bool,
}

/// A fitted model with all its candidates.
pub struct Round {
    /// The candidates of this round.
    pub candidates: Vec<CauseCandidate>,
    /// Products of their columns by blocks.
    pub gram: GramBlocks,
    /// Their linear fits.
    pub fits: Vec<CandidateFit>,
    /// Linear fits of the null models, which only test their own cause.
    null_models: Vec<CandidateFit>,
    /// Errors of the model on held-out rows.
    pub block_errors: BlockErrors,
    /// Rows of a block.
    pub length: usize,
    /// Squared error beyond the floor, Nm^2.
    pub excess: f64,
    only_describe: Vec<bool>,
}

impl Round {
    /// Evaluates all candidates together with a fitted model.
    pub fn new(log: &TrainTest, model: &FittedModel) -> Self {
        let log = &*log.following(model.follows.as_ref());
        let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        let context = FitContext { log, spec: &model.spec, at: &at };
        let candidates = cause_candidates(&context);
        let length = block_length(log, &at);
        let gram = survey(log, &at, &candidates, &other_laws::columns(&context), length);
        let options: Vec<CandidateOptions> = candidates
            .iter()
            .map(|own| CandidateOptions {
                comparisons: own.comparisons,
                block_weighted: !own.cause.is_confounded_with_model_error(),
            })
            .collect();
        let all = gram.try_all(&options).into_iter();
        let all = all.filter(|fit| !candidates[fit.candidate].is_comparison_only);
        let (null_models, fits) = all.partition(|fit| candidates[fit.candidate].is_null_model);
        let block_errors = BlockErrors::of(&gram);
        let excess = log.beyond_floor(block_errors.sse());
        let only_describe = candidates.iter().map(|c| log.can_only_describe(&c.columns)).collect();
        Self { candidates, gram, fits, null_models, block_errors, length, excess, only_describe }
    }

    /// Returns why a model with this candidate and this improvement is rejected; `None` if it is accepted.
    pub fn rejection_reason(
        &self,
        candidate: usize,
        better: &Improvement,
        probability: f64,
    ) -> Option<String> {
        let Improvement { describes, extrapolates } = better;
        if describes.value <= 0.0 {
            return Some("does not reduce the error on held-out rows".into());
        }
        if probability >= CHANCE {
            return Some(format!("not significant, p = {probability:.2}"));
        }
        let beyond = self.excess / self.block_errors.sse().max(f64::MIN_POSITIVE);
        let least = material(self.candidates[candidate].cause, beyond);
        if describes.value < least * self.excess {
            let share = 100.0 * describes.value / self.excess;
            return Some(format!(
                "negligible, {share:.1} % of the squared error above the noise floor"
            ));
        }
        // With three or four runs, the scatter is too uncertain for a test.
        let enough = |runs: &ErrorReduction| {
            if runs.observations < MIN_RUNS_FOR_SCATTER { 0.0 } else { EXTRAPOLATES }
        };
        let fails =
            |runs: &ErrorReduction| runs.value <= 0.0 || runs.in_standard_errors() < enough(runs);
        if !self.only_describe[candidate] && extrapolates.as_ref().is_some_and(fails) {
            return Some("does not reduce the error on held-out runs".into());
        }
        None
    }

    fn linear_rejection_reason(&self, fit: &CandidateFit) -> Option<String> {
        let better = Improvement { describes: fit.unseen, extrapolates: fit.unseen_runs };
        self.rejection_reason(fit.candidate, &better, fit.p_value)
    }

    /// Returns a reason for rejection if a null model of the candidate explains the residual equally well.
    pub fn explained_by_null_model(&self, candidate: usize) -> Option<String> {
        let cause = self.candidates[candidate].cause;
        let is_own = |fit: &&CandidateFit| self.candidates[fit.candidate].cause == cause;
        let own = self.fits.iter().filter(is_own).map(|fit| fit.unseen.at_least());
        let own = own.fold(f64::NEG_INFINITY, f64::max);
        let as_good = |null_model: &&CandidateFit| {
            null_model.unseen.at_least() >= own
                || self.gram.alike(candidate, null_model.candidate).is_some()
        };
        let null_model = self.null_models.iter().filter(is_own).find(as_good);
        null_model
            .map(|_| "bristles of several stiffnesses explain the residual equally well".into())
    }

    /// Returns true if a candidate's column changes too rarely for an evaluation on held-out runs.
    pub fn only_describes(&self, candidate: usize) -> bool {
        self.only_describe[candidate]
    }

    /// Returns the score by which fitted candidates are compared.
    pub fn merit(&self, candidate: usize, better: &Improvement) -> f64 {
        better.describes.at_least() * self.candidates[candidate].weight
    }

    /// Returns the same score for the linear fit.
    pub fn linear_merit(&self, fit: &CandidateFit) -> f64 {
        fit.unseen.at_least() * self.candidates[fit.candidate].weight
    }

    /// Returns the best setting of each poorly linearised cause that is not among `tried`.
    pub fn poorly_linearised_fits(&self, tried: &[&'static dyn Cause]) -> Vec<CandidateFit> {
        let mut chances: Vec<CandidateFit> = Vec::new();
        let mut order: Vec<&CandidateFit> = self.fits.iter().collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for fit in order {
            let cause = self.candidates[fit.candidate].cause;
            let had = |t: &CandidateFit| self.candidates[t.candidate].cause == cause;
            let may = cause.is_poorly_linearised() && fit.gain > MATERIAL * self.excess;
            if may && !tried.contains(&cause) && !chances.iter().any(had) {
                chances.push(fit.clone());
            }
        }
        chances
    }

    /// Returns the candidates that passed, best first.
    pub fn passed(&self) -> Vec<&CandidateFit> {
        let passed = self.fits.iter().filter(|fit| self.linear_rejection_reason(fit).is_none());
        let mut passed: Vec<&CandidateFit> = passed.collect();
        passed.sort_by(|a, b| self.linear_merit(b).total_cmp(&self.linear_merit(a)));
        passed
    }

    /// Returns the scores of all candidates for the report, best first.
    pub fn scores(&self) -> Vec<CandidateScore> {
        let sse = self.block_errors.sse().max(f64::MIN_POSITIVE);
        let mut scores: Vec<CandidateScore> = self
            .fits
            .iter()
            .map(|fit| {
                let candidate = &self.candidates[fit.candidate];
                let rejection = self.linear_rejection_reason(fit);
                CandidateScore {
                    cause: candidate.cause,
                    columns: candidate.columns.clone(),
                    level: candidate.follows.as_ref().is_some_and(|follows| follows.level),
                    order: candidate.order,
                    share: fit.unseen.value / sse,
                    share_error: fit.unseen.error / sse,
                    passed: rejection.is_none(),
                    rejected_because: rejection.unwrap_or_default(),
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
    fn material_of_confounded_cause_grows_with_error_above_floor() {
        let of = |name: &str| *ALL.iter().find(|cause| cause.name() == name).expect("a cause");
        for beyond in [0.05, 0.5, 1.0] {
            assert_eq!(material(of("pressure-coulomb"), beyond), MATERIAL);
        }
        assert_eq!(material(of("quadratic-drag"), 0.05), MATERIAL);
        assert_eq!(material(of("quadratic-drag"), 1.0), CONFOUNDED_MATERIAL);
        assert!(material(of("quadratic-drag"), 0.5) < CONFOUNDED_MATERIAL);
    }
}
