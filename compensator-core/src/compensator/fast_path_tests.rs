//! Tests that the fast path and the general path of a step give identical bits for every input.

use super::*;
use crate::{LawKind, Parameters};
use core::fmt::Debug;
use proptest::prelude::*;
use std::vec::Vec;

const PERIOD_S: f32 = 50e-6;

/// Computes a step through every guard and every limit, whether or not they act.
fn guarded_step<T: Real>(joint: &mut Compensator<T>, inputs: &Inputs<T>) -> CompensatorOutput<T> {
    let mut flags = Flags::empty();
    let velocities = joint.replaced_velocities(inputs, &mut flags);
    let velocity_rad_s = joint.blended(velocities.measured, velocities.reference);
    let seal = joint.guarded_seal(inputs, &mut flags);
    let sample = Sample {
        velocity_rad_s,
        radial_force_n: seal.force_n,
        radial_force_change_n: seal.force_change_n,
        pressure_diff_mpa: seal.pressure_mpa,
        ..Sample::default()
    };
    let friction = joint.model.step(&mut joint.state, &sample);
    joint.finish_limited(friction, velocities.weight, flags)
}

fn joint<T: Real<Setting = f32>>(
    law: LawKind,
    parameters: CompensatorParameters,
) -> Compensator<T> {
    let model = Parameters::<f32>::new(law)
        .with(crate::ParameterId::CoulombTorque, 1.5)
        .with(crate::ParameterId::StaticTorque, 2.2)
        .with(crate::ParameterId::StribeckVelocity, 0.1)
        .with(crate::ParameterId::BristleStiffness, 1e4)
        .with(crate::ParameterId::BristleDamping, 0.4)
        .with(crate::ParameterId::ViscousFriction, 0.08)
        .with(crate::ParameterId::RadialForceCoulomb, 0.01)
        .with(crate::ParameterId::PressureCoulomb, 2.4e-6)
        .with(crate::ParameterId::RadialForceRate, 1e-6);
    let configuration = Configuration { model, compensator: parameters };
    let mut joint = Compensator::build(&configuration, PERIOD_S).unwrap();
    joint.set_enabled(true);
    joint
}

/// Draws a nominal value, a value at an edge of the valid range, or an arbitrary bit pattern.
fn value(nominal: core::ops::Range<f32>, edge: f32) -> impl Strategy<Value = f32> {
    let edges =
        std::vec![0.0, -0.0, edge, -edge, edge.next_up(), edge.next_down(), f32::NAN, 1e-42];
    prop_oneof![
        20 => nominal,
        1 => prop::sample::select(edges),
        1 => any::<u32>().prop_map(f32::from_bits),
    ]
}

fn reading(nominal: core::ops::Range<f32>, edge: f32) -> impl Strategy<Value = (f32, f32)> {
    let hold = CompensatorParameters::default().hold_s;
    (
        value(nominal, edge),
        prop_oneof![9 => value(0.0..0.01, hold), 1 => Just(-1.0), 3 => hold..0.7],
    )
}

/// Value and age, s, of measured velocity, reference velocity, side load and pressure.
type Readings = [(f32, f32); 4];

/// Draws a sequence of samples: nominal ones, ones with a small side load, ones at an edge of the valid range, and
/// invalid ones. Side load and pressure are sometimes missing, for some samples or for all.
fn reading_sequences() -> impl Strategy<Value = Vec<Readings>> {
    let loads = prop::sample::select(std::vec![40.0f32..40.5, -0.01..0.4, 99.6..100.0]);
    (loads, any::<bool>()).prop_flat_map(|(load, sensors)| {
        let sample = (
            reading(-3.0..3.0, 12.0),
            reading(-3.0..3.0, 12.0),
            reading(load, 100.0),
            reading(-0.01..0.3, 0.3),
            if sensors { 0u8..10 } else { 0..1 },
        );
        let sample = sample.prop_map(|(a, b, c, d, seal_draw)| {
            let missing = (0.0, -1.0);
            if seal_draw == 0 { [a, b, missing, missing] } else { [a, b, c, d] }
        });
        prop::collection::vec((sample, 1usize..4), 1..40).prop_map(|samples| {
            samples.into_iter().flat_map(|(sample, times)| std::vec![sample; times]).collect()
        })
    })
}

fn parameters() -> impl Strategy<Value = CompensatorParameters> {
    // The ranges exclude what `build` rejects: a slew limit of 0, and values that fixed point cannot represent to 1e-3.
    let zero_or_up_to = |max: f32| prop_oneof![1 => Just(0.0), 9 => 0.01..=max];
    let limits = (zero_or_up_to(6.0), 0.01f32..4000.0, zero_or_up_to(1.0), any::<bool>());
    limits.prop_map(|(torque_limit_nm, slew_limit_nm_per_s, scale, wide)| {
        let defaults = CompensatorParameters::default();
        if wide {
            return defaults;
        }
        CompensatorParameters { torque_limit_nm, slew_limit_nm_per_s, scale, ..defaults }
    })
}

/// Returns the output and the state after a step as bit patterns. Bits distinguish -0 from 0 and one NaN from another.
fn result_bits<T: Real>(
    joint: &Compensator<T>,
    output: &CompensatorOutput<T>,
) -> impl Debug + PartialEq + use<T> {
    let bits = |number: T| number.value().to_bits();
    let held = |held: &Held<T>| (bits(held.value), bits(held.age_s));
    (
        bits(output.friction_torque_nm),
        bits(output.compensation_torque_nm),
        bits(output.feed_forward_current_a),
        output.flags,
        bits(joint.bristle_torque_nm()),
        (held(&joint.radial_force), held(&joint.pressure)),
    )
}

fn compare_paths<T: Real<Setting = f32>>(
    law: LawKind,
    parameters: CompensatorParameters,
    samples: &[Readings],
) -> Result<(), TestCaseError> {
    let mut fast = joint::<T>(law, parameters);
    let mut general = fast.clone();
    for sample in samples {
        let number = |value: f32| T::from_f64(value.into());
        let [velocity, reference, force, pressure] =
            sample.map(|(value, age_s)| Reading { value: number(value), age_s: number(age_s) });
        let inputs = Inputs {
            velocity_reference_rad_s: reference,
            radial_force_n: force,
            pressure_diff_mpa: pressure,
            velocity_rad_s: velocity,
            ..Inputs::velocity(T::zero())
        };
        let (fast_output, general_output) =
            (fast.step(&inputs), guarded_step(&mut general, &inputs));
        prop_assert_eq!(result_bits(&fast, &fast_output), result_bits(&general, &general_output));
        for command in [0.5, -0.0, 25.0, 1e5, f32::NAN].map(number) {
            let (fast_sum, flags) = fast.sum(command, &fast_output);
            let (general_sum, general_flags) = general.sum_limited(command, &general_output);
            prop_assert_eq!(
                (fast_sum.value().to_bits(), flags),
                (general_sum.value().to_bits(), general_flags)
            );
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn fast_path_with_arbitrary_readings_matches_general_path(
        samples in reading_sequences(),
        parameters in parameters(),
    ) {
        for law in [LawKind::ImprovedLugre, LawKind::Lugre, LawKind::Linear] {
            compare_paths::<f32>(law, parameters, &samples)?;
            compare_paths::<crate::Fixed>(law, parameters, &samples)?;
        }
    }
}

/// Ensures that the test above exercises the fast path.
#[test]
fn step_with_valid_readings_takes_fast_path() {
    fn takes_fast_path<T: Real<Setting = f32>>(readings: Readings) -> bool {
        let joint = {
            let mut joint = joint::<T>(LawKind::ImprovedLugre, CompensatorParameters::default());
            joint.radial_force = Held { value: T::from_f64(40.0), age_s: T::zero() };
            joint
        };
        let number = |value: f32| T::from_f64(value.into());
        let [velocity_rad_s, velocity_reference_rad_s, radial_force_n, pressure_diff_mpa] =
            readings.map(|(value, age_s)| Reading { value: number(value), age_s: number(age_s) });
        let inputs = Inputs {
            velocity_rad_s,
            velocity_reference_rad_s,
            radial_force_n,
            pressure_diff_mpa,
            ..Inputs::velocity(T::zero())
        };
        let change = radial_force_n.value - joint.radial_force.value;
        joint.is_fast_path
            && !(joint.velocities_guard_mask(&inputs) | joint.seal_guard_mask(&inputs, change))
                .is_set()
    }
    let valid = [(1.0, 0.0), (-11.0, 0.01), (40.5, 0.05), (0.2, 0.1)];
    assert!(takes_fast_path::<f32>(valid) && takes_fast_path::<crate::Fixed>(valid));
    for (index, invalid) in
        [(13.0, 0.0), (1.0, 0.2), (90.0, 0.0), (-0.1, 0.0)].into_iter().enumerate()
    {
        let mut readings = valid;
        readings[index] = invalid;
        assert!(
            !takes_fast_path::<f32>(readings) && !takes_fast_path::<crate::Fixed>(readings),
            "{index}"
        );
    }
}

/// `within_level` does not change a value for which [`Real::past_level_mask`] is clear. The fast path relies on it.
#[test]
fn within_level_without_past_level_mask_returns_number_unchanged() {
    for bits in [0, 1, -1, 1 << 20, -(1 << 20), (1 << 20) - 1, i32::MAX, i32::MIN] {
        for bound in [0, 1, 1 << 20, i32::MAX] {
            let (number, bound) = (crate::Fixed::from_bits(bits), crate::Fixed::from_bits(bound));
            let changed = number.within_level(bound) != number;
            assert!(!changed || number.past_level_mask(bound).is_set(), "{number:?} {bound:?}");
        }
    }
}

/// The age at which the weight reaches 0 is above `hold_s` in every number type. A reading within `hold_s` does not
/// fade.
#[test]
fn built_parameters_keep_faded_age_above_hold_time() {
    for hold_s in [0.0, 1e-6, 0.1, 500.0, 1000.0] {
        let parameters =
            CompensatorParameters { hold_s, fade_s: 1e-4, ..CompensatorParameters::default() };
        let float = joint::<f32>(LawKind::Lugre, parameters).built;
        let fixed = BuiltParameters::<crate::Fixed>::new(
            &parameters,
            &crate::Envelope::default(),
            PERIOD_S,
        );
        assert!(float.hold_s < float.faded_s, "{hold_s}");
        if let Ok(fixed) = fixed {
            assert!(fixed.hold_s < fixed.faded_s.within_level(fixed.faded_s), "{hold_s}");
        }
    }
}
