//! Selection of the base law.
//!
//! The base law is the simplest law that the log supports. The search for causes compares every
//! extended model with it. The laws are the linear law, the law with a Stribeck curve, and the
//! LuGre law with bristles.
//!
//! A law with more parameters is selected if it lowers `n ln(SSE) + k ln n`. Here `n` is the number
//! of *independent* rows and `k` the number of parameters. If a log supports bristles but not their
//! Stribeck curve, the Dahl law is selected.
//!
//! A log of steady sliding supports no bristles. The search then excludes the causes that require
//! bristles.

use super::model::{FittedModel, again};
use super::train_test::{AtRest, TrainTest};
use ParameterId as Id;
use compensator_core::{LawKind, ParameterId, Parameters};
use friction_fit::scales::Scales;
use friction_fit::solve::{COMPARISON_STAGNATION, COMPARISON_TOLERANCE};
use friction_fit::spec::{Spec, SpecError};
use friction_fit::statistics::autocorrelation_time;
use friction_fit::{FitOptions, Track, fit};

/// Laws in order of increasing complexity.
const LADDER: [LawKind; 3] = [LawKind::Linear, LawKind::Stribeck, LawKind::Lugre];

/// Number of starting points that a fit of the base law follows to convergence.
const STARTS: usize = 2;

/// Simulations per parameter in a fit of the base law. A law that the log does not support
/// converges slowly and is rejected anyway. Reported models are fitted to convergence.
const PATIENCE: usize = 8;

/// Largest plausible ratio of breakaway torque to Coulomb torque. Published values for seals reach
/// 1.8, and 3 is rare.
const HIGHEST_BREAKAWAY: f64 = 4.0;

/// Lower bound of the Stribeck velocity, as a share of the log's top speed.
const SLOWEST_CURVE: f64 = 1e-3;

/// Returns the fit of a law. It starts from the given parameters, or from scratch if there are
/// none.
///
/// # Errors
/// Returns an error if there are more terms than the core accepts.
fn fitted(
    log: &TrainTest,
    spec: &Spec,
    start: Option<&Parameters<f64>>,
) -> Result<FittedModel, SpecError> {
    let base = match start {
        Some(start) => start.clone(),
        None => spec.parameters()?,
    };
    let options = FitOptions {
        starts: STARTS,
        start: start.cloned(),
        patience: PATIENCE,
        tolerance: COMPARISON_TOLERANCE,
        stagnation: COMPARISON_STAGNATION,
        ..FitOptions::default()
    };
    let solution = fit(spec, &base, log.train_rows(), &options);
    Ok(FittedModel {
        spec: spec.clone(),
        parameters: solution.parameters(),
        free: solution.coordinates.ids().collect(),
        fixed: Vec::new(),
        resolution: solution.resolution,
        sse: solution.reduced.sum_of_squares(),
        follows: None,
    })
}

/// The base model of a log, and the rows that it cannot be evaluated on.
#[derive(Clone, Debug)]
pub struct Baseline {
    /// The base model.
    pub model: FittedModel,
    /// Rows at rest, if the base model does not describe them.
    pub at_rest: Option<AtRest>,
}

/// Returns the base model that is selected for a log.
///
/// # Errors
/// Returns an error if the rigid-body terms alone are more terms than the core accepts.
pub fn choose(log: &TrainTest) -> Result<Baseline, SpecError> {
    let whole_ladder = |log: &TrainTest| without_curve(log, climb(log, &LADDER)?);
    let best = whole_ladder(log)?;
    if best.spec.law.has_bristles() {
        return judged(log, best, whole_ladder);
    }
    // The selection has rejected the laws with bristles. Without the rows at rest, only the other
    // laws remain.
    judged(log, best, |log| climb(log, &LADDER[..2]))
}

/// Returns the base model for a requested law. The fit starts from the given parameters, or from
/// scratch.
///
/// # Errors
/// Returns an error if there are more terms than the core accepts.
pub fn asked_for(
    log: &TrainTest,
    spec: &Spec,
    start: Option<&Parameters<f64>>,
) -> Result<Baseline, SpecError> {
    judged(log, fitted(log, spec, start)?, |log| fitted(log, spec, start))
}

/// Largest ratio of squared errors at which rows at rest are excluded for a law with bristles,
/// dimensionless.
///
/// The ratio compares the squared error on rows in motion, fitted without and with the rows at
/// rest. A law with bristles predicts the torque at rest. If the encoder step is wider than the
/// deflection of the bristles, this prediction is wrong: the torque changes while the angle stands
/// still. A small ratio shows that rows at rest distort the fit in motion. If the law is correct at
/// rest, the ratio is close to 1.
const MAX_MOTION_ERROR_RATIO: f64 = 0.8;

/// Returns the base model for a fitted law.
///
/// The rows at rest are excluded if the law does not describe them or if they distort its fit in
/// motion. The law is then refitted without them.
fn judged(
    log: &TrainTest,
    model: FittedModel,
    again: impl Fn(&TrainTest) -> Result<FittedModel, SpecError>,
) -> Result<Baseline, SpecError> {
    let squares = |log: &TrainTest| {
        let metrics = model.on_train(log).metrics;
        (metrics.sse, metrics.rows)
    };
    let Some(at_rest) = log.worse_at_rest(squares) else {
        return Ok(Baseline { model, at_rest: None });
    };
    let moving = log.clone().without(&at_rest);
    let unmisled = again(&moving)?;
    let in_motion = |model: &FittedModel| model.on_train(&moving).metrics.sse;
    if model.spec.law.has_bristles()
        && in_motion(&unmisled) > MAX_MOTION_ERROR_RATIO * in_motion(&model)
    {
        return Ok(Baseline { model, at_rest: None });
    }
    Ok(Baseline { model: unmisled, at_rest: Some(at_rest) })
}

fn climb(log: &TrainTest, ladder: &[LawKind]) -> Result<FittedModel, SpecError> {
    let mut best: Option<FittedModel> = None;
    for law in ladder {
        let next = fitted(log, &Spec::law(*law).on(&log.rigid_body), None)?;
        best = match best {
            Some(best) if !is_worth_it(log, &best, &next) => Some(best),
            _ => Some(next),
        };
    }
    best.map_or_else(|| fitted(log, &Spec::law(LawKind::Linear), None), Ok)
}

/// Returns the Dahl law if the log supports bristles but not their Stribeck curve; otherwise
/// `best`.
///
/// If the log does not determine a parameter, a fit to some of the runs is inaccurate on the
/// others. This error hides the causes. A LuGre fit may also end at bristles that never slip. If
/// the LuGre law was rejected, the Dahl law is therefore compared with the best law without
/// bristles.
fn without_curve(log: &TrainTest, best: FittedModel) -> Result<FittedModel, SpecError> {
    let plain = || fitted(log, &Spec::law(LawKind::Dahl).on(&log.rigid_body), None);
    if best.spec.law == LawKind::Lugre {
        let plain = plain()?;
        return Ok(if is_worth_it(log, &plain, &best) { best } else { plain });
    }
    let plain = plain()?;
    Ok(if is_worth_it(log, &best, &plain) { plain } else { best })
}

/// Returns the LuGre law as the new base law of a log whose base law is the Dahl law.
///
/// It is returned if the log supports it beside the accepted causes, or if no cause was accepted.
/// While causes are missing in the model, their error may hide a Stribeck curve. Returns `None` for
/// any other base law and for an implausible Stribeck curve.
///
/// # Errors
/// Returns an error if there are more terms than the core accepts.
pub fn reselect_base_law(
    log: &TrainTest,
    base: &FittedModel,
    extended: &FittedModel,
) -> Result<Option<FittedModel>, SpecError> {
    if base.spec.law != LawKind::Dahl {
        return Ok(None);
    }
    let richer = fitted(log, &Spec::law(LawKind::Lugre).on(&log.rigid_body), None)?;
    if has_wild_curve(log, &richer) {
        return Ok(None);
    }
    if extended.spec == base.spec {
        return Ok(Some(richer));
    }
    let mut spec = extended.spec.clone();
    spec.law = LawKind::Lugre;
    let mut parameters = spec.parameters()?;
    parameters.choices = richer.parameters.choices;
    for from in [&extended.parameters, &richer.parameters] {
        for id in from.active() {
            parameters.set(id, from.get(id));
        }
    }
    let start = FittedModel {
        free: Vec::new(),
        resolution: richer.resolution,
        spec,
        parameters,
        ..extended.clone()
    };
    let log = &*log.following(extended.follows.as_ref());
    let with_causes = again(log.train_rows(), &start);
    Ok(is_worth_it(log, extended, &with_causes).then_some(richer))
}

/// Returns true if the bristles of a law act as a spring and not as friction.
///
/// This is the case if one of these conditions holds:
///
/// - They deflect further than the longest stroke.
/// - They hold more than the largest measured torque.
/// - Their stiffness is at its lower bound.
fn never_slips(log: &TrainTest, model: &FittedModel) -> bool {
    let parameters = &model.parameters;
    let level = parameters.get(Id::StaticTorque).max(parameters.get(Id::CoulombTorque));
    let stiffness = Id::BristleStiffness;
    let at_bound = parameters.get(stiffness) < 1.01 * stiffness.info().lower;
    let travel = level / parameters.get(stiffness).max(f64::MIN_POSITIVE);
    let stroke = |track: &Track| {
        let (mut at, mut low, mut high) = (0.0f64, 0.0f64, 0.0f64);
        for (row, sample) in track.samples.iter().enumerate() {
            let ratio = track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
            at += sample.velocity_rad_s * track.period_s * ratio;
            (low, high) = (low.min(at), high.max(at));
        }
        high - low
    };
    let torques = log.train_tracks.iter().flat_map(|track| &track.torque);
    let largest = torques.fold(0.0f64, |largest, torque| largest.max(torque.abs()));
    model.spec.law.has_bristles()
        && (at_bound
            || travel > log.train_tracks.iter().map(stroke).fold(0.0, f64::max)
            || parameters.get(Id::CoulombTorque) > largest)
}

/// Returns true if the Stribeck curve of bristles is implausible.
///
/// The ratio of breakaway to Coulomb torque is then too high, or the Stribeck velocity is at its
/// lower bound. A track that starts at rest with more torque than the law can hold leads to such a
/// curve.
fn has_wild_curve(log: &TrainTest, model: &FittedModel) -> bool {
    let parameters = &model.parameters;
    let has_curve = parameters.law.parameters().contains(&Id::StribeckVelocity);
    let slowest = 1.01 * SLOWEST_CURVE * Scales::of(&log.train_tracks).speed;
    model.spec.law.has_bristles()
        && has_curve
        && (parameters.get(Id::StaticTorque)
            > HIGHEST_BREAKAWAY * parameters.get(Id::CoulombTorque)
            || parameters.get(Id::StribeckVelocity) < slowest)
}

/// Returns the number of training rows divided by the model's residual autocorrelation time in
/// rows.
pub fn independent_rows(log: &TrainTest, model: &FittedModel) -> f64 {
    let predicted = model.on_train(log);
    let memory = autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice));
    predicted.metrics.rows as f64 / memory
}

fn is_worth_it(log: &TrainTest, simple: &FittedModel, rich: &FittedModel) -> bool {
    if never_slips(log, rich) || has_wild_curve(log, rich) {
        return false;
    }
    let rows = independent_rows(log, rich);
    let more = rich.free.len() as f64 - simple.free.len() as f64;
    let ratio = simple.sse.max(f64::MIN_POSITIVE) / rich.sse.max(f64::MIN_POSITIVE);
    rows * ratio.ln() > more * rows.max(2.0).ln()
}

#[cfg(test)]
mod tests;
