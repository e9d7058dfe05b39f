//! One round: all candidates beside a fitted model.

use super::candidate::Beside;
use super::cause::{Cause, Suspect, suspects};
use super::gram_blocks::{CandidateFit, GramBlocks};
use super::model::Fitted;
use super::sensitivities::sensitivities;
use super::survey::survey;
use super::train_test::TrainTest;

/// Probability under nothing hidden below which a candidate passes.
pub const SIGNIFICANT: f64 = 0.005;

/// Share of the squared residual a candidate must explain on rows left out of the fit.
pub const MATERIAL: f64 = 0.004;

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
    /// Gain as a share of the residual's squares.
    pub share: f64,
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
    /// Squared error of the model, Nm^2.
    pub sse: f64,
}

impl Round {
    /// Asks all candidates beside a model.
    pub fn new(log: &TrainTest, model: &Fitted, seed: u64) -> Self {
        let log = &*log.following(model.follows.as_ref());
        let at = sensitivities(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        let candidates = suspects(&Beside { log, spec: &model.spec, at: &at });
        let gram = survey(log, &at, &candidates);
        let comparisons: Vec<f64> =
            candidates.iter().map(|candidate| candidate.comparisons).collect();
        let fits = gram.try_all(&comparisons, seed);
        let sse = gram.sse();
        Self { candidates, gram, fits, sse }
    }

    /// Whether chance and size let a candidate through.
    pub fn passes(&self, fit: &CandidateFit) -> bool {
        fit.p_value < SIGNIFICANT && fit.gain_unseen > MATERIAL * self.sse
    }

    /// Gain on unseen rows times the candidate's weight.
    pub fn merit(&self, fit: &CandidateFit) -> f64 {
        fit.gain_unseen * self.candidates[fit.candidate].weight
    }

    /// The best setting of each cause the linear fit may underrate and that is not among `tried`.
    pub fn second_chances(&self, tried: &[&'static dyn Cause]) -> Vec<CandidateFit> {
        let mut chances: Vec<CandidateFit> = Vec::new();
        let mut order: Vec<&CandidateFit> = self.fits.iter().collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for fit in order {
            let cause = self.candidates[fit.candidate].cause;
            let had = |t: &CandidateFit| self.candidates[t.candidate].cause == cause;
            if cause.is_underrated() && !tried.contains(&cause) && !chances.iter().any(had) {
                chances.push(fit.clone());
            }
        }
        chances
    }

    /// Candidates that passed, the best first.
    pub fn passed(&self) -> Vec<&CandidateFit> {
        let mut passed: Vec<&CandidateFit> = self.fits.iter().filter(|t| self.passes(t)).collect();
        passed.sort_by(|a, b| self.merit(b).total_cmp(&self.merit(a)));
        passed
    }

    /// All of them for the report, the best first.
    pub fn scores(&self) -> Vec<CandidateScore> {
        let mut scores: Vec<CandidateScore> = self
            .fits
            .iter()
            .map(|fit| {
                let candidate = &self.candidates[fit.candidate];
                CandidateScore {
                    cause: candidate.cause,
                    columns: candidate.columns.clone(),
                    level: candidate.follows.as_ref().is_some_and(|follows| follows.level),
                    order: candidate.order,
                    share: fit.gain_unseen / self.sse.max(f64::MIN_POSITIVE),
                    passed: self.passes(fit),
                    fit: fit.clone(),
                }
            })
            .collect();
        scores.sort_by(|a, b| b.share.total_cmp(&a.share));
        scores
    }
}
