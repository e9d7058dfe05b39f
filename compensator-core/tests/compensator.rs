//! The compensator in fixed point is the compensator.
//!
//! A part without an FPU runs the same guards, blends and limits in `Fixed`, where a reciprocal
//! that is too large saturates and a product that is too large wraps. Both compensators get the same
//! readings, the reference crossing zero on its own, covariates going stale; their currents must
//! stay together, with blending and without, and their flags must agree.

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
    let heard = |reading| if sample % 3000 < 2000 { reading } else { Reading::missing() };
    Inputs {
        velocity_reference_rad_s: fresh(2.0 * (0.9 * t).sin()),
        radial_force_n: heard(fresh(40.0 + 20.0 * t.sin())),
        pressure_diff_mpa: heard(fresh(0.2)),
        ..Inputs::velocity(T::from_f64(4.0 * t.sin()))
    }
}

#[test]
fn fixed_point_gives_the_current_of_a_float() {
    let default = CompensatorParameters::default();
    for blend_velocity_rad_s in [0.0, 1e-4, 0.05, 1.0] {
        let parameters = CompensatorParameters { blend_velocity_rad_s, ..default };
        let configuration = configuration(parameters);
        let mut float = enabled::<f32>(&configuration);
        let mut fixed = enabled::<Fixed>(&configuration);
        let (mut apart, mut largest) = (0.0f64, 0.0f64);
        for sample in 0..12_000 {
            let expected = float.step(&inputs(sample));
            let found = fixed.step(&inputs(sample));
            let current = f64::from(expected.feed_forward_current_a);
            apart = apart.max((found.feed_forward_current_a.value() - current).abs());
            largest = largest.max(current.abs());
            // A limit may act one sample apart where a value just touches it.
            let guards = !(Flags::TORQUE_LIMITED | Flags::SLEW_LIMITED);
            assert_eq!(found.flags & guards, expected.flags & guards, "at {sample}");
        }
        assert!((1.0..6.0).contains(&largest), "{largest} A");
        assert!((1e-6..0.01).contains(&apart), "blend {blend_velocity_rad_s}: {apart} A apart");
    }
}

#[test]
fn a_current_fixed_point_cannot_hold_is_refused() {
    let default = CompensatorParameters::default();
    let weak =
        CompensatorParameters { torque_limit_nm: 900.0, torque_constant_nm_per_a: 0.01, ..default };
    let refused = Compensator::<Fixed>::build(&configuration(weak), PERIOD).unwrap_err();
    assert_eq!(refused.field, "torque_limit_nm / torque_constant_nm_per_a");
    assert!(Compensator::<f32>::build(&configuration(weak), PERIOD).is_ok());
}
