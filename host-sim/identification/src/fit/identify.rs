//! A fit and what it says: values, errors, metrics, verdicts.

use super::outcome::{Estimate, Outcome, State};
use super::predict::predict;
use super::scales::Scales;
use super::solve::{FitOptions, Solution, fit, unseen};
use super::statistics::{autocorrelation_time, inverse_information};
use super::track::{Rows, Track};
use super::verdict::verdicts;
use crate::dual::Dual;
use crate::number::significant;
use crate::spec::{Spec, SpecError};
use ParameterId as Id;
use compensator_core::parameters::Envelope;
use compensator_core::{ParameterId, Parameters};
use nalgebra::DMatrix;
use std::time::Instant;

/// A relative standard error of a positive parameter above this is "not determined": values from
/// half to twice as large are within two errors. (The prior alone gives 2.3.)
const LOOSE: f64 = 0.5;

/// For other parameters: two standard errors change the torque by more than this share of its RMS,
/// and the value is not three of them away from nothing.
const LOOSE_EFFECT: f64 = 0.2;

/// Derivatives below this share of the torque's RMS are none.
const NO_EFFECT: f64 = 1e-9;

/// Fits a model on the training rows and judges it on the others.
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
    let mut made_passive = Vec::new();
    let (mut solution, mut parameters) = fitted(spec, base, train, test, options);
    if options.passive {
        let mut steps = 0;
        let mut options = FitOptions { starts: 1, ..options.clone() };
        while let Some(step) = towards_passivity(&mut parameters, &mut options, steps) {
            // What the rows would have is told once.
            if made_passive.iter().all(|earlier: &Passive| earlier.id != step.id) {
                made_passive.push(step);
            }
            steps += 1;
            options.start = Some(parameters.clone());
            let evaluations = solution.evaluations;
            (solution, parameters) = fitted(spec, &parameters, train, test, &options);
            solution.evaluations += evaluations;
        }
    }
    let predicted = predict(&parameters, train, solution.resolution);
    let time = autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice));
    let unseen = unseen(spec, train.tracks);
    let (estimates, correlation) = estimates(&solution, &parameters, train, time, &unseen);
    let train_metrics = predicted.metrics;
    let rows = train_metrics.rows as f64;
    let count = solution.coordinates.len() as f64;
    let mut outcome = Outcome {
        spec: spec.clone(),
        estimates,
        correlation,
        train: train_metrics,
        test: predict(&parameters, test, solution.resolution).metrics,
        bic: rows * (train_metrics.sse.max(f64::MIN_POSITIVE) / rows.max(1.0)).ln()
            + count * rows.max(1.0).ln(),
        seconds: begin.elapsed().as_secs_f64(),
        evaluations: solution.evaluations,
        resolution: solution.resolution,
        autocorrelation_time: time,
        converged: solution.converged,
        verdicts: Vec::new(),
        parameters,
    };
    outcome.verdicts = verdicts(&outcome, &unseen, &predicted, train.tracks);
    for Passive { id, says } in made_passive {
        // Where the rows would have it and the law may not: its own words in place of "kept".
        if let Some(estimate) = outcome.estimates.iter_mut().find(|e| Some(e.id) == id) {
            estimate.state = State::AtBound;
        }
        outcome.verdicts.push(says);
    }
    accept_what_was_fitted(&mut outcome);
    Ok(outcome)
}

/// A fit, its parameters legal and their envelope declared.
fn fitted(
    spec: &Spec,
    base: &Parameters<f64>,
    train: Rows,
    test: Rows,
    options: &FitOptions,
) -> (Solution, Parameters<f64>) {
    let solution = fit(spec, base, train, options);
    let mut parameters = solution.parameters();
    keep_legal(&mut parameters, solution.coordinates.ids());
    declare_envelope(&mut parameters, train.tracks, test.tracks);
    (solution, parameters)
}

/// What was done to a law so that it gives out no energy.
struct Passive {
    /// The parameter that was brought to its bound, if one was.
    id: Option<Id>,
    /// In words.
    says: String,
}

/// Brings a law that can give out energy one step nearer to one that cannot, for the rest to be fitted anew; `None`
/// where it is passive, or nothing helps. First the damping fades with speed, as a film takes over from the
/// asperities: that leaves its size to the rows, and is passive for all but the largest. Then what is too large goes
/// to its bound.
fn towards_passivity(
    parameters: &mut Parameters<f64>,
    options: &mut FitOptions,
    steps: usize,
) -> Option<Passive> {
    // The bound falls as the other parameters follow: each time it is taken with more room.
    const INSIDE: [f64; 5] = [0.95, 0.95, 0.8, 0.5, 0.2];
    if parameters.choices.allow_active {
        return None;
    }
    let inside = INSIDE.get(steps)?;
    let viscous = parameters.get(Id::ViscousFriction);
    if parameters.law.has_bristles() && viscous < 0.0 {
        parameters.set(Id::ViscousFriction, 0.0);
        options.fixed.push(Id::ViscousFriction);
        let says = format!(
            "viscous_friction: at its bound, 0: these rows would have it {}, and below 0 it drives instead of braking",
            significant(viscous, 3)
        );
        return Some(Passive { id: Some(Id::ViscousFriction), says });
    }
    let largest = parameters.active_damping()?;
    let damping = significant(parameters.get(Id::BristleDamping), 3);
    if !parameters.choices.damping_fades && !options.fixed.contains(&Id::BristleDamping) {
        parameters.choices.damping_fades = true;
        let says = format!(
            "the bristle damping fades with speed (damping_fades): a constant one, {damping} on these rows, could give \
             out energy, of which {} is the most that cannot",
            significant(largest, 3)
        );
        return Some(Passive { id: None, says });
    }
    parameters.set(Id::BristleDamping, inside * largest);
    if !options.fixed.contains(&Id::BristleDamping) {
        options.fixed.push(Id::BristleDamping);
    }
    let says = format!(
        "bristle_damping: at its bound: these rows would have it {damping}, and more than {} can give out energy",
        significant(largest, 3)
    );
    Some(Passive { id: Some(Id::BristleDamping), says })
}

/// Brings what a degenerate log drove to the end of its legal range a rounding of `f32` inside it. What was
/// kept is as legal as it was given, and may be a choice with a number: the last column's, a rounding below,
/// is the one before it.
fn keep_legal(parameters: &mut Parameters<f64>, free: impl Iterator<Item = Id>) {
    const ROUNDING: f64 = 1e-6;
    for id in free {
        let info = id.info();
        let (least, most) =
            (info.lower + ROUNDING * info.lower.abs(), info.upper - ROUNDING * info.upper.abs());
        parameters.set(id, parameters.get(id).max(least).min(most));
    }
    for (coulomb, static_torque) in [
        (Id::CoulombTorque, Id::StaticTorque),
        (Id::CoulombTorqueNegative, Id::StaticTorqueNegative),
    ] {
        let least = parameters.get(coulomb);
        parameters.set(static_torque, parameters.get(static_torque).max(least));
    }
}

/// The core takes no larger envelope.
const LARGEST_ENVELOPE: f64 = 1e9;

/// The envelope the data cover, with room; what they do not cover keeps its default.
fn declare_envelope(parameters: &mut Parameters<f64>, train: &[Track], test: &[Track]) {
    let samples = || train.iter().chain(test).flat_map(|track| &track.samples);
    let covers = |field: &mut f32, of: fn(&compensator_core::Sample<f64>) -> f64, room: f64| {
        let largest = samples().map(of).map(f64::abs).fold(0.0, f64::max);
        if largest > 0.0 {
            *field = (largest * room).clamp(1e-9, LARGEST_ENVELOPE) as f32;
        }
    };
    parameters.envelope = Envelope::default();
    let envelope = &mut parameters.envelope;
    covers(&mut envelope.velocity_max_rad_s, |s| s.velocity_rad_s, 1.5);
    covers(&mut envelope.radial_force_max_n, |s| s.radial_force_n, 1.2);
    covers(&mut envelope.pressure_diff_max_pa, |s| s.pressure_diff_mpa * 1e6, 1.2);
    covers(&mut envelope.load_torque_max_nm, |s| s.load_torque_nm, 1.2);
    covers(&mut envelope.acceleration_max_rad_s2, |s| s.acceleration_rad_s2, 1.5);
    covers(&mut envelope.campaign_max_h, |s| s.campaign_time_h, 2.0);
}

/// The file must load into the core as it is. A law the data want active (damping beyond passivity, friction
/// that falls with speed) is written with that choice stated; what the core refuses all the same is said.
fn accept_what_was_fitted(outcome: &mut Outcome) {
    // As the driver will hold them: rounding to f32 can cross a bound.
    let refusal = |parameters: &Parameters<f64>| {
        let rounded = parameters.convert::<f32>();
        parameters.validate().and_then(|()| rounded.validate()).err()
    };
    let Some(error) = refusal(&outcome.parameters) else { return };
    outcome.parameters.choices.allow_active = true;
    match refusal(&outcome.parameters) {
        None => outcome.verdicts.push(format!(
            "the law can give out energy and so keep a joint moving ({error}); params.toml says allow_active, and a \
             driver that runs it warns. `identify` without --choices allow_active fits one that cannot"
        )),
        Some(error) => outcome.verdicts.push(format!("the core refuses these parameters: {error}")),
    }
}

fn estimates(
    solution: &Solution,
    parameters: &Parameters<f64>,
    rows: Rows,
    time: f64,
    unseen: &[ParameterId],
) -> (Vec<Estimate>, DMatrix<f64>) {
    let reduced = &solution.reduced;
    let count = solution.coordinates.len();
    let free: Vec<Id> = solution.coordinates.ids().collect();
    let spare = reduced.rows.saturating_sub(count).max(1) as f64;
    let variance = time * reduced.sum_of_squares() / spare;
    let covariance = inverse_information(reduced) * variance;
    // d(parameter)/d(coordinate), exactly, by the same dual numbers as the fit.
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
        if solution.coordinates.at_bound(index, &solution.point, parameters) {
            return State::AtBound;
        }
        let moved = (point - start).abs() > 1e-6 * (1.0 + start.abs());
        if !moved && norm(index) < NO_EFFECT * torque {
            return State::AtStart;
        }
        let positive = id.info().lower > 0.0;
        // What the parameter does to the torque, per unit of it.
        let effect = norm(index) / change[(index, index)].abs().max(f64::MIN_POSITIVE);
        let loose = if solution.coordinates.is_held_by_prior(index) {
            covariance[(index, index)].sqrt() > LOOSE
        } else if positive {
            error > LOOSE * value.abs()
        } else {
            // Not told from nothing, or free to do much.
            value.abs() < 2.0 * error
                || 2.0 * error * effect > LOOSE_EFFECT * torque && value.abs() < 3.0 * error
        };
        if loose || !error.is_finite() { State::NotDetermined } else { State::Determined }
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
                    let lost = unseen.contains(&id) || solution.collinear.contains(&id);
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
