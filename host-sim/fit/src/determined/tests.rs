//! One hand-made log for each rule.

use super::*;
use crate::outcome::Outcome;
use crate::spec::Spec;
use crate::{FitOptions, identify};
use compensator_core::{LawKind, Sample};

/// Motion of the logs: a sine with an amplitude of 2 rad/s.
fn sample(row: usize) -> Sample<f64> {
    let phase = 0.02 * row as f64;
    Sample {
        velocity_rad_s: 2.0 * phase.sin(),
        acceleration_rad_s2: 4.0 * phase.cos(),
        position_rad: 1.15 - 0.1 * phase.cos(),
        load_torque_nm: 100.0 + (0.31 * phase).sin(),
        ..Sample::default()
    }
}

/// Fits a model to a torque with noise.
fn fitted(model: &str, torque: impl Fn(usize, &Sample<f64>) -> f64) -> Outcome {
    let samples: Vec<_> = (0..3000).map(sample).collect();
    let noise = |row: usize| 2e-3 * ((row * 7919 % 101) as f64 / 50.0 - 1.0);
    let torques = samples.iter().enumerate().map(|(row, s)| torque(row, s) + noise(row)).collect();
    let tracks = [Track::even(samples, torques, 0.01)];
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let spec = Spec::parse(model).expect("a model");
    let base = spec.parameters().expect("parameters");
    identify(&spec, &base, rows, rows, &FitOptions::default())
}

#[test]
fn identify_with_more_than_40_free_parameters_returns_an_estimate_of_each() {
    let samples: Vec<_> = (0..200).map(sample).collect();
    let torques = samples.iter().map(|sample| sample.velocity_rad_s.signum()).collect();
    let tracks = [Track::even(samples, torques, 0.01)];
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let terms = "unknown+torque-ripple+position-ripple+warm-up+time-drift+dwell-time-static";
    let spec =
        Spec::parse(&format!("lugre-asymmetric+{terms}+direction-asymmetry")).expect("a model");
    let base = spec.parameters().expect("parameters");
    let options = FitOptions { starts: 1, patience: 1, ..FitOptions::default() };
    let outcome = identify(&spec, &base, rows, rows, &options);
    let free = outcome.estimates.iter().filter(|estimate| estimate.std_error.is_some());
    assert!(free.count() > 40);
}

fn result(outcome: &Outcome, id: Id) -> (State, Option<Reason>) {
    let estimate = outcome.estimates.iter().find(|estimate| estimate.id == id);
    estimate.map(|estimate| (estimate.state, estimate.reason)).expect("a parameter of the model")
}

fn undetermined(reason: Reason) -> (State, Option<Reason>) {
    (State::NotDetermined, Some(reason))
}

const DETERMINED: (State, Option<Reason>) = (State::Determined, None);
const AT_BOUND: (State, Option<Reason>) = (State::AtBound, None);

#[test]
fn identify_with_falling_friction_returns_viscous_at_zero() {
    let outcome = fitted("linear", |_, s| s.velocity_rad_s.signum() - 0.2 * s.velocity_rad_s);
    assert!(outcome.converged && outcome.evaluations < 60, "{}", outcome.evaluations);
    assert_eq!(outcome.parameters.get(Id::ViscousFriction), 0.0);
    assert_eq!(result(&outcome, Id::ViscousFriction), AT_BOUND);
    assert_eq!(result(&outcome, Id::CoulombTorque), DETERMINED);
}

#[test]
fn identify_with_negative_inertia_returns_inertia_at_zero() {
    let friction = |s: &Sample<f64>| s.velocity_rad_s.signum() + 0.2 * s.velocity_rad_s;
    let fit = |inertia: f64| {
        fitted("linear+unmodelled-inertia", |_, s| friction(s) + inertia * s.acceleration_rad_s2)
    };
    let negative = fit(-0.1);
    assert!(negative.converged);
    assert_eq!(negative.parameters.get(Id::Inertia), 0.0);
    assert_eq!(result(&negative, Id::Inertia), AT_BOUND);
    let positive = fit(0.1);
    assert!((positive.parameters.get(Id::Inertia) - 0.1).abs() < 1e-3);
    assert_eq!(result(&positive, Id::Inertia), DETERMINED);
}

#[test]
fn identify_with_driving_direction_returns_asymmetry_at_bound() {
    let outcome = fitted("linear+direction-asymmetry", |_, s| {
        let forwards = s.velocity_rad_s > 0.0;
        (if forwards { 1.0 } else { 0.2 }) + 0.3 * s.velocity_rad_s
    });
    assert_eq!(result(&outcome, Id::CoulombAsymmetry), AT_BOUND);
    let at_bound = undetermined(Reason::PartnerAtBound(Id::CoulombAsymmetry));
    assert_eq!(result(&outcome, Id::ViscousAsymmetry), at_bound);
}

#[test]
fn identify_with_halves_of_other_viscosity_reports_them() {
    let outcome = fitted("linear", |row, s| {
        let viscous = if row < 1500 { 0.2 } else { 0.5 };
        s.velocity_rad_s.signum() + viscous * s.velocity_rad_s
    });
    assert_eq!(result(&outcome, Id::ViscousFriction), undetermined(Reason::HalvesDisagree));
    assert_eq!(result(&outcome, Id::CoulombTorque), DETERMINED);
}

#[test]
fn identify_with_parts_beyond_the_torque_reports_them() {
    // A small curvature over a small angle is a large gravity less a large offset.
    let outcome = fitted("linear+gravity-imbalance+torque-offset", |_, s| {
        s.velocity_rad_s.signum() + 25.0 * (s.position_rad - 1.15).powi(2)
    });
    for id in [Id::GravitySine, Id::TorqueOffset] {
        assert_eq!(result(&outcome, id), undetermined(Reason::BeyondLog), "{}", id.name());
    }
    let outcome = fitted("linear+load-gain+torque-offset", |_, s| {
        s.velocity_rad_s.signum() + 0.5 * (s.load_torque_nm - 100.0)
    });
    let cancels = undetermined(Reason::Cancels(Id::TorqueOffset));
    assert_eq!(result(&outcome, Id::LoadGain), cancels);
}

#[test]
fn identify_with_negative_drag_reports_its_sign() {
    let outcome = fitted("linear+quadratic-drag", |_, s| {
        let velocity = s.velocity_rad_s;
        velocity.signum() + velocity - 0.2 * velocity * velocity.abs()
    });
    assert_eq!(result(&outcome, Id::QuadraticDrag), undetermined(Reason::ImpossibleSign));
}

#[test]
fn identify_with_steady_noise_reports_what_is_absent() {
    let outcome = fitted("linear+torque-offset+pressure-coulomb", |_, s| s.velocity_rad_s.signum());
    assert_eq!(result(&outcome, Id::TorqueOffset), undetermined(Reason::Insignificant));
    assert_eq!(result(&outcome, Id::PressureCoulomb), undetermined(Reason::NoColumn));
}

#[test]
fn shown_contains_values_within_the_log_only() {
    let shown = Shown { torque: 3.0, speeds: [0.01, 2.0], travels: [1e-4, 0.5] };
    let joint = |id, value| {
        let lugre = Parameters::<f64>::new(LawKind::Lugre).with(Id::StribeckVelocity, 0.1);
        lugre.with(Id::CoulombTorque, 1.0).with(id, value)
    };
    for (id, inside, outside) in [
        (Id::StaticTorque, 2.0, [-3.5, 3.5]),
        (Id::TorqueOffset, -2.0, [-3.5, 2.9]),
        (Id::StribeckVelocity, 0.1, [0.001, 1.9]),
        (Id::BristleStiffness, 100.0, [1.0, 1e5]),
    ] {
        assert!(shown.contains(id, 0.1, &joint(id, inside)), "{}", id.name());
        for value in outside {
            assert!(!shown.contains(id, 0.1, &joint(id, value)), "{} {value}", id.name());
        }
    }
}

#[test]
fn fit_with_unseen_static_level_keeps_it_near_the_coulomb_level() {
    // The model error of a slow wave lasts many rows, and the lowest speed shows no breakaway: rows alone give any level.
    let outcome =
        fitted("stribeck", |row, s| s.velocity_rad_s.signum() + 0.2 * (0.013 * row as f64).sin());
    let level = |id| outcome.parameters.get(id);
    assert!(level(Id::StaticTorque) < 1.5 * level(Id::CoulombTorque));
    assert_ne!(result(&outcome, Id::StribeckVelocity), DETERMINED);
}
