//! One round: all candidates beside a fitted model.

use super::candidate::Beside;
use super::cause::{Cause, Suspect, suspects};
use super::model::Fitted;
use super::panel::{Panel, Trial};
use super::survey::survey;
use super::tangent::tangent;
use super::train_test::TrainTest;

/// Probability under nothing hidden below which a candidate passes.
pub const SIGNIFICANT: f64 = 0.005;

/// Share of the squared residual a candidate must explain on rows left out of the fit.
pub const MATERIAL: f64 = 0.004;

/// What a candidate got in a round, for the report.
#[derive(Clone, Debug)]
pub struct Hearing {
    /// The cause.
    pub cause: &'static dyn Cause,
    /// Columns it needs.
    pub columns: Vec<String>,
    /// Where it follows a column of its own choice: as a share of the level.
    pub level: bool,
    /// Of a periodic cause, the order.
    pub order: Option<f64>,
    /// What the panel says.
    pub trial: Trial,
    /// Gain as a share of the residual's squares.
    pub share: f64,
    /// Whether it passed.
    pub passed: bool,
}

/// A fitted model with all its candidates.
pub struct Round {
    /// Who is heard.
    pub candidates: Vec<Suspect>,
    /// What is known of them.
    pub panel: Panel,
    /// How they did.
    pub trials: Vec<Trial>,
    /// Squared error of the model, Nm^2.
    pub sse: f64,
}

impl Round {
    /// Asks all candidates beside a model.
    pub fn new(log: &TrainTest, model: &Fitted, seed: u64) -> Self {
        let log = &*log.following(model.follows.as_ref());
        let at = tangent(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        let candidates = suspects(&Beside { log, spec: &model.spec, at: &at });
        let panel = survey(log, &at, &candidates);
        let comparisons: Vec<f64> =
            candidates.iter().map(|candidate| candidate.comparisons).collect();
        let trials = panel.try_all(&comparisons, seed);
        let sse = panel.sse();
        Self { candidates, panel, trials, sse }
    }

    /// Whether chance and size let a candidate through.
    pub fn passes(&self, trial: &Trial) -> bool {
        trial.p_value < SIGNIFICANT && trial.gain_unseen > MATERIAL * self.sse
    }

    /// Gain on unseen rows times the candidate's weight.
    pub fn merit(&self, trial: &Trial) -> f64 {
        trial.gain_unseen * self.candidates[trial.candidate].weight
    }

    /// The best setting of each cause the panel may underrate and that is not among `tried`.
    pub fn second_chances(&self, tried: &[&'static dyn Cause]) -> Vec<Trial> {
        let mut chances: Vec<Trial> = Vec::new();
        let mut order: Vec<&Trial> = self.trials.iter().collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for trial in order {
            let cause = self.candidates[trial.candidate].cause;
            let had = |t: &Trial| self.candidates[t.candidate].cause == cause;
            if cause.is_underrated() && !tried.contains(&cause) && !chances.iter().any(had) {
                chances.push(trial.clone());
            }
        }
        chances
    }

    /// Candidates that passed, the best first.
    pub fn passed(&self) -> Vec<&Trial> {
        let mut passed: Vec<&Trial> = self.trials.iter().filter(|t| self.passes(t)).collect();
        passed.sort_by(|a, b| self.merit(b).total_cmp(&self.merit(a)));
        passed
    }

    /// All of them for the report, the best first.
    pub fn hearing(&self) -> Vec<Hearing> {
        let mut hearing: Vec<Hearing> = self
            .trials
            .iter()
            .map(|trial| {
                let candidate = &self.candidates[trial.candidate];
                Hearing {
                    cause: candidate.cause,
                    columns: candidate.columns.clone(),
                    level: candidate.follows.as_ref().is_some_and(|follows| follows.level),
                    order: candidate.order,
                    share: trial.gain_unseen / self.sse.max(f64::MIN_POSITIVE),
                    passed: self.passes(trial),
                    trial: trial.clone(),
                }
            })
            .collect();
        hearing.sort_by(|a, b| b.share.total_cmp(&a.share));
        hearing
    }
}
