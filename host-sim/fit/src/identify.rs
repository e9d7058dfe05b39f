//! Identification: a fit with estimates, standard errors, metrics and verdicts.

use super::determined::Evidence;
use super::legal::fit_legal;
use super::outcome::{Estimate, Outcome, State};
use super::passive::{EvaluatedFit, PassiveFit, passive_fit, reported};
use super::predict::predict;
use super::reason::Reason;
use super::solve::{FitOptions, Solution, unobserved_parameters};
use super::statistics::autocorrelation_time;
use super::track::Rows;
use super::verdict::verdicts;
use crate::clock::Instant;
use crate::spec::Spec;
use compensator_core::{ParameterError, ParameterId, Parameters};
use nalgebra::DMatrix;

/// Fits a model to the training rows and evaluates it on the test rows.
pub fn identify(
    spec: &Spec,
    base: &Parameters<f64>,
    train: Rows,
    test: Rows,
    options: &FitOptions,
) -> Outcome {
    let begin = Instant::now();
    let rows = [train, test];
    let (solution, parameters) = fit_legal(spec, base, rows, options);
    let passive = options.passive.then(|| passive_fit(spec, &parameters, &solution, rows, options));
    let alone = evaluate(spec, solution, parameters, rows);
    let mut outcome = match passive.flatten() {
        Some(PassiveFit { solution, parameters, changes }) => {
            let passive = evaluate(spec, solution, parameters, rows);
            let evaluations = alone.outcome.evaluations + passive.outcome.evaluations;
            Outcome { evaluations, ..reported(alone, passive, changes) }
        }
        None => alone.outcome,
    };
    outcome.seconds = begin.elapsed().as_secs_f64();
    ensure_loadable(&mut outcome);
    outcome
}

fn evaluate(
    spec: &Spec,
    solution: Solution,
    parameters: Parameters<f64>,
    [train, test]: [Rows; 2],
) -> EvaluatedFit {
    let predicted = predict(&parameters, train, solution.resolution);
    let held_out = predict(&parameters, test, solution.resolution);
    let time = autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice));
    let unobserved = unobserved_parameters(spec, train.tracks);
    let (estimates, correlation) = estimates(&solution, &parameters, train, time, &unobserved);
    let train_metrics = predicted.metrics;
    let rows = train_metrics.rows as f64;
    let count = solution.coordinates.len() as f64;
    let mut outcome = Outcome {
        spec: spec.clone(),
        estimates,
        correlation,
        train: train_metrics,
        test: held_out.metrics,
        bic: rows * (train_metrics.sse.max(f64::MIN_POSITIVE) / rows.max(1.0)).ln()
            + count * rows.max(1.0).ln(),
        seconds: 0.0,
        evaluations: solution.evaluations,
        resolution: solution.resolution,
        autocorrelation_time: time,
        converged: solution.converged,
        verdicts: Vec::new(),
        driver_form: None,
        parameters,
    };
    outcome.verdicts = verdicts(&outcome, &predicted, train.tracks);
    EvaluatedFit { outcome, held_out }
}

/// Returns why a driver rejects the parameters. The driver's number type counts too, because rounding to `f32` can cross a bound.
fn refusal(parameters: &Parameters<f64>) -> Option<ParameterError> {
    let rounded = parameters.convert::<f32>();
    parameters.validate().and_then(|()| rounded.validate()).err()
}

/// Ensures that the core accepts the parameters. A law that is refused only because it is not passive (damping above the
/// passivity bound, friction that falls with speed) gets `allow_active`. Parameters that are refused for another reason keep
/// the choice as it was, so that correcting them releases no active law. A verdict reports what the core rejects.
fn ensure_loadable(outcome: &mut Outcome) {
    if let Some(error) = outcome.driver_form.as_ref().and_then(|form| refusal(&form.parameters)) {
        outcome.verdicts.push(format!("the core rejects the parameters for a driver: {error}"));
    }
    let Some(error) = refusal(&outcome.parameters) else { return };
    let mut active = outcome.parameters.clone();
    active.choices.allow_active = true;
    let remaining = refusal(&active);
    if remaining.is_none() {
        outcome.parameters = active;
    }
    match remaining {
        None if outcome.driver_form.is_some() => {}
        None => outcome.verdicts.push(format!(
            "the law can supply energy and so keep a joint moving ({error}); params.toml sets allow_active, and a driver \
             warns when it runs the law. `identify` without --choices allow_active fits a law that only dissipates energy"
        )),
        Some(error) => outcome.verdicts.push(format!("the core rejects these parameters: {error}")),
    }
}

/// Returns the estimates of all parameters, and the correlation matrix of the free ones.
fn estimates(
    solution: &Solution,
    parameters: &Parameters<f64>,
    rows: Rows,
    time: f64,
    unobserved: &[ParameterId],
) -> (Vec<Estimate>, DMatrix<f64>) {
    let evidence = Evidence::of(solution, parameters, rows, time);
    let estimate = |id| {
        let value = parameters.get(id);
        let (std_error, (state, reason)) = match evidence.position(id) {
            Some(index) => (Some(evidence.error(index).min(f64::MAX)), evidence.state(index)),
            None if unobserved.contains(&id) => {
                (None, (State::NotDetermined, Some(Reason::NoColumn)))
            }
            None if solution.collinear.contains(&id) => {
                (None, (State::NotDetermined, Some(Reason::Combination)))
            }
            None => (None, (State::AtStart, None)),
        };
        Estimate { id, value, std_error, state, reason }
    };
    (parameters.active().map(estimate).collect(), evidence.correlation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Track;
    use compensator_core::{ParameterId as Id, Sample};

    /// A fit of a law that must be passive, whose parameters a test changes.
    fn fitted() -> Outcome {
        let velocity = |row: usize| 2.0 * (0.02 * row as f64).sin();
        let samples: Vec<Sample<f64>> = (0..1000)
            .map(|row| Sample { velocity_rad_s: velocity(row), ..Sample::default() })
            .collect();
        let torque = (0..1000).map(|row| 0.5 * velocity(row).signum() + 0.2 * velocity(row));
        let tracks = [Track::even(samples, torque.collect(), 0.01)];
        let rows = Rows { tracks: &tracks, decimate: 1 };
        let spec = Spec::parse("lugre").expect("a model");
        let base = spec.parameters().expect("parameters");
        identify(&spec, &base, rows, rows, &FitOptions { starts: 1, ..FitOptions::default() })
    }

    fn loadable(static_torque: f64, viscous_friction: f64) -> Outcome {
        let mut outcome = fitted();
        outcome.verdicts.clear();
        outcome.parameters.choices.allow_active = false;
        outcome.parameters.set(Id::CoulombTorque, 0.5);
        outcome.parameters.set(Id::StaticTorque, static_torque);
        outcome.parameters.set(Id::ViscousFriction, viscous_friction);
        ensure_loadable(&mut outcome);
        outcome
    }

    #[test]
    fn ensure_loadable_with_active_law_sets_allow_active() {
        let outcome = loadable(0.6, -0.2);
        assert!(outcome.parameters.choices.allow_active);
        assert!(outcome.verdicts[0].contains("params.toml sets allow_active"), "{outcome:?}");
    }

    #[test]
    fn ensure_loadable_with_wrong_levels_keeps_allow_active_off() {
        let outcome = loadable(0.3, -0.2);
        assert!(!outcome.parameters.choices.allow_active);
        assert!(outcome.verdicts[0].contains("the core rejects"), "{:?}", outcome.verdicts);
    }
}
