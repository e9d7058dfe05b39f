//! The short way of a step and the long one: the same bits, whatever comes.

use super::*;
use crate::{LawKind, Parameters};
use core::fmt::Debug;
use proptest::prelude::*;
use std::vec::Vec;

const PERIOD_S: f32 = 50e-6;

/// A step with every guard and every limit gone through, whether there is anything for it to do or not.
fn long_way<T: Real>(joint: &mut Compensator<T>, inputs: &Inputs<T>) -> Output<T> {
    let mut flags = Flags::empty();
    let (measured, reference, trust) = joint.replaced_velocities(inputs, &mut flags);
    let velocity_rad_s = joint.blended(measured, reference);
    let seal = joint.guarded_seal(inputs, &mut flags);
    let sample = Sample {
        velocity_rad_s,
        radial_force_n: seal.force_n,
        radial_force_change_n: seal.force_change_n,
        pressure_diff_mpa: seal.pressure_mpa,
        ..Sample::default()
    };
    let friction = joint.model.step(&mut joint.state, &sample);
    joint.finish(friction, trust, flags)
}

fn joint<T: Real<Setting = f32>>(law: LawKind, written: CompensatorParameters) -> Compensator<T> {
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
    let configuration = Configuration { model, compensator: written };
    let mut joint = Compensator::build(&configuration, PERIOD_S).unwrap();
    joint.set_enabled(true);
    joint
}

/// A value from a joint that is well, one at an edge, or anything.
fn value(well: core::ops::Range<f32>, edge: f32) -> impl Strategy<Value = f32> {
    let edges =
        std::vec![0.0, -0.0, edge, -edge, edge.next_up(), edge.next_down(), f32::NAN, 1e-42];
    prop_oneof![
        20 => well,
        1 => prop::sample::select(edges),
        1 => any::<u32>().prop_map(f32::from_bits),
    ]
}

fn reading(well: core::ops::Range<f32>, edge: f32) -> impl Strategy<Value = (f32, f32)> {
    let hold = CompensatorParameters::default().hold_s;
    (value(well, edge), prop_oneof![9 => value(0.0..0.01, hold), 1 => Just(-1.0), 3 => hold..0.7])
}

type Heard = [(f32, f32); 4];

/// Samples one after the other: those of a joint that is well, at rest under its load or at an edge of what is legal,
/// with what goes wrong among them; now and then neither side load nor pressure is heard, for a while or ever.
fn heard() -> impl Strategy<Value = Vec<Heard>> {
    let loads = prop::sample::select(std::vec![40.0f32..40.5, -0.01..0.4, 99.6..100.0]);
    (loads, any::<bool>()).prop_flat_map(|(load, sensors)| {
        let sample = (
            reading(-3.0..3.0, 12.0),
            reading(-3.0..3.0, 12.0),
            reading(load, 100.0),
            reading(-0.01..0.3, 0.3),
            if sensors { 0u8..10 } else { 0..1 },
        );
        let sample = sample.prop_map(|(a, b, c, d, heard)| {
            let missing = (0.0, -1.0);
            if heard == 0 { [a, b, missing, missing] } else { [a, b, c, d] }
        });
        prop::collection::vec((sample, 1usize..4), 1..40).prop_map(|samples| {
            samples.into_iter().flat_map(|(sample, times)| std::vec![sample; times]).collect()
        })
    })
}

fn written() -> impl Strategy<Value = CompensatorParameters> {
    // What `build` refuses is kept out: no slew at all, and what fixed point cannot hold to a thousandth.
    let nothing_or = |most: f32| prop_oneof![1 => Just(0.0), 9 => 0.01..=most];
    let limits = (nothing_or(6.0), 0.01f32..4000.0, nothing_or(1.0), any::<bool>());
    limits.prop_map(|(torque_limit_nm, slew_limit_nm_per_s, scale, wide)| {
        let usual = CompensatorParameters::default();
        if wide {
            return usual;
        }
        CompensatorParameters { torque_limit_nm, slew_limit_nm_per_s, scale, ..usual }
    })
}

/// Every word that a step leaves behind, debug-printed so that no NaN equals itself by chance and no -0 a 0.
fn left<T: Real>(joint: &Compensator<T>, output: &Output<T>) -> impl Debug + PartialEq + use<T> {
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

fn both_ways<T: Real<Setting = f32>>(
    law: LawKind,
    written: CompensatorParameters,
    samples: &[Heard],
) -> Result<(), TestCaseError> {
    let mut short = joint::<T>(law, written);
    let mut long = short.clone();
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
        let (by_short, by_long) = (short.step(&inputs), long_way(&mut long, &inputs));
        prop_assert_eq!(left(&short, &by_short), left(&long, &by_long));
        for command in [0.5, -0.0, 25.0, 1e5, f32::NAN].map(number) {
            let (quick, flags) = short.sum(command, &by_short);
            let (slow, slow_flags) = long.sum_limited(command, &by_long);
            prop_assert_eq!((quick.value().to_bits(), flags), (slow.value().to_bits(), slow_flags));
        }
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]
    #[test]
    fn the_short_way_has_the_bits_of_the_long_one(samples in heard(), written in written()) {
        for law in [LawKind::ImprovedLugre, LawKind::Lugre, LawKind::Linear] {
            both_ways::<f32>(law, written, &samples)?;
            both_ways::<crate::Fixed>(law, written, &samples)?;
        }
    }
}

/// Without this the test above would pass where no step ever took the short way.
#[test]
fn readings_that_are_well_take_the_short_way() {
    fn taken<T: Real<Setting = f32>>(heard: [(f32, f32); 4]) -> bool {
        let joint = {
            let mut joint = joint::<T>(LawKind::ImprovedLugre, CompensatorParameters::default());
            joint.radial_force = Held { value: T::from_f64(40.0), age_s: T::zero() };
            joint
        };
        let number = |value: f32| T::from_f64(value.into());
        let [velocity_rad_s, velocity_reference_rad_s, radial_force_n, pressure_diff_mpa] =
            heard.map(|(value, age_s)| Reading { value: number(value), age_s: number(age_s) });
        let inputs = Inputs {
            velocity_rad_s,
            velocity_reference_rad_s,
            radial_force_n,
            pressure_diff_mpa,
            ..Inputs::velocity(T::zero())
        };
        let change = radial_force_n.value - joint.radial_force.value;
        joint.quick
            && !(joint.doubt_velocities(&inputs) | joint.doubt_seal(&inputs, change)).is_set()
    }
    let well = [(1.0, 0.0), (-11.0, 0.01), (40.5, 0.05), (0.2, 0.1)];
    assert!(taken::<f32>(well) && taken::<crate::Fixed>(well));
    for (index, wrong) in
        [(13.0, 0.0), (1.0, 0.2), (90.0, 0.0), (-0.1, 0.0)].into_iter().enumerate()
    {
        let mut heard = well;
        heard[index] = wrong;
        assert!(!taken::<f32>(heard) && !taken::<crate::Fixed>(heard), "{index}");
    }
}

/// What [`Real::past_level_mask`] lets pass `within_level` leaves alone, and the short way relies on it.
#[test]
fn what_is_not_past_a_level_is_left_alone_by_it() {
    for bits in [0, 1, -1, 1 << 20, -(1 << 20), (1 << 20) - 1, i32::MAX, i32::MIN] {
        for bound in [0, 1, 1 << 20, i32::MAX] {
            let (number, bound) = (crate::Fixed::from_bits(bits), crate::Fixed::from_bits(bound));
            let changed = number.within_level(bound) != number;
            assert!(!changed || number.past_level_mask(bound).is_set(), "{number:?} {bound:?}");
        }
    }
}

/// A reading younger than it is held is one that has not begun to fade: the times leave no room between.
#[test]
fn held_and_faded_are_apart_in_every_number() {
    for hold_s in [0.0, 1e-6, 0.1, 500.0, 1000.0] {
        let written =
            CompensatorParameters { hold_s, fade_s: 1e-4, ..CompensatorParameters::default() };
        let float = joint::<f32>(LawKind::Lugre, written).built;
        let fixed = Built::<crate::Fixed>::new(&written, &crate::Envelope::default(), PERIOD_S);
        assert!(float.hold_s < float.faded_s, "{hold_s}");
        if let Ok(fixed) = fixed {
            assert!(fixed.hold_s < fixed.faded_s.within_level(fixed.faded_s), "{hold_s}");
        }
    }
}
