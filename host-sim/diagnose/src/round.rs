//! One round: all candidates beside a fitted model.

use super::block_errors::{BlockErrors, Improvement};
use super::candidate::{FitContext, FoundSettings};
use super::cause::{Cause, CauseCandidate, cause_candidates};
use super::cause_evidence::CauseEvidence;
use super::error_reduction::ErrorReduction;
use super::gram_blocks::{CandidateFit, CandidateOptions, GramBlocks};
use super::model::FittedModel;
use super::naming::WeighedCause;
use super::other_laws;
use super::rules::{self, Rejection};
use super::sensitivities::sensitivities;
use super::survey::{block_length, survey};
use super::train_test::TrainTest;

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
    /// Rule that rejected it; `None` if the candidate passed.
    pub rejection: Option<Rejection>,
    /// Evidence from the linear fit.
    pub evidence: CauseEvidence,
    /// The cause as the contest weighed it, if it was found there.
    pub weighed: Option<WeighedCause>,
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
    /// RMS error of the model over the noise floor.
    error_over_floor: f64,
    /// Share of the noise floor, as variance, from the uncertain motion.
    motion_share: f64,
    has_position: bool,
    only_describe: Vec<bool>,
}

impl Round {
    /// Evaluates all candidates together with a fitted model.
    pub fn new(log: &TrainTest, model: &FittedModel) -> Self {
        let log = &*log.following(model.follows.as_ref());
        let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        let context =
            FitContext { log, spec: &model.spec, at: &at, found: FoundSettings::default() };
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
        Self {
            error_over_floor: log.error_over_floor(block_errors.sse()),
            motion_share: log.motion_share(),
            has_position: log.has_position(),
            candidates,
            gram,
            fits,
            null_models,
            block_errors,
            length,
            excess,
            only_describe,
        }
    }

    /// Returns the rule that rejects a model with this candidate and this improvement; `None` if none does.
    pub fn rejection(
        &self,
        candidate: usize,
        better: &Improvement,
        probability: f64,
    ) -> Option<Rejection> {
        let describes = &better.describes;
        if describes.value <= rules::NO_REDUCTION.limit {
            let why = "does not reduce the error on held-out rows";
            return Some(Rejection::new(&rules::NO_REDUCTION, why));
        }
        if probability >= rules::NOT_SIGNIFICANT.limit {
            let why = format!("not significant, p = {probability:.2}");
            return Some(Rejection::new(&rules::NOT_SIGNIFICANT, why));
        }
        if describes.value < rules::NEGLIGIBLE.limit * self.excess {
            let share = 100.0 * describes.value / self.excess;
            let why =
                format!("negligible, {share:.1} % of the squared error above the noise floor");
            return Some(Rejection::new(&rules::NEGLIGIBLE, why));
        }
        self.candidates[candidate]
            .cause
            .is_time_shift()
            .then(|| self.hysteresis(candidate, describes))?
    }

    /// Returns the rejection of a time shift that the elements of hysteresis explain as well.
    fn hysteresis(&self, candidate: usize, describes: &ErrorReduction) -> Option<Rejection> {
        let beside = self.gram.beside_other_laws(candidate);
        let kept = beside.value / describes.value.max(f64::MIN_POSITIVE);
        let linear = self.fits.iter().find(|fit| fit.candidate == candidate);
        let kept = kept.max(beside.value / linear.map_or(f64::INFINITY, |fit| fit.unseen.value));
        let is_shift = kept > rules::TIME_SHIFT.limit && beside.at_least() > 0.0;
        let why = format!("hysteresis explains all but {:.0} % of it", 100.0 * kept.max(0.0));
        (!is_shift).then(|| Rejection::new(&rules::TIME_SHIFT, why))
    }

    fn linear_rejection(&self, fit: &CandidateFit) -> Option<Rejection> {
        let better = Improvement { describes: fit.unseen, extrapolates: fit.unseen_runs };
        self.rejection(fit.candidate, &better, fit.p_value)
    }

    /// Returns the evidence for a candidate whose model has this improvement.
    pub fn evidence(&self, fit: &CandidateFit, better: &Improvement) -> CauseEvidence {
        let candidate = &self.candidates[fit.candidate];
        let beside = self.gram.beside_other_laws(fit.candidate);
        let linear = fit.unseen.value.max(f64::MIN_POSITIVE);
        let runs = better.extrapolates.filter(|_| !self.only_describe[fit.candidate]);
        CauseEvidence {
            reduction_in_errors: better.describes.in_standard_errors(),
            runs_in_errors: runs.map(|runs| runs.in_standard_errors()),
            share_beyond_floor: better.describes.value / self.excess.max(f64::MIN_POSITIVE),
            independent_share: beside.value / linear,
            independent_in_errors: beside.in_standard_errors(),
            comparisons: self.candidates.len() as f64 * candidate.comparisons,
            motion_share: if self.is_motion_unchecked(candidate) { 1.0 } else { self.motion_share },
            is_confounded_with_law: candidate.cause.is_confounded_with_model_error(),
            is_nonlinear: candidate.cause.is_nonlinear(),
            is_curve: candidate.is_any_shape(),
            error_over_floor: self.error_over_floor,
            ..CauseEvidence::default()
        }
    }

    /// Returns true if a candidate depends on the velocity alone and the log has no position that confirms it.
    fn is_motion_unchecked(&self, candidate: &CauseCandidate) -> bool {
        let is_velocity = |name: &String| name.starts_with("velocity");
        !self.has_position
            && !candidate.columns.is_empty()
            && candidate.columns.iter().all(is_velocity)
    }

    /// Returns a rejection if a null model of the candidate explains the residual equally well.
    pub fn explained_by_null_model(&self, candidate: usize) -> Option<Rejection> {
        let cause = self.candidates[candidate].cause;
        let is_own = |fit: &&CandidateFit| self.candidates[fit.candidate].cause == cause;
        let own = self.fits.iter().filter(is_own).map(|fit| fit.unseen.at_least());
        let own = own.fold(f64::NEG_INFINITY, f64::max);
        let as_good = |null_model: &&CandidateFit| {
            null_model.unseen.at_least() >= own
                || self.gram.alike(candidate, null_model.candidate).is_some()
        };
        let null_model = self.null_models.iter().filter(is_own).find(as_good);
        let why = "bristles of several stiffnesses explain the residual equally well";
        null_model.map(|_| Rejection::new(&rules::NULL_MODEL, why))
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
            let may =
                cause.is_poorly_linearised() && fit.gain > rules::NEGLIGIBLE.limit * self.excess;
            if may && !tried.contains(&cause) && !chances.iter().any(had) {
                chances.push(fit.clone());
            }
        }
        chances
    }

    /// Returns the candidates that passed, best first.
    pub fn passed(&self) -> Vec<&CandidateFit> {
        let passed = self.fits.iter().filter(|fit| self.linear_rejection(fit).is_none());
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
                let better = Improvement { describes: fit.unseen, extrapolates: fit.unseen_runs };
                CandidateScore {
                    cause: candidate.cause,
                    columns: candidate.columns.clone(),
                    level: candidate.follows.as_ref().is_some_and(|follows| follows.level),
                    order: candidate.order,
                    share: fit.unseen.value / sse,
                    share_error: fit.unseen.error / sse,
                    rejection: self.linear_rejection(fit),
                    evidence: self.evidence(fit, &better),
                    fit: fit.clone(),
                    weighed: None,
                }
            })
            .collect();
        scores.sort_by(|a, b| b.share.total_cmp(&a.share));
        scores
    }
}

#[cfg(test)]
mod tests;
