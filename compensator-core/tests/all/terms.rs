//! Compares each term with its formula, and checks that neutral parameters have no effect.
//!
//! A diagnosis deploys terms. Each term must change the torque as its cause does, in every number type. With neutral
//! parameters the torque must be bit-identical to that of a model without the term.
//!
//! Terms that act in steady sliding are compared with a closed form. Terms with a state have tests of their own
//! ([`memory`]), as have curves over a column ([`lookup`]). One test checks that no kind is missing.
#![cfg(feature = "terms")]

mod lookup;
mod memory;

use compensator_core::model::{ModelState, Sample};
use compensator_core::term::{LOOKUP_KNOTS, LOOKUP_LEVELS, LOOKUP_TORQUES, MAX_TERMS};
use compensator_core::{
    Fixed, FrictionModel, LawKind, ParameterId as Id, Parameters, Quantity, Real, TermKind,
};
use lookup::{table_at, table_over};

const PERIOD: f64 = 1e-3;
const COULOMB: f64 = 1.5;
const STATIC: f64 = 2.25;
const STRIBECK: f64 = 0.25;
const STIFFNESS: f64 = 1e3;
const DAMPING: f64 = 0.5;
const VISCOUS: f64 = 0.25;

fn base<S: Real>() -> Parameters<S> {
    let mut parameters = Parameters::<S>::new(LawKind::Lugre);
    for (id, value) in [
        (Id::CoulombTorque, COULOMB),
        (Id::StaticTorque, STATIC),
        (Id::StribeckVelocity, STRIBECK),
        (Id::BristleStiffness, STIFFNESS),
        (Id::BristleDamping, DAMPING),
        (Id::ViscousFriction, VISCOUS),
    ] {
        parameters.set(id, S::from_f64(value));
    }
    parameters.choices.damping_fades = true;
    parameters.envelope.position_max_rad = 10.0;
    parameters.envelope.velocity_max_rad_s = 8.0;
    parameters
}

fn with_term<S: Real>(kind: TermKind, values: &[(Id, f64)]) -> Parameters<S> {
    let mut parameters = base();
    assert!(parameters.add_term(kind));
    for (id, value) in values {
        parameters.set(*id, S::from_f64(*value));
    }
    parameters
}

fn build<T: Real>(parameters: &Parameters<T::Setting>) -> FrictionModel<T> {
    parameters.build(<T::Setting as Real>::from_f64(PERIOD)).expect("legal")
}

/// Returns a sample of an oscillating joint in which every covariate varies.
fn varying_sample<T: Real>(step: u32) -> Sample<T> {
    let t = f64::from(step) * PERIOD;
    let number = T::from_f64;
    Sample {
        velocity_rad_s: number((3.0 * t).sin() * (0.7 * t).sin().powi(3)),
        position_rad: number(3.0 * t.sin()),
        acceleration_rad_s2: number(20.0 * (2.0 * t).cos()),
        radial_force_n: number(50.0 + 40.0 * (5.0 * t).sin()),
        radial_force_change_n: number(0.2 * (5.0 * t).cos()),
        pressure_diff_mpa: number(0.15 + 0.1 * t.cos()),
        temperature_c: number(10.0 + t),
        load_torque_nm: number(5.0 * (4.0 * t).sin()),
        campaign_time_h: number(t),
        auxiliary: number(0.3 * t),
        ..Sample::default()
    }
}

fn check_neutral_term_has_no_effect<T: Real>() {
    for kind in TermKind::ALL {
        let without = build::<T>(&base());
        let with = build::<T>(&with_term(*kind, &[]));
        let (mut a, mut b) = (ModelState::default(), ModelState::default());
        for step in 0..10_000 {
            let sample = varying_sample(step);
            let expected = without.step(&mut a, &sample).value();
            let found = with.step(&mut b, &sample).value();
            assert_eq!(found, expected, "{} at {step}", kind.name());
            assert_eq!(b.bristle_torque_nm.value(), a.bristle_torque_nm.value());
        }
    }
}

#[test]
fn term_with_neutral_parameters_leaves_torque_bit_identical() {
    check_neutral_term_has_no_effect::<f64>();
    check_neutral_term_has_no_effect::<f32>();
    check_neutral_term_has_no_effect::<Fixed>();
}

/// Friction level `F_C + (F_S - F_C) exp(-(v/v_s)^2)`, Nm.
fn level(coulomb: f64, static_level: f64, speed: f64) -> f64 {
    coulomb + (static_level - coulomb) * (-(speed / STRIBECK).powi(2)).exp()
}

/// Returns the friction after 20 s of sliding with a constant sample, Nm.
fn settled<T: Real>(parameters: &Parameters<T::Setting>, sample: &Sample<f64>) -> f64 {
    let model = build::<T>(parameters);
    let sample = Sample { radial_force_change_n: T::zero(), ..sample.map(T::from_f64) };
    let mut state = ModelState::default();
    (0..20_000).map(|_| model.step(&mut state, &sample).value()).last().unwrap()
}

/// Expected friction in steady sliding, from the velocity and the sample.
type Formula = fn(f64, &Sample<f64>) -> f64;

/// A term kind, its parameters and its formula.
type SlidingCase = (TermKind, Vec<(Id, f64)>, Formula);

/// Law without terms in steady sliding, for these levels.
fn sliding_friction(coulomb: f64, static_level: f64, v: f64) -> f64 {
    level(coulomb, static_level, v.abs()) * v.signum() + VISCOUS * v
}

/// Returns the cases of all terms that act in steady sliding.
fn sliding_cases() -> Vec<SlidingCase> {
    let mut cases = covariate_cases();
    cases.extend(position_cases());
    cases.extend(velocity_cases());
    cases
}

/// Terms that depend on a covariate: load, pressure, temperature, time or acceleration.
fn covariate_cases() -> Vec<SlidingCase> {
    vec![
        (
            TermKind::RadialForceCoulomb,
            vec![(Id::RadialForceCoulomb, 0.0125), (Id::RadialForceStaticExcess, 0.005)],
            |v, s| {
                sliding_friction(
                    COULOMB + 0.0125 * s.radial_force_n,
                    STATIC + 0.0175 * s.radial_force_n,
                    v,
                )
            },
        ),
        (
            TermKind::PressureCoulomb,
            vec![(Id::PressureCoulomb, 2.4e-6), (Id::PressureStaticExcess, 1e-6)],
            |v, s| {
                let pascal = s.pressure_diff_mpa * 1e6;
                sliding_friction(COULOMB + 2.4e-6 * pascal, STATIC + 3.4e-6 * pascal, v)
            },
        ),
        (TermKind::LoadTorqueCoulomb, vec![(Id::LoadCoulomb, 0.0625)], |v, s| {
            let added = 0.0625 * s.load_torque_nm.abs();
            sliding_friction(COULOMB + added, STATIC + added, v)
        }),
        (TermKind::LoadGain, vec![(Id::LoadGain, 0.125)], |v, s| {
            sliding_friction(COULOMB, STATIC, v) + 0.125 * s.load_torque_nm
        }),
        (TermKind::TemperatureViscous, vec![(Id::TemperatureViscosity, 0.02)], |v, s| {
            let viscosity = (-0.02 * (s.temperature_c - 20.0)).exp();
            sliding_friction(COULOMB, STATIC, v) + VISCOUS * v * (viscosity - 1.0)
        }),
        (TermKind::TemperatureCoulomb, vec![(Id::TemperatureCoulomb, 0.02)], |v, s| {
            let scale = (-0.02 * (s.temperature_c - 20.0)).exp();
            level(COULOMB, STATIC, v.abs()) * scale * v.signum() + VISCOUS * v
        }),
        (
            TermKind::TimeDrift,
            vec![(Id::DriftAmplitude, 0.5), (Id::DriftTime, 7200.0), (Id::DriftRate, 1e-6)],
            |v, s| {
                let seconds = s.campaign_time_h * 3600.0;
                let drift = 1.0 + 0.5 * (-seconds / 7200.0).exp() + 1e-6 * seconds;
                level(COULOMB, STATIC, v.abs()) * drift * v.signum() + VISCOUS * v
            },
        ),
        (TermKind::UnmodelledInertia, vec![(Id::Inertia, 0.0625)], |v, s| {
            sliding_friction(COULOMB, STATIC, v) + 0.0625 * s.acceleration_rad_s2
        }),
        (TermKind::LookupTable, table_over(Quantity::Temperature, -25.0, 75.0), |v, s| {
            let (torque, change) = table_at((s.temperature_c + 25.0) / 100.0);
            level(COULOMB, STATIC, v.abs()) * (1.0 + change) * v.signum() + VISCOUS * v + torque
        }),
    ]
}

/// Terms that depend on the joint position.
fn position_cases() -> Vec<SlidingCase> {
    vec![
        (
            TermKind::PositionRipple,
            vec![(Id::RippleSine, 0.125), (Id::RippleCosine, -0.0625), (Id::RippleOrder, 3.0)],
            |v, s| {
                let angle = 3.0 * s.position_rad;
                let ripple = 0.125 * angle.sin() - 0.0625 * angle.cos();
                level(COULOMB, STATIC, v.abs()) * (1.0 + ripple) * v.signum() + VISCOUS * v
            },
        ),
        (
            TermKind::GravityImbalance,
            vec![(Id::GravitySine, 0.5), (Id::GravityCosine, 0.25)],
            |v, s| {
                let angle = s.position_rad;
                sliding_friction(COULOMB, STATIC, v) + 0.5 * angle.sin() + 0.25 * angle.cos()
            },
        ),
        (
            TermKind::TorqueRipple,
            vec![
                (Id::TorqueRippleOrder1, 7.0),
                (Id::TorqueRippleSine1, 0.25),
                (Id::TorqueRippleCosine1, -0.125),
                (Id::TorqueRippleOrder2, 14.0),
                (Id::TorqueRippleSine2, 0.0625),
                (Id::TorqueRippleOrder4, 6.0),
                (Id::TorqueRippleCosine4, 0.5),
                // Order 0 marks an unused component, which adds nothing.
                (Id::TorqueRippleCosine3, 0.5),
            ],
            |v, s| {
                let q = s.position_rad;
                let ripple = 0.25 * (7.0 * q).sin() - 0.125 * (7.0 * q).cos();
                let ripple = ripple + 0.0625 * (14.0 * q).sin() + 0.5 * (6.0 * q).cos();
                sliding_friction(COULOMB, STATIC, v) + ripple
            },
        ),
    ]
}

/// Terms that depend on the velocity, and the constant offset.
fn velocity_cases() -> Vec<SlidingCase> {
    vec![
        (
            TermKind::DirectionAsymmetry,
            vec![(Id::CoulombAsymmetry, 0.125), (Id::ViscousAsymmetry, -0.25)],
            |v, _| {
                let (of_level, of_viscous) = if v > 0.0 { (1.125, 0.75) } else { (0.875, 1.25) };
                level(COULOMB, STATIC, v.abs()) * of_level * v.signum() + VISCOUS * of_viscous * v
            },
        ),
        (TermKind::TorqueOffset, vec![(Id::TorqueOffset, -0.375)], |v, _| {
            sliding_friction(COULOMB, STATIC, v) - 0.375
        }),
        (TermKind::QuadraticDrag, vec![(Id::QuadraticDrag, 0.0625)], |v, _| {
            sliding_friction(COULOMB, STATIC, v) + 0.0625 * v * v.abs()
        }),
        // With a low exponent the curve decays slowly. At 16 v_s, beyond the table, a share of 0.018 is left.
        (TermKind::StribeckShape, vec![(Id::StribeckExponent, 0.5)], |v, _| {
            let left = (-(v.abs() / STRIBECK).powf(0.5)).exp();
            (COULOMB + (STATIC - COULOMB) * left) * v.signum() + VISCOUS * v
        }),
        (TermKind::DwellTimeStatic, vec![(Id::DwellGain, 0.5), (Id::DwellTravel, 0.01)], |v, _| {
            // In steady sliding the contact age is the time of one travel.
            let age = 0.01 / v.abs();
            sliding_friction(COULOMB, STATIC + 0.5 * (1.0 + age).ln(), v)
        }),
    ]
}

#[test]
fn term_in_steady_sliding_matches_its_formula() {
    let covariates = |velocity: f64| Sample {
        velocity_rad_s: velocity,
        position_rad: 0.75,
        acceleration_rad_s2: -8.0,
        radial_force_n: 40.0,
        pressure_diff_mpa: 0.25,
        temperature_c: 5.0,
        load_torque_nm: -6.0,
        campaign_time_h: 1.5,
        ..Sample::default()
    };
    for (kind, values, formula) in sliding_cases() {
        let mut effect_nm = 0.0f64;
        for velocity in [0.0625, -0.25, 0.5, -1.0, 4.0] {
            let sample = covariates(velocity);
            let expected = formula(velocity, &sample);
            let name = kind.name();
            for (found, tolerance) in [
                (settled::<f64>(&with_term(kind, &values), &sample), 5e-5),
                // The embedded sine and the fixed-point coefficients are accurate to 1e-3.
                (settled::<f32>(&with_term(kind, &values), &sample), 1e-3),
                (settled::<Fixed>(&with_term(kind, &values), &sample), 3e-3),
            ] {
                let error = (found - expected).abs();
                assert!(error < tolerance, "{name} at {velocity}: {found}, formula {expected}");
            }
            effect_nm = effect_nm.max((expected - settled::<f64>(&base(), &sample)).abs());
        }
        assert!(effect_nm > 0.01, "{}: the term must have an effect", kind.name());
    }
}

#[test]
fn term_tests_cover_every_kind() {
    let mut tested: Vec<TermKind> = sliding_cases().into_iter().map(|(kind, ..)| kind).collect();
    tested.extend([
        TermKind::RadialForceRate,
        TermKind::Backlash,
        TermKind::ChannelDelay,
        TermKind::WarmUp,
    ]);
    tested.sort();
    assert_eq!(tested, TermKind::ALL);
}

#[test]
fn add_term_keeps_list_bounded_and_unique() {
    let mut parameters = base::<f64>();
    for kind in &TermKind::ALL[..MAX_TERMS] {
        assert!(parameters.add_term(*kind));
        assert!(parameters.add_term(*kind), "adding a term twice succeeds");
    }
    assert_eq!(parameters.terms.len(), MAX_TERMS);
    assert!(!parameters.add_term(TermKind::ALL[MAX_TERMS]), "full");
    assert!(parameters.add_term(TermKind::ALL[0]), "the term is already in the list");
    assert_eq!(parameters.terms, TermKind::ALL[..MAX_TERMS]);
    // A caller can put a kind twice into the list. Validation then names it.
    let mut twice = base::<f64>();
    twice.terms.extend([TermKind::TorqueOffset, TermKind::TorqueOffset]);
    assert_eq!(twice.validate().unwrap_err().field, "torque-offset");
}

#[test]
fn channel_delay_acts_before_velocity_terms() {
    let drag = [(Id::QuadraticDrag, 0.5), (Id::ChannelDelay, 3.0 * PERIOD)];
    let mut parameters = with_term::<f64>(TermKind::QuadraticDrag, &drag);
    parameters.add_term(TermKind::ChannelDelay);
    assert_eq!(parameters.terms[0], TermKind::ChannelDelay);
    let model = build::<f64>(&parameters);
    let mut state = ModelState::default();
    let mut step = |velocity| {
        model.step(&mut state, &Sample { velocity_rad_s: velocity, ..Sample::default() })
    };
    let before = (0..2000).map(|_| step(2.0)).last().unwrap();
    let after: Vec<f64> = (0..4).map(|_| step(4.0)).collect();
    assert!(after[..3].iter().all(|friction| (friction - before).abs() < 1e-9));
    assert!(after[3] - before > 0.5 * (16.0 - 4.0) - 0.1);
}
