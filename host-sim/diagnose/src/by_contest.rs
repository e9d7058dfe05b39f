//! A diagnosis by the contest of hypotheses.
//!
//! ```text
//! TrainTest -> Rows -> contest -> Outcome           what competes, linear               contest
//!           -> WeighedCause                         probability of each cause           naming
//!           -> Chosen                               the best few in the driver's law    search, finalist
//!           -> Models                               fitted to all rows, held out        here
//!           -> Finding, HandOver                    what is reported and handed over    findings, choice
//! ```

mod choice;
mod corrected_rows;
mod findings;
mod search;

use super::DiagnosisOptions;
use super::contest::{RigidBody, Rows, contest};
use super::evaluation::Gain;
use super::finalist::{FittedFinalist, Realised, resolved};
use super::finding::Finding;
use super::hand_over::{HandOver, HandedOver, is_possible};
use super::leading_fault::Corrected;
use super::left_out::{LeftOut, unit};
use super::model::FittedModel;
use super::naming::{WeighedCause, weigh};
use super::rigid_body_hint::RigidBodyHint;
use super::train_test::TrainTest;
use super::two_positions::TwoPositions;
use choice::DriverModel;
use friction_fit::spec::SpecError;
use friction_fit::{Outcome, Predicted};
use joint_log::Quantity;
use joint_log::log_check::{LogFinding, LogFindingKind};
use search::{Chosen, Search};

/// What a diagnosis by the contest answers.
#[derive(Clone, Debug)]
pub struct Answer {
    /// What the contest has found wrong with the log.
    pub log_findings: Vec<LogFinding>,
    /// What the correction of a late channel takes.
    pub corrected: Option<Corrected>,
    /// The base model, fitted to all rows.
    pub baseline: Outcome,
    /// The base model on held-out rows.
    pub before: Predicted,
    /// The extended model.
    pub extension: Extension,
    /// What was left out at a time, where nothing is set apart.
    pub left_out: Option<LeftOut>,
    /// The named causes, the most probable first.
    pub findings: Vec<Finding>,
    /// All causes of the contest with their probabilities.
    pub weighed: Vec<WeighedCause>,
    /// What is handed over.
    pub hand_over: HandOver,
    /// Rigid-body parts that were not requested and that a part of the error follows.
    pub rigid_body_hint: Option<RigidBodyHint>,
}

/// Answers by the contest. `positions` is what positions on both sides of a gear show of its play.
///
/// # Errors
/// If a model has more terms than the core takes.
pub fn answer(
    original: &TrainTest,
    options: &DiagnosisOptions,
    positions: Option<&TwoPositions>,
    progress: &dyn Fn(&str),
) -> Result<Answer, SpecError> {
    progress("comparing hypotheses");
    let parts = RigidBody::of(&original.rigid_body);
    let mut rows = Rows::new(&original.train, parts, original.decimate);
    let outcome = contest(&mut rows);
    let rigid_body_hint = RigidBodyHint::of(&mut rows, &outcome.plain);
    let mut weighed = weigh(&outcome, &rows);
    findings::check_torques(&mut weighed, &outcome, &rows);
    positions.into_iter().for_each(|positions| positions.weigh(&mut weighed));
    let log = match outcome.is_reversed {
        true => original.clone().with_reversed_torque(),
        false => original.clone(),
    };
    let search = Search { log: &log, rows: &rows, outcome: &outcome, options };
    let (chosen, mut models) = models(&search, &mut weighed, progress)?;
    let judged = &chosen.corrected.judged;
    findings::set_shortfall(&mut weighed, &chosen, &models);
    let findings = findings::findings(&weighed, judged, models.offer.as_ref(), &outcome);
    progress("comparing the models on held-out rows");
    let mut hand_over = search.hand_over(&chosen, original, &models)?;
    if let Some(plain) = &hand_over.driver_plain {
        models.doubt_beside(plain);
    }
    // Without a cause nothing is extended: a linear law in place of the base law is no gain of a cause.
    hand_over.linear_extends = hand_over.on_pc == HandedOver::Linear && !findings.is_empty();
    let reversed = outcome.is_reversed.then(|| reversed_torque(&log));
    let log_findings = reversed.into_iter().chain(chosen.corrected.findings.clone()).collect();
    let extension = models.extension(judged, &hand_over, options.seed);
    Ok(Answer {
        corrected: chosen.corrected.late,
        log_findings,
        left_out: judged.leaves_each_out.then(|| unit(&judged.train_tracks)),
        baseline: models.baseline,
        before: models.before,
        extension,
        findings,
        weighed,
        hand_over,
        rigid_body_hint,
    })
}

/// Returns the finding of a torque whose friction drives the motion.
fn reversed_torque(log: &TrainTest) -> LogFinding {
    let column = Quantity::Torque.name(log.train.joint);
    LogFinding {
        kind: LogFindingKind::SignSuspect,
        columns: vec![column.into()],
        value: -1.0,
        unit: "1".into(),
        corrected: true,
        in_words: format!(
            "{column} has the wrong sign: with it friction drives the motion. The diagnosis and its models are of the torque \
             with the other sign."
        ),
    }
}

/// A model that gains on held-out rows.
struct Offer {
    model: FittedModel,
    outcome: Outcome,
    after: Predicted,
    gain: Gain,
    realised: Vec<Realised>,
}

impl Offer {
    /// Fits a finalist to all rows. Returns `None` if it has no term, does not gain on held-out rows, or is no model that the
    /// core takes: two amplitudes may each be within their bounds and turn friction round together.
    fn new(chosen: &Chosen, before: &Predicted, seed: u64) -> Option<Self> {
        let FittedFinalist { model, realised, .. } = &chosen.fitted;
        if realised.is_empty() {
            return None;
        }
        let outcome = chosen.corrected.identify(&resolved(&chosen.excerpt, model));
        let driver = outcome.for_driver().parameters;
        if driver.validate().and_then(|()| driver.convert::<f32>().validate()).is_err() {
            return None;
        }
        let model = FittedModel::of(&outcome, model);
        let after = chosen.corrected.held_out(&model);
        let gain = Gain::between(before, &after, seed);
        let offer = Self { model, outcome, after, gain, realised: realised.clone() };
        (gain.value > 0.0 && gain.ci95[0] > 0.0).then_some(offer)
    }
}

/// The base model and the extended one, fitted to all rows.
struct Models {
    baseline: Outcome,
    /// The base model on held-out rows.
    before: Predicted,
    offer: Option<Offer>,
}

/// Chooses a hypothesis and fits its models to all rows. If a fitted size refuses a cause, the hypothesis is fitted without it.
fn models(
    search: &Search,
    weighed: &mut [WeighedCause],
    progress: &dyn Fn(&str),
) -> Result<(Chosen, Models), SpecError> {
    progress("fitting the best hypotheses");
    let mut chosen = search.best(weighed)?;
    progress("fitting the base model to all rows");
    let baseline = search.baseline(&chosen);
    progress("evaluating the base model on held-out rows");
    let before = search.before(&chosen, &baseline);
    loop {
        progress("fitting the extended model to all rows");
        let offer = Offer::new(&chosen, &before, search.options.seed);
        let names: Vec<bool> = weighed.iter().map(WeighedCause::is_named).collect();
        if let Some(offer) = &offer {
            findings::check_sizes(weighed, &chosen.corrected.judged, offer);
        }
        if weighed.iter().map(WeighedCause::is_named).eq(names) {
            return Ok((chosen, Models { baseline, before, offer }));
        }
        chosen = search.again(chosen, weighed)?;
    }
}

/// The extended model as it is reported; the base model if none is offered.
#[derive(Clone, Debug)]
pub struct Extension {
    /// The log with the correction of the chosen hypothesis, following what the model follows.
    pub log: TrainTest,
    /// The model.
    pub outcome: Outcome,
    /// The column that it follows besides those that the core knows.
    pub auxiliary: Option<String>,
    /// Its rows that are held out, or those of a linear model that stands for it.
    pub after: Predicted,
    /// The gain.
    pub gain: Gain,
}

impl Models {
    /// Marks the parameters to which a simpler law gives other values.
    fn doubt_beside(&mut self, simpler: &Outcome) {
        self.baseline.doubt_beside(simpler);
        self.offer.iter_mut().for_each(|offer| offer.outcome.doubt_beside(simpler));
    }

    /// Returns the base model as it competes.
    fn base(&self, log: &TrainTest) -> DriverModel<'_> {
        let is_possible = is_possible(&self.baseline.parameters, log);
        DriverModel { held_out: &self.before, is_possible }
    }

    /// Returns the extended model as it competes.
    fn extended(&self, log: &TrainTest) -> Option<DriverModel<'_>> {
        let offer = self.offer.as_ref()?;
        let is_possible = is_possible(&offer.outcome.parameters, log);
        Some(DriverModel { held_out: &offer.after, is_possible })
    }

    /// Returns the extended model as it is reported.
    fn extension(&mut self, judged: &TrainTest, hand_over: &HandOver, seed: u64) -> Extension {
        let offer = self.offer.take();
        let follows = offer.as_ref().and_then(|offer| offer.model.follows.clone());
        let follows = follows.filter(|follows| follows.covariate.is_some());
        let log = judged.following(follows.as_ref()).into_owned();
        let (mut outcome, mut after, mut gain) = match offer {
            Some(Offer { outcome, after, gain, .. }) => (outcome, after, gain),
            None => (self.baseline.clone(), self.before.clone(), Gain::default()),
        };
        outcome.test = after.metrics;
        if let Some(linear) = hand_over.extending() {
            after = linear.held_out.clone();
            gain = Gain::between(&self.before, &after, seed);
        }
        let auxiliary = follows.map(|follows| follows.column);
        Extension { log, outcome, auxiliary, after, gain }
    }
}

#[cfg(test)]
mod tests;
