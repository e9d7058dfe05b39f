//! Identification: a fit with estimates, standard errors, metrics and verdicts.

use super::legal::fit_legal;
use super::outcome::{Estimate, Outcome, State};
use super::passive::{passive_fit, reported};
use super::predict::{Predicted, predict};
use super::scales::Scales;
use super::solve::{FitOptions, Solution, unobserved_parameters};
use super::statistics::{autocorrelation_time, inverse_information};
use super::track::Rows;
use super::verdict::verdicts;
use crate::clock::Instant;
use crate::dual::Dual;
use crate::spec::{Spec, SpecError};
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters};
use nalgebra::DMatrix;

/// Relative standard error of a positive parameter above which it is "not determined": values from half to twice as large
/// are then within two standard errors. The prior alone gives 2.3.
const MAX_RELATIVE_ERROR: f64 = 0.5;

/// Effect of two standard errors on the torque, as a share of its RMS, above which any other parameter is "not determined",
/// unless its value differs from 0 by three standard errors.
const MAX_ERROR_EFFECT: f64 = 0.2;

/// Derivative that counts as 0, as a share of the torque's RMS.
const NEGLIGIBLE_EFFECT: f64 = 1e-9;

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
            let own = evaluate(spec, form.solution.clone(), form.parameters.clone(), rows);
            let evaluations = alone.evaluations + own.0.evaluations;
            Outcome { evaluations, ..reported((alone, errors), own, form) }
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
    outcome.verdicts = verdicts(&outcome, &unobserved, &predicted, train.tracks);
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
            "the law can give out energy and so keep a joint moving ({error}); params.toml sets allow_active, and a driver \
             warns when it runs the law. `identify` without --choices allow_active fits a passive law"
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
    let reduced = &solution.reduced;
    let count = solution.coordinates.len();
    let free: Vec<Id> = solution.coordinates.ids().collect();
    let spare = reduced.rows.saturating_sub(count).max(1) as f64;
    let variance = time * reduced.sum_of_squares() / spare;
    let covariance = inverse_information(reduced) * variance;
    // d(parameter)/d(coordinate), exact to rounding, from the same dual numbers as the fit.
    let seeded: Vec<Dual<40>> =
        solution.point.iter().enumerate().map(|(i, u)| Dual::parameter(*u, i)).collect();
    let natural = solution.coordinates.parameters(&seeded);
    let change = DMatrix::from_fn(count, count, |i, j| natural.get(free[i]).gradient[j]);
    let natural_covariance = &change * &covariance * change.transpose();
    let torque = Scales::of(rows.tracks).torque;
    let norm = |j: usize| -> f64 {
        let squares = (0..count).map(|i| reduced.factor[i * count + j].powi(2)).sum::<f64>();
        (squares / reduced.rows.max(1) as f64).sqrt()
    };
    let state = |index: usize, id: Id, error: f64| {
        let (point, start) =
            (solution.point[index], solution.coordinates.point(&solution.start)[index]);
        let value = parameters.get(id);
        if solution.coordinates.is_at_bound(index, &solution.point, parameters) {
            return State::AtBound;
        }
        let moved = (point - start).abs() > 1e-6 * (1.0 + start.abs());
        if !moved && norm(index) < NEGLIGIBLE_EFFECT * torque {
            return State::AtStart;
        }
        let positive = id.info().lower > 0.0;
        // RMS change of the torque per unit of the parameter.
        let effect = norm(index) / change[(index, index)].abs().max(f64::MIN_POSITIVE);
        let is_loose = if solution.coordinates.is_held_by_prior(index) {
            covariance[(index, index)].sqrt() > MAX_RELATIVE_ERROR
        } else if positive {
            error > MAX_RELATIVE_ERROR * value.abs()
        } else {
            // Not significantly different from 0, or with a large effect of its error.
            value.abs() < 2.0 * error
                || 2.0 * error * effect > MAX_ERROR_EFFECT * torque && value.abs() < 3.0 * error
        };
        if is_loose || !error.is_finite() { State::NotDetermined } else { State::Determined }
    };
    let estimates = parameters
        .active()
        .map(|id| {
            let value = parameters.get(id);
            match free.iter().position(|free| *free == id) {
                Some(index) => {
                    let error = natural_covariance[(index, index)].max(0.0).sqrt();
                    let state = state(index, id, error);
                    Estimate { id, value, std_error: Some(error.min(f64::MAX)), state }
                }
                None => {
                    let lost = unobserved.contains(&id) || solution.collinear.contains(&id);
                    let state = if lost { State::NotDetermined } else { State::AtStart };
                    Estimate { id, value, std_error: None, state }
                }
            }
        })
        .collect();
    let errors: Vec<f64> =
        (0..count).map(|i| natural_covariance[(i, i)].max(f64::MIN_POSITIVE).sqrt()).collect();
    let correlation = DMatrix::from_fn(count, count, |i, j| {
        (natural_covariance[(i, j)] / (errors[i] * errors[j])).clamp(-1.0, 1.0)
    });
    (estimates, correlation)
}
