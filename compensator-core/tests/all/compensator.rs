//! Compares the compensator in fixed point with the compensator in `f32`.
//!
//! A processor without an FPU runs the same guards, blending and limits in `Fixed`. There, a too large reciprocal
//! saturates and a too large product wraps. Both compensators get the same readings: the reference velocity crosses
//! zero at other times than the measured one, and covariates become stale. The currents and flags must agree, with and
//! without blending.

use compensator_core::compensator::{CompensatorParameters, Reading};
use compensator_core::configuration::Configuration;
use compensator_core::{
    Compensator, Fixed, Flags, Inputs, LawKind, ParameterId as Id, Parameters, Real,
};

const PERIOD: f32 = 1e-3;

fn configuration(compensator: CompensatorParameters) -> Configuration {
    let model = Parameters::<f32>::new(LawKind::ImprovedLugre)
        .with(Id::CoulombTorque, 1.5)
        .with(Id::StaticTorque, 2.2)
        .with(Id::BristleStiffness, 1e3)
        .with(Id::ViscousFriction, 0.08)
        .with(Id::RadialForceCoulomb, 0.01)
        .with(Id::PressureCoulomb, 2.4e-6);
    Configuration { model, compensator }
}

fn enabled<T: Real<Setting = f32>>(configuration: &Configuration) -> Compensator<T> {
    let mut compensator = Compensator::build(configuration, PERIOD).unwrap();
    compensator.set_enabled(true);
    compensator
}

fn inputs<T: Real>(sample: u32) -> Inputs<T> {
    let t = f64::from(sample) * 1e-3;
    let fresh = |value: f64| Reading::fresh(T::from_f64(value));
    let intermittent = |reading| if sample % 3000 < 2000 { reading } else { Reading::missing() };
    Inputs {
        velocity_reference_rad_s: fresh(2.0 * (0.9 * t).sin()),
        radial_force_n: intermittent(fresh(40.0 + 20.0 * t.sin())),
        pressure_diff_mpa: intermittent(fresh(0.2)),
        ..Inputs::velocity(T::from_f64(4.0 * t.sin()))
    }
}

#[test]
fn step_in_fixed_point_gives_same_current_as_f32() {
    let default = CompensatorParameters::default();
    for blend_velocity_rad_s in [0.0, 1e-4, 0.05, 1.0] {
        let parameters = CompensatorParameters { blend_velocity_rad_s, ..default };
        let configuration = configuration(parameters);
        let mut float = enabled::<f32>(&configuration);
        let mut fixed = enabled::<Fixed>(&configuration);
        let (mut difference, mut largest) = (0.0f64, 0.0f64);
        for sample in 0..12_000 {
            let expected = float.step(&inputs(sample));
            let found = fixed.step(&inputs(sample));
            let current = f64::from(expected.feed_forward_current_a);
            difference = difference.max((found.feed_forward_current_a.value() - current).abs());
            largest = largest.max(current.abs());
            // If a value just reaches a limit, the limit may act one sample earlier or later.
            let guards = !(Flags::TORQUE_LIMITED | Flags::SLEW_LIMITED);
            assert_eq!(found.flags & guards, expected.flags & guards, "at {sample}");
        }
        assert!((1.0..6.0).contains(&largest), "{largest} A");
        assert!(
            (1e-6..0.01).contains(&difference),
            "blend {blend_velocity_rad_s}: difference {difference} A"
        );
    }
}

#[test]
fn build_in_fixed_point_with_too_large_current_names_the_ratio() {
    let default = CompensatorParameters::default();
    let weak =
        CompensatorParameters { torque_limit_nm: 900.0, torque_constant_nm_per_a: 0.01, ..default };
    let refused = Compensator::<Fixed>::build(&configuration(weak), PERIOD).unwrap_err();
    assert_eq!(refused.field, "torque_limit_nm / torque_constant_nm_per_a");
    assert!(Compensator::<f32>::build(&configuration(weak), PERIOD).is_ok());
}
