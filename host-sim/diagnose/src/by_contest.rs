//! A diagnosis by the contest of hypotheses.
//!
//! ```text
//! TrainTest -> Rows -> contest -> Outcome           what competes, linear               contest
//!           -> WeighedCause                         probability of each cause           naming
//!           -> FittedFinalist                       the best few in the driver's law    finalist
//!           -> Offer                                fitted to all rows, held out        here
//! ```

mod choice;
mod corrected_rows;

use super::contest::{
    CauseKey, Correction, DRAWS, Detail, Finalist, FinalistCause, LawStart,
    Outcome as ContestOutcome, RigidBody, Rows, WaveKind, contest,
};
use super::evaluation::Gain;
use super::extended::{Extended, Size};
use super::finalist::{
    FittedFinalist, Realised, excerpt, fit_finalist, fitted, law_kind, law_parameters, resolved,
};
use super::finding::Finding;
use super::hand_over::{HandOver, HandedOver, is_possible};
use super::leading_fault::Corrected;
use super::left_out::{LeftOut, one_step_left_out, unit};
use super::model::FittedModel;
use super::naming::{IMPOSSIBLE, WeighedCause, confounded, weigh};
use super::rigid_body_hint::RigidBodyHint;
use super::rules::{self, Rejection};
use super::train_test::TrainTest;
use super::two_positions::TwoPositions;
use super::{DiagnosisOptions, uncertain_motion, unknown_zero};
use compensator_core::{LawKind, TermKind};
use corrected_rows::CorrectedRows;
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{Loss, Metrics, Outcome, Predicted, autocorrelation_time, predict};
use joint_log::Quantity;
use joint_log::log_check::{LogFinding, LogFindingKind};
use joint_log::number::figure;

/// What a diagnosis by the contest answers.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The log with the correction of the chosen hypothesis.
    pub log: TrainTest,
    /// What the contest has found wrong with the log.
    pub log_findings: Vec<LogFinding>,
    /// What the correction of a late channel takes.
    pub corrected: Option<Corrected>,
    /// The base model, fitted to all rows.
    pub baseline: Outcome,
    /// The extended model; the base model if none is offered.
    pub extended: Outcome,
    /// Its errors on held-out rows, also if a linear model stands for it.
    pub extended_test: Metrics,
    /// The column that the extended model follows besides those that the core knows.
    pub auxiliary: Option<String>,
    /// The base model on held-out rows.
    pub before: Predicted,
    /// The extended one.
    pub after: Predicted,
    /// The gain.
    pub gain: Gain,
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
    log: TrainTest,
    options: &DiagnosisOptions,
    positions: Option<&TwoPositions>,
    progress: &dyn Fn(&str),
) -> Result<Answer, SpecError> {
    progress("comparing hypotheses");
    let mut rows = Rows::new(&log.train, rigid_body(&log.rigid_body), log.decimate);
    let outcome = contest(&mut rows);
    let rigid_body_hint = RigidBodyHint::of(&mut rows, &outcome.plain);
    let mut weighed = weigh(&outcome, &rows);
    check_torques(&mut weighed, &outcome, &rows);
    positions.into_iter().for_each(|positions| positions.weigh(&mut weighed));
    let original = log.clone();
    let mut log = log;
    let mut log_findings = Vec::new();
    if outcome.is_reversed {
        log_findings.push(reversed_torque(&log));
        log = log.with_reversed_torque();
    }
    progress("fitting the best hypotheses");
    let search = Search { log: &log, rows: &rows, outcome: &outcome, options };
    let mut chosen = search.best(&weighed)?;
    progress("fitting the base model to all rows");
    let residuals = chosen.finalist.held_out.residuals.iter().map(Vec::as_slice);
    chosen.corrected.memory_rows = autocorrelation_time(residuals);
    let corrected = &chosen.corrected;
    chosen.base = resolved(&chosen.excerpt, &chosen.base);
    let mut baseline = match &options.given {
        Some((spec, parameters)) => corrected.identify(&FittedModel {
            spec: spec.clone(),
            parameters: parameters.clone(),
            fixed: parameters.active().collect(),
            ..chosen.base.clone()
        })?,
        None => corrected.identify(&chosen.base)?,
    };
    progress("evaluating the base model on held-out rows");
    let before = match &options.given {
        Some((_, parameters)) => {
            predict(parameters, corrected.judged.test_rows(), baseline.resolution)
        }
        None => corrected.held_out(&model_of(&baseline, &chosen.base)),
    };
    let mut offer = loop {
        progress("fitting the extended model to all rows");
        let offer = corrected.offer((&chosen.finalist, &chosen.excerpt), &before, options.seed)?;
        let names: Vec<bool> = weighed.iter().map(WeighedCause::is_named).collect();
        if let Some(offer) = &offer {
            check_sizes(&mut weighed, &chosen, offer);
        }
        if weighed.iter().map(WeighedCause::is_named).eq(names) {
            break offer;
        }
        chosen.finalist = search.again(&chosen, &weighed)?;
    };
    set_shortfall(&mut weighed, &outcome.finalists, &chosen, (&before, offer.as_ref()));
    let findings = findings(&weighed, &chosen, offer.as_ref(), &outcome);
    progress("comparing the models on held-out rows");
    let possible = |outcome: &Outcome| is_possible(&outcome.parameters, &chosen.corrected.judged);
    let extended = offer.as_ref().map(|offer| (&offer.after, possible(&offer.outcome)));
    let base = Some((&before, possible(&baseline)));
    let mut hand_over = search.hand_over(&chosen, &original, [base, extended])?;
    if let Some(plain) = &hand_over.driver_plain {
        baseline.doubt_beside(plain);
        offer.iter_mut().for_each(|offer| offer.outcome.doubt_beside(plain));
    }
    let judged = chosen.corrected.judged.clone();
    let follows =
        offer.as_ref().and_then(|offer| offer.model.follows.clone()).filter(|own| own.extra);
    let log = judged.following(follows.as_ref()).into_owned();
    let (extended, mut after, mut gain) = match offer {
        Some(Offer { outcome, after, gain, .. }) => (outcome, after, gain),
        None => (baseline.clone(), before.clone(), Gain::default()),
    };
    let extended_test = after.metrics;
    // Without a cause nothing is extended: a linear law in place of the base law is no gain of a cause.
    hand_over.linear_extends = hand_over.on_pc == HandedOver::Linear && !findings.is_empty();
    if let Some(linear) = hand_over.extending() {
        after = linear.held_out.clone();
        gain = Gain::between(&before, &after, options.seed);
    }
    Ok(Answer {
        corrected: chosen.corrected.late,
        log_findings: log_findings.into_iter().chain(chosen.corrected.findings).collect(),
        left_out: log.leaves_each_out.then(|| unit(&log)),
        log,
        baseline,
        extended,
        extended_test,
        auxiliary: follows.map(|follows| follows.column),
        before,
        after,
        gain,
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

/// Returns the rigid-body parts as the contest takes them.
fn rigid_body(terms: &[TermKind]) -> RigidBody {
    let has = |term| terms.contains(&term);
    RigidBody {
        inertia: has(TermKind::UnmodelledInertia),
        gravity: has(TermKind::GravityImbalance),
        load: has(TermKind::LoadGain),
        offset: has(TermKind::TorqueOffset),
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

impl CorrectedRows {
    /// Fits the finalist to all rows. Returns `None` if it has no term, does not gain on held-out rows, or is no model that the
    /// core takes: two amplitudes may each be within their bounds and turn friction round together.
    fn offer(
        &self,
        (finalist, excerpt): (&FittedFinalist, &TrainTest),
        before: &Predicted,
        seed: u64,
    ) -> Result<Option<Offer>, SpecError> {
        if finalist.realised.is_empty() {
            return Ok(None);
        }
        let outcome = self.identify(&resolved(excerpt, &finalist.model))?;
        let handed_over = outcome.for_driver().parameters;
        if handed_over.validate().and_then(|()| handed_over.convert::<f32>().validate()).is_err() {
            return Ok(None);
        }
        let model = model_of(&outcome, &finalist.model);
        let after = self.held_out(&model);
        let gain = Gain::between(before, &after, seed);
        let realised = finalist.realised.clone();
        let offer = Offer { model, outcome, after, gain, realised };
        Ok((gain.value > 0.0 && gain.ci95[0] > 0.0).then_some(offer))
    }
}

/// Returns the fitted model of an outcome that was fitted from a start.
fn model_of(outcome: &Outcome, start: &FittedModel) -> FittedModel {
    let free = outcome.estimates.iter().filter(|own| own.std_error.is_some());
    FittedModel {
        parameters: outcome.parameters.clone(),
        free: free.map(|own| own.id).collect(),
        resolution: outcome.resolution,
        ..start.clone()
    }
}

/// The hypothesis that was chosen, fitted to the excerpt.
struct Chosen {
    place: usize,
    corrected: CorrectedRows,
    excerpt: TrainTest,
    base: FittedModel,
    finalist: FittedFinalist,
}

/// What the choice among the finalists is made from.
struct Search<'a> {
    log: &'a TrainTest,
    rows: &'a Rows,
    outcome: &'a ContestOutcome,
    options: &'a DiagnosisOptions,
}

impl Search<'_> {
    /// Returns the base law and the terms that a hypothesis is fitted with.
    fn spec(&self, law: LawKind) -> Spec {
        let given = self.options.given.as_ref().map(|(spec, _)| spec);
        let asked = given.or(self.options.model.as_ref()).cloned();
        asked.unwrap_or_else(|| Spec::law(law)).on(&self.log.rigid_body)
    }

    fn is_law_free(&self) -> bool {
        self.options.given.is_none() && self.options.model.is_none()
    }

    /// Returns the finalist with the least held-out error on an excerpt of the log.
    fn best(&self, weighed: &[WeighedCause]) -> Result<Chosen, SpecError> {
        let fallback = [Finalist::without_cause()];
        let finalists = match self.outcome.finalists.as_slice() {
            [] => &fallback[..],
            finalists => finalists,
        };
        let mut best: Option<Chosen> = None;
        let mut tried: Vec<(Correction, Vec<&CauseKey>)> = Vec::new();
        for (place, finalist) in finalists.iter().enumerate() {
            let causes = finalist.causes.iter().filter(|own| is_named(weighed, own));
            let keys: Vec<&CauseKey> = causes.map(|own| &own.key).collect();
            if !tried.contains(&(finalist.correction, keys.clone())) {
                tried.push((finalist.correction, keys));
                let own = self.fitted(place, finalist, weighed)?;
                let error = |own: &Chosen| own.finalist.held_out.metrics.rmse;
                if best.as_ref().is_none_or(|best| error(&own) < error(best)) {
                    best = Some(own);
                }
            }
        }
        let Some(best) = best else { unreachable!("there is always a finalist") };
        Ok(best)
    }

    /// Returns a finalist fitted to an excerpt of the log, with its law, or with that of the base model if it is another one.
    fn fitted(
        &self,
        place: usize,
        finalist: &Finalist,
        weighed: &[WeighedCause],
    ) -> Result<Chosen, SpecError> {
        let mut corrected = CorrectedRows::new(self.log, self.rows, finalist, self.options);
        let is_meant = |own: &FinalistCause| is_named(weighed, own);
        let causes: Vec<FinalistCause> =
            finalist.causes.iter().filter(|own| is_meant(own)).cloned().collect();
        let law = law_kind(&finalist.law, &causes);
        let base = self.base(&excerpt(&corrected.fitted), &finalist.law, law)?;
        if has_free_phase(&causes)
            && let Some(aligned) = unknown_zero::aligned(&corrected.judged, &base)
        {
            corrected.align(&aligned);
        }
        if self.options.loss == Loss::Huber {
            corrected.weigh_robustly(&base);
        }
        if let Some(weighed) = uncertain_motion::weighed(&corrected.judged, &base) {
            corrected.judged = weighed.with_floor();
        }
        corrected.leave_out_rest(&base);
        let excerpt = excerpt(&corrected.fitted);
        let fit = |law: LawKind| {
            let from = (&base, &self.spec(law));
            fit_finalist(&excerpt, finalist, from, &is_meant, corrected.delay_s)
        };
        let mut own = fit(law)?;
        if base.spec.law != law {
            let other = fit(base.spec.law)?;
            if other.held_out.metrics.rmse < own.held_out.metrics.rmse {
                own = other;
            }
        }
        Ok(Chosen { place, corrected, excerpt, base, finalist: own })
    }

    /// Returns the chosen hypothesis with the causes that are still named.
    fn again(
        &self,
        chosen: &Chosen,
        weighed: &[WeighedCause],
    ) -> Result<FittedFinalist, SpecError> {
        let finalist = &self.outcome.finalists[chosen.place];
        let is_meant = |own: &FinalistCause| is_named(weighed, own);
        let from = (&chosen.base, &self.spec(chosen.finalist.model.spec.law));
        fit_finalist(&chosen.excerpt, finalist, from, &is_meant, chosen.corrected.delay_s)
    }

    /// Returns the base model: the law, or the linear law if that has the smaller held-out error.
    fn base(
        &self,
        excerpt: &TrainTest,
        start: &LawStart,
        law: LawKind,
    ) -> Result<FittedModel, SpecError> {
        let fit =
            |law: LawKind, start: Option<&LawStart>| -> Result<(f64, FittedModel), SpecError> {
                let spec = self.spec(law);
                let from = match (&self.options.given, start) {
                    (Some((_, parameters)), _) => Some(parameters.clone()),
                    (None, Some(start)) => Some(law_parameters(&spec, start, &[], excerpt)?),
                    (None, None) => None,
                };
                let model = fitted(excerpt, &spec, from.as_ref(), &[], None)?;
                Ok((one_step_left_out(excerpt, excerpt, &model).metrics.rmse, model))
            };
        let own = fit(law, Some(start))?;
        if !self.is_law_free() || law == LawKind::Linear {
            return Ok(own.1);
        }
        let linear = fit(LawKind::Linear, Some(start))?;
        if own.0 <= linear.0 {
            return Ok(own.1);
        }
        let again = fit(law, None)?;
        Ok(if again.0 <= linear.0 { again.1 } else { linear.1 })
    }
}

/// Largest p value of a finding that may be likely. The p value is the share of resampled logs without the cause, so that a
/// finding within the limit is stable.
const MAX_P_VALUE: f64 = 0.05;

/// Step of probabilities within which two causes are equally likely: the calibration is not more accurate.
const SAME_PROBABILITY: f64 = 0.05;

/// Highest probability of a finding above [`MAX_P_VALUE`].
const UNSTABLE: f64 = 0.59;

/// Lowers the probability of causes that make more torque than the log holds in every finalist that has them. In one of several
/// a cause may only cancel another.
fn check_torques(weighed: &mut [WeighedCause], outcome: &ContestOutcome, rows: &Rows) {
    let most = rows.torque.iter().fold(0.0f64, |most, torque| most.max(torque.abs()));
    let causes = || outcome.finalists.iter().flat_map(|finalist| &finalist.causes);
    for cause in weighed {
        let own = causes().filter(|own| own.key == cause.figures.key);
        let least = own.map(|own| own.torque_rms.0).reduce(f64::min);
        if let Some(least) = least.filter(|least| *least > most) {
            let (made, held) = (figure(least), figure(most));
            let why = format!("it would make a torque of {made} RMS in a log of {held} at most");
            cause.reject(IMPOSSIBLE, Rejection::new(&rules::UNPHYSICAL, why));
        }
    }
}

/// Returns true if a ripple has another phase in each run.
fn has_free_phase(causes: &[FinalistCause]) -> bool {
    let is_free =
        |detail: &Detail| matches!(detail, Detail::Waves { kind: WaveKind::FreePhase, .. });
    causes.iter().any(|cause| is_free(&cause.detail))
}

/// Returns true if a cause of a finalist is named.
fn is_named(weighed: &[WeighedCause], own: &FinalistCause) -> bool {
    weighed.iter().any(|weighed| weighed.figures.key == own.key && weighed.is_named())
}

/// Lowers the probability of causes whose fitted size is impossible.
fn check_sizes(weighed: &mut [WeighedCause], chosen: &Chosen, offer: &Offer) {
    let log = &chosen.corrected.judged;
    for realised in &offer.realised {
        let extended =
            Extended { outcome: &offer.outcome, log, follows: realised.follows.as_ref() };
        let size = realised.cause.size(&extended);
        let least = realised.cause.least_size(log);
        if let Some(own) = weighed.iter_mut().find(|own| realises(realised, own)) {
            own.check_size(&size, least);
        }
    }
}

/// Returns true if a realised cause is this one.
fn realises(realised: &Realised, own: &WeighedCause) -> bool {
    let follows = realised.follows.as_ref().map(|follows| follows.column.as_str());
    realised.cause == own.cause && follows.is_none_or(|column| own.figures.key.columns == [column])
}

/// Sets what the driver's law keeps less than the linear promise.
fn set_shortfall(
    weighed: &mut [WeighedCause],
    finalists: &[Finalist],
    chosen: &Chosen,
    (before, offer): (&Predicted, Option<&Offer>),
) {
    let Some(finalist) = finalists.get(chosen.place) else { return };
    let taken = |before: f64, after: f64| 1.0 - (after / before.max(f64::MIN_POSITIVE)).powi(2);
    let promised = taken(finalist.law_rmse, finalist.rmse);
    let kept = offer.map_or(0.0, |offer| taken(before.metrics.rmse, offer.after.metrics.rmse));
    let shortfall = (1.0 - kept / promised.max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    for own in weighed.iter_mut().filter(|own| own.is_named()) {
        own.shortfall = Some(shortfall);
    }
}

/// Returns the findings: the named causes, with the size that the extended model gives them.
fn findings(
    weighed: &[WeighedCause],
    chosen: &Chosen,
    offer: Option<&Offer>,
    outcome: &ContestOutcome,
) -> Vec<Finding> {
    let named = weighed.iter().filter(|own| own.is_named());
    let finding = |own: &WeighedCause| {
        let realised = offer.and_then(|offer| {
            let own = offer.realised.iter().find(|realised| realises(realised, own))?;
            Some((own, offer))
        });
        let mut finding = match realised {
            Some((realised, offer)) => in_model(realised, offer, &chosen.corrected.judged),
            None => outside_model(own, outcome, &chosen.corrected.judged),
        };
        let figures = &own.figures;
        finding.p_value = (1.0 - figures.inclusion).max(1.0 / DRAWS as f64);
        finding.stability = figures.inclusion;
        let is_sure = finding.p_value <= MAX_P_VALUE;
        finding.probability = if is_sure { own.probability } else { own.probability.min(UNSTABLE) };
        finding.share_of_residual = figures.last.clamp(0.0, 1.0);
        finding.gain = figures.gain;
        finding.confusable_with = confounded(weighed, figures);
        let rivals: Vec<&str> =
            finding.confusable_with.iter().map(|rival| rival.cause.name()).collect();
        if !rivals.is_empty() {
            finding.in_words +=
                &format!("; this log cannot distinguish it from {}", rivals.join(" or "));
        }
        finding
    };
    let mut findings: Vec<Finding> = named.map(finding).collect();
    // Chance names a cause that most resampled logs do not show.
    findings.retain(|own| own.is_in_model || own.stability >= MIN_STABILITY);
    // Of equally likely causes the more material one stays first.
    let rank = |own: &Finding| (own.probability / SAME_PROBABILITY).floor();
    findings.sort_by(|a, b| rank(b).total_cmp(&rank(a)));
    findings
}

/// Minimum share of the resampled logs that show a cause without a term in the model.
const MIN_STABILITY: f64 = 0.5;

/// A finding whose term is in the extended model.
fn in_model(realised: &Realised, offer: &Offer, log: &TrainTest) -> Finding {
    let extended = Extended { outcome: &offer.outcome, log, follows: realised.follows.as_ref() };
    let cause = realised.cause;
    let size = cause.size(&extended);
    Finding {
        in_words: cause.in_words(&size, &extended),
        order: cause.order(&extended),
        evidence: cause.evidence(&realised.columns, &extended),
        columns: realised.columns.clone(),
        size,
        is_in_model: true,
        ..Finding::of(cause)
    }
}

/// A finding that the extended model has no term for: its size is the torque that it makes.
fn outside_model(own: &WeighedCause, outcome: &ContestOutcome, log: &TrainTest) -> Finding {
    let causes = outcome.finalists.iter().flat_map(|finalist| &finalist.causes);
    let (rms, error) = causes
        .clone()
        .find(|cause| cause.key == own.figures.key)
        .map_or((0.0, 0.0), |cause| cause.torque_rms);
    let size = Size::new(rms, error, log.train.joint.torque_unit());
    let mut in_words =
        format!("{}: it makes a torque of {} RMS", own.cause.meaning(), size.in_words());
    if !own.figures.detail.is_empty() {
        in_words += &format!(" ({})", own.figures.detail);
    }
    Finding { in_words, columns: own.columns(), size, ..Finding::of(own.cause) }
}

#[cfg(test)]
mod tests;
