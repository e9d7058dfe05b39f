//! One round: all candidates beside a fitted model.

use super::candidate::{Candidate, catalogue};
use super::log::Log;
use super::model::Fitted;
use super::panel::{Panel, Trial};
use super::survey::survey;
use super::tangent::tangent;
use compensator_core::TermKind;

/// Probability under nothing hidden below which a candidate passes.
pub const SIGNIFICANT: f64 = 0.005;

/// Share of the squared residual a candidate must explain on rows left out of the fit.
pub const MATERIAL: f64 = 0.004;

/// A curve that may have any shape has to explain this much more than a named cause.
const UNKNOWN_WEIGHT: f64 = 0.8;

/// A gain error of a covariate is as simple as a cause, but no cause of friction.
const GAIN_ERROR_WEIGHT: f64 = 0.9;

/// What a candidate got in a round, for the report.
#[derive(Clone, Debug)]
pub struct Hearing {
    /// The term.
    pub kind: TermKind,
    /// Columns it needs.
    pub columns: Vec<String>,
    /// For `unknown`: as a share of the level.
    pub level: bool,
    /// The order, for a ripple.
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
    pub candidates: Vec<Candidate>,
    /// What is known of them.
    pub panel: Panel,
    /// How they did.
    pub trials: Vec<Trial>,
    /// Squared error of the model, Nm^2.
    pub sse: f64,
}

/// What a gain counts for when it is compared with others.
pub fn weight(candidate: &Candidate) -> f64 {
    match &candidate.follows {
        None => 1.0,
        Some(follows) if follows.proportional => GAIN_ERROR_WEIGHT,
        Some(_) => UNKNOWN_WEIGHT,
    }
}

impl Round {
    /// Asks all candidates beside a model.
    pub fn new(log: &Log, model: &Fitted, seed: u64) -> Self {
        let at = tangent(&model.parameters, &model.free, &log.train_tracks, model.resolution);
        let candidates = catalogue(log, &model.spec, &at);
        let panel = survey(log, &at, &candidates);
        let looks: Vec<f64> = candidates
            .iter()
            .map(|candidate| candidate.peak.map_or(1.0, |peak| peak.independent))
            .collect();
        let trials = panel.try_all(&looks, seed);
        let sse = panel.sse();
        Self { candidates, panel, trials, sse }
    }

    /// Whether chance and size let a candidate through.
    pub fn passes(&self, trial: &Trial) -> bool {
        trial.p_value < SIGNIFICANT && trial.gain_unseen > MATERIAL * self.sse
    }

    /// Gain on unseen rows with the handicap of `unknown`.
    pub fn merit(&self, trial: &Trial) -> f64 {
        trial.gain_unseen * weight(&self.candidates[trial.candidate])
    }

    /// The best setting of each cause that enters crookedly and did not pass.
    pub fn second_chances(&self, heard: &[TermKind]) -> Vec<Trial> {
        let mut chances: Vec<Trial> = Vec::new();
        let mut order: Vec<&Trial> = self.trials.iter().collect();
        order.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        for trial in order {
            let kind = self.candidates[trial.candidate].kind;
            let had = |t: &Trial| self.candidates[t.candidate].kind == kind;
            let is_crooked = is_crooked(kind) || kind == TermKind::PositionRipple;
            if is_crooked && !heard.contains(&kind) && !chances.iter().any(had) {
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
                    kind: candidate.kind,
                    columns: candidate.columns.clone(),
                    level: candidate.follows.as_ref().is_some_and(|follows| follows.level),
                    order: candidate.peak.map(|peak| peak.order),
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

/// Whether a cause enters the model so crookedly that its column at size 0 may say too little.
pub fn is_crooked(kind: TermKind) -> bool {
    use TermKind as Kind;
    matches!(
        kind,
        Kind::Backlash
            | Kind::StribeckShape
            | Kind::ChannelDelay
            | Kind::DwellTimeStatic
            | Kind::TimeDrift
    )
}
