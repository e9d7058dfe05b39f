//! Property tests: the held torque never exceeds the friction level.
//!
//! This bound makes it safe to add the friction to a current command. It must hold for every stiffness, period and
//! velocity. The tests search for counterexamples: any bit pattern of the velocity, parameters over many decades,
//! side load and pressure that jump within the envelope, and random combinations of terms. The tests compute the
//! largest level independently of the core, from the definition of each term.

use crate::support::cases::{Case, FIXED, FLOAT, case, converted};
use compensator_core::model::{ModelState, Sample};
use compensator_core::term::LOOKUP_LEVELS;
use compensator_core::{
    Fixed, FrictionModel, LawKind, ParameterId as Id, Parameters, Real, TermKind,
};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

/// Returns the largest static level for these covariates, Nm, from the formulas of the terms.
fn largest_level(case: &Case, covariates: &[f64; 8]) -> f64 {
    let value = |id: Id| case.parameters::<f64>().get(id);
    let has = |kind| case.parameters::<f64>().terms.contains(&kind);
    let [force, pressure, _, temperature, load_torque, time, ..] = *covariates;
    let improved = case.law == LawKind::ImprovedLugre;
    let mut level = match case.law {
        LawKind::Dahl => value(Id::CoulombTorque),
        LawKind::LugreAsymmetric => value(Id::StaticTorque).max(value(Id::StaticTorqueNegative)),
        _ => value(Id::StaticTorque),
    };
    if improved || has(TermKind::RadialForceCoulomb) {
        let per_newton = value(Id::RadialForceCoulomb) + value(Id::RadialForceStaticExcess);
        level += per_newton * force * 100.0;
    }
    if improved || has(TermKind::PressureCoulomb) {
        let per_pascal = value(Id::PressureCoulomb) + value(Id::PressureStaticExcess);
        level += per_pascal * pressure * 3e5;
    }
    if has(TermKind::LoadTorqueCoulomb) {
        level += value(Id::LoadCoulomb) * (load_torque * 2.0 - 1.0).abs() * 26.0;
    }
    if has(TermKind::DwellTimeStatic) {
        level += value(Id::DwellGain) * (1.0 + 1000.0 / value(Id::DwellTime)).ln();
    }
    if has(TermKind::PositionRipple) {
        level *= 1.0 + value(Id::RippleSine).hypot(value(Id::RippleCosine));
    }
    if has(TermKind::TemperatureCoulomb) {
        let kelvin = temperature * 200.0 - 50.0 - value(Id::TemperatureReference);
        level *= (-value(Id::TemperatureCoulomb) * kelvin).exp();
    }
    if has(TermKind::TimeDrift) {
        let seconds = time * 2000.0 * 3600.0;
        level *= 1.0
            + value(Id::DriftAmplitude) * (-seconds / value(Id::DriftTime)).exp()
            + value(Id::DriftRate) * seconds;
    }
    if has(TermKind::LookupTable) {
        // The level between two knots never exceeds the largest knot.
        level *= 1.0 + LOOKUP_LEVELS.map(value).into_iter().fold(-1.0, f64::max);
    }
    if has(TermKind::DirectionAsymmetry) {
        level *= 1.0 + value(Id::CoulombAsymmetry).abs();
    }
    level
}

/// Checks the case in `T`. The held torque may exceed the level by the share `slack` plus `rounding` (Nm).
fn check_bound<T: Real>(
    case: &Case,
    model: &FrictionModel<T>,
    velocity: impl Fn(u64) -> T,
    slack: f64,
    rounding: f64,
) -> Result<(), TestCaseError> {
    let mut state = ModelState::default();
    let mut force_before = 0.0;
    for (bits, covariates) in &case.samples {
        let sample = Case::sample(0.0, covariates, force_before);
        let sample = Sample { velocity_rad_s: velocity(*bits), ..converted(&sample) };
        force_before = covariates[0];
        let friction = model.step(&mut state, &sample).value();
        let held = state.bristle_torque_nm.value();
        let bound = largest_level(case, covariates) * (1.0 + slack) + rounding;
        prop_assert!(held.abs() <= bound, "held {held}, level {bound}");
        prop_assert!(friction.is_finite(), "friction {friction}");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 20_000, ..ProptestConfig::with_cases(1500) })]

    #[test]
    fn held_torque_is_within_the_level_in_f64(case in case(FLOAT)) {
        let model = case.parameters::<f64>().build::<f64>(case.period).unwrap();
        check_bound(&case, &model, f64::from_bits, 1e-12, 0.0)?;
    }

    #[test]
    fn held_torque_is_within_the_level_in_f32(case in case(FLOAT)) {
        let model = case.parameters::<f32>().build::<f32>(case.period as f32).unwrap();
        // The embedded sine may exceed 1 by 0.001.
        let slack = if case.terms.contains(&TermKind::PositionRipple) { 2e-3 } else { 1e-5 };
        check_bound(&case, &model, |bits| f32::from_bits(bits as u32), slack, 0.0)?;
        check_bound(&case, &model, |bits| f64::from_bits(bits) as f32, slack, 0.0)?;
    }

    /// Refused cases do not count. Proptest fails if it refuses too many.
    #[test]
    fn held_torque_is_within_the_level_in_fixed_point(case in case(FIXED)) {
        let model = case.parameters::<f32>().build::<Fixed>(case.period as f32);
        prop_assume!(model.is_ok());
        // Coefficients are accurate to 1e-3. Sines and exponentials are computed in f32.
        let model = model.unwrap();
        check_bound(&case, &model, |bits| Fixed::from_bits(bits as i32), 4e-3, 1e-5)?;
        check_bound(&case, &model, |bits| Fixed::from_f64(f64::from_bits(bits)), 4e-3, 1e-5)?;
    }
}

/// Tests extreme values that a random search rarely reaches.
#[test]
fn held_torque_with_extreme_period_stiffness_and_velocity_is_within_the_level() {
    for period in [1e-9, 1e-6, 5e-5, 1e-3, 1.0, 1e6] {
        for stiffness in [1e-3, 1e4, 1e9] {
            let parameters = Parameters::<f32>::new(LawKind::Lugre)
                .with(Id::StaticTorque, 1.7)
                .with(Id::BristleStiffness, stiffness);
            let model = parameters.build::<f32>(period).unwrap();
            let mut state = ModelState::default();
            for velocity in [1e-30, -12.0, f32::NAN, f32::MAX, 1e-6, -f32::INFINITY, 0.0, -1e-3] {
                for _ in 0..50 {
                    let sample = Sample { velocity_rad_s: velocity, ..Sample::default() };
                    let friction = model.step(&mut state, &sample);
                    assert!(state.bristle_torque_nm.abs() <= 1.7 && friction.abs() <= 1.7);
                }
            }
        }
    }
}
