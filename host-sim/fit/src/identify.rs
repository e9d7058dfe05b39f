//! Identification: a fit with estimates, standard errors, metrics and verdicts.

use super::determined::Evidence;
use super::legal::fit_legal;
use super::outcome::{Estimate, Outcome, State};
use super::passive::{passive_fit, reported};
use super::predict::{Predicted, predict};
use super::reason::Reason;
use super::solve::{FitOptions, Solution, unobserved_parameters};
use super::statistics::autocorrelation_time;
use super::track::Rows;
use super::verdict::verdicts;
use crate::clock::Instant;
use crate::spec::{Spec, SpecError};
use compensator_core::{ParameterId, Parameters};
use nalgebra::DMatrix;

/// Fits a model to the training rows and evaluates it on the test rows.
///
/// # Errors
/// If the model carries more terms than the core takes.
pub fn identify(
    spec: &Spec,
    base: &Parameters<f64>,
    train: Rows,
    test: Rows,
    options: &FitOptions,
) -> Result<Outcome, SpecError> {
    let begin = Instant::now();
    let rows = [train, test];
    let (solution, parameters) = fit_legal(spec, base, rows, options);
    let passive = match options.passive {
        true => passive_fit(spec, &parameters, &solution, rows, options),
        false => None,
    };
    let (alone, errors) = evaluate(spec, solution, parameters, rows);
    let mut outcome = match passive {
        Some(form) => {
            let of_form = evaluate(spec, form.solution.clone(), form.parameters.clone(), rows);
            let evaluations = alone.evaluations + of_form.0.evaluations;
            Outcome { evaluations, ..reported((alone, errors), of_form, form) }
        }
        None => alone,
    };
    outcome.seconds = begin.elapsed().as_secs_f64();
    ensure_loadable(&mut outcome);
    Ok(outcome)
}

/// Returns the outcome of a fit, and its errors on the held-out rows.
fn evaluate(
    spec: &Spec,
    solution: Solution,
    parameters: Parameters<f64>,
    [train, test]: [Rows; 2],
) -> (Outcome, Predicted) {
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
    (outcome, held_out)
}

/// Ensures that the core accepts the parameters. For a law that is not passive (damping above the passivity bound, friction
/// that falls with speed) this sets `allow_active`. If the core still rejects the parameters, a verdict reports it.
fn ensure_loadable(outcome: &mut Outcome) {
    // In the driver's number type, because rounding to f32 can cross a bound.
    let refusal = |parameters: &Parameters<f64>| {
        let rounded = parameters.convert::<f32>();
        parameters.validate().and_then(|()| rounded.validate()).err()
    };
    let Some(error) = refusal(&outcome.parameters) else { return };
    outcome.parameters.choices.allow_active = true;
    match refusal(&outcome.parameters) {
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
