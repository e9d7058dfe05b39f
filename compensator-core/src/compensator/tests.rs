use super::*;
use crate::parameters::{LawKind, ParameterId, Parameters};
#[cfg(feature = "terms")]
use crate::quantity::Quantity;
use crate::term::TermKind;
#[cfg(feature = "terms")]
use crate::term::{LOOKUP_LEVELS, LOOKUP_TORQUES};
use proptest::prelude::*;

const PERIOD_S: f32 = 50e-6;

fn configuration() -> Configuration {
    let model = Parameters::<f32>::new(LawKind::ImprovedLugre)
        .with(ParameterId::CoulombTorque, 1.5)
        .with(ParameterId::StaticTorque, 2.2)
        .with(ParameterId::StribeckVelocity, 0.1)
        .with(ParameterId::BristleStiffness, 1e4)
        .with(ParameterId::BristleDamping, 30.0)
        .with(ParameterId::ViscousFriction, 0.08)
        .with(ParameterId::RadialForceCoulomb, 0.01)
        .with(ParameterId::PressureCoulomb, 2.4e-6)
        .with(ParameterId::RadialForceRate, 1e-6);
    let mut configuration = Configuration { model, compensator: CompensatorParameters::default() };
    configuration.model.choices.damping_fades = true;
    configuration
}

fn enabled(configuration: &Configuration) -> Compensator<f32> {
    let mut compensator = Compensator::build(configuration, PERIOD_S).unwrap();
    compensator.set_enabled(true);
    compensator
}

fn loaded(velocity: f32) -> Inputs<f32> {
    Inputs {
        radial_force_n: Reading::fresh(40.0),
        pressure_diff_mpa: Reading::fresh(0.2),
        ..Inputs::velocity(velocity)
    }
}

fn settle(
    compensator: &mut Compensator<f32>,
    inputs: &Inputs<f32>,
    samples: usize,
) -> CompensatorOutput<f32> {
    (0..samples).map(|_| compensator.step(inputs)).last().unwrap()
}

#[test]
fn step_in_steady_sliding_returns_scaled_friction_level() {
    let configuration = configuration();
    let mut compensator = enabled(&configuration);
    let output = settle(&mut compensator, &loaded(2.0), 4000);
    let level = 1.5 + 40.0 * 0.01 + 0.2 * 2.4;
    let friction = level + 0.08 * 2.0;
    assert!((output.friction_torque_nm - friction).abs() < 1e-3, "{output:?}");
    assert!((output.compensation_torque_nm - 0.9 * friction).abs() < 1e-3);
    assert_eq!(output.flags, Flags::REFERENCE_INVALID);
}

#[test]
fn step_of_law_without_seal_load_ignores_force_and_pressure() {
    let mut configuration = configuration();
    configuration.model.law = LawKind::Lugre;
    let (mut with, mut without) = (enabled(&configuration), enabled(&configuration));
    for sample in 0..2000 {
        let velocity = (sample as f32 * 0.01).sin();
        let a = with.step(&loaded(velocity)).friction_torque_nm;
        let b = without.step(&Inputs::velocity(velocity)).friction_torque_nm;
        assert_eq!(a.to_bits(), b.to_bits());
    }
}

/// A step of 120 N between two frames is 2.4 MN/s if it counts as the change within one 50 us sample. Without the
/// limit, bristle damping turns that rate into 10^4 Nm.
#[test]
fn step_with_side_load_step_between_frames_stays_bounded_and_settles() {
    let mut configuration = configuration();
    configuration.model.set(ParameterId::RadialForceRate, 1e-4);
    configuration.model.set(ParameterId::BristleDamping, 40.0);
    configuration.model.envelope.radial_force_max_n = 400.0;
    configuration.model.choices.allow_active = true;
    let mut compensator = enabled(&configuration);
    let at = |radial_force_n| Inputs {
        radial_force_n: Reading::fresh(radial_force_n),
        ..Inputs::velocity(2.0)
    };
    settle(&mut compensator, &at(0.0), 4000);
    let mut largest_torque = 0.0f32;
    for _ in 0..400 {
        let output = compensator.step(&at(120.0));
        assert!(!output.flags.contains(Flags::MODEL_NOT_FINITE), "{output:?}");
        largest_torque = largest_torque.max(output.friction_torque_nm.abs());
    }
    assert!(largest_torque < 500.0, "{largest_torque}");
    let settled = settle(&mut compensator, &at(120.0), 4000).friction_torque_nm;
    let level = 1.5 + 120.0 * 0.01 + 0.08 * 2.0;
    assert!((settled - level).abs() < 1e-2, "{settled}, {level}");
}

#[test]
fn step_with_stale_load_and_pressure_fades_continuously_to_plain_law() {
    let configuration = configuration();
    let mut compensator = enabled(&configuration);
    let before = settle(&mut compensator, &loaded(2.0), 4000).friction_torque_nm;
    let plain = 1.5 + 0.08 * 2.0;
    let mut last = before;
    for sample in 0..14_000 {
        let output = compensator.step(&Inputs::velocity(2.0));
        assert!((output.friction_torque_nm - last).abs() < 2e-3);
        last = output.friction_torque_nm;
        let stale = output.flags.contains(Flags::RADIAL_FORCE_STALE | Flags::PRESSURE_STALE);
        // The values are held for hold_s = 0.1 s (2000 samples) and fade to 0 over another 0.4 s.
        if sample < 1990 {
            assert!(!stale && (last - before).abs() < 1e-3, "{sample}");
        }
        if sample > 2010 {
            assert!(stale);
        }
    }
    assert!((last - plain).abs() < 1e-3, "{last} {plain}");
}

/// Returns a configuration whose lookup-table term follows one column. The term adds 0.5 Nm and half the level at
/// every value of that column.
#[cfg(feature = "terms")]
fn with_lookup_term(column: Quantity) -> Configuration {
    let mut configuration = configuration();
    assert!(configuration.model.add_term(TermKind::LookupTable));
    configuration.model.set(ParameterId::LookupColumn, f32::from(column.info().column.unwrap()));
    for id in LOOKUP_TORQUES {
        configuration.model.set(id, 0.5);
    }
    for id in LOOKUP_LEVELS {
        configuration.model.set(id, 0.5);
    }
    configuration
}

#[cfg(feature = "terms")]
#[test]
fn lookup_term_with_missing_column_fades_to_zero() {
    let all = |velocity: f32| Inputs {
        position_rad: Reading::fresh(1.0),
        temperature_c: Reading::fresh(12.0),
        load_torque_nm: Reading::fresh(-3.0),
        auxiliary: Reading::fresh(7.0),
        ..loaded(velocity)
    };
    let missing = Reading::missing();
    for column in Quantity::ALL.iter().copied().filter(|of| of.info().column.is_some()) {
        let configuration = with_lookup_term(column);
        let mut compensator = enabled(&configuration);
        let without_column = match column {
            Quantity::Position => Inputs { position_rad: missing, ..all(2.0) },
            Quantity::RadialForce => Inputs { radial_force_n: missing, ..all(2.0) },
            Quantity::Pressure => Inputs { pressure_diff_mpa: missing, ..all(2.0) },
            Quantity::Temperature => Inputs { temperature_c: missing, ..all(2.0) },
            Quantity::LoadTorque => Inputs { load_torque_nm: missing, ..all(2.0) },
            Quantity::Auxiliary => Inputs { auxiliary: missing, ..all(2.0) },
            // Without a velocity the whole compensation is withdrawn. The campaign time cannot be missing.
            _ => all(2.0),
        };
        let before = settle(&mut compensator, &all(2.0), 4000).friction_torque_nm;
        let level = 1.5 + 40.0 * 0.01 + 0.2 * 2.4;
        assert!((before - (1.5 * level + 0.08 * 2.0 + 0.5)).abs() < 1e-3, "{column:?}: {before}");
        let mut last = before;
        for sample in 0..14_000 {
            let torque = compensator.step(&without_column).friction_torque_nm;
            assert!((torque - last).abs() < 3e-3, "{column:?} at {sample}");
            last = torque;
            if sample < 1990 {
                assert!((last - before).abs() < 1e-3, "{column:?} at {sample}");
            }
        }
        let expected = match column {
            Quantity::Velocity | Quantity::CampaignTime => before,
            Quantity::RadialForce => 1.5 + 0.2 * 2.4 + 0.16,
            Quantity::Pressure => 1.5 + 40.0 * 0.01 + 0.16,
            _ => level + 0.16,
        };
        assert!((last - expected).abs() < 1e-3, "{column:?}: {last} {expected}");
    }
}

/// Parts of a drive's torque that are not friction: to add inertia would be positive feedback.
#[cfg(feature = "terms")]
#[test]
fn step_with_rigid_body_parts_adds_friction_alone() {
    let plain = configuration();
    let mut whole = configuration();
    for (kind, id, value) in [
        (TermKind::UnmodelledInertia, ParameterId::Inertia, 0.5),
        (TermKind::TorqueOffset, ParameterId::TorqueOffset, 0.7),
        (TermKind::LoadGain, ParameterId::LoadGain, 0.9),
        (TermKind::ChannelDelay, ParameterId::ChannelDelay, 5.5 * PERIOD_S),
    ] {
        assert!(whole.model.add_term(kind));
        whole.model.set(id, value);
    }
    assert_eq!(whole.model.left_out().count(), 4);
    let (mut plain, mut whole) = (enabled(&plain), enabled(&whole));
    for sample in 0..4000 {
        let accelerating = 100.0 * (sample as f32 * 0.01).sin();
        let inputs = Inputs {
            acceleration_rad_s2: Reading::fresh(accelerating),
            load_torque_nm: Reading::fresh(5.0),
            ..loaded((sample as f32 * 0.003).sin())
        };
        let (plain, whole) = (plain.step(&inputs), whole.step(&inputs));
        let apart = (plain.feed_forward_current_a - whole.feed_forward_current_a).abs();
        assert!(apart < 1e-5, "{sample}: {plain:?} {whole:?}");
    }
}

#[cfg(feature = "terms")]
#[test]
fn step_with_invalid_auxiliary_flags_and_replaces_it() {
    let configuration = with_lookup_term(Quantity::Auxiliary);
    let mut compensator = enabled(&configuration);
    let with = |auxiliary| Inputs { auxiliary, ..loaded(2.0) };
    let before = settle(&mut compensator, &with(Reading::fresh(7.0)), 4000);
    assert!(!before.flags.intersects(Flags::AUXILIARY_INVALID | Flags::AUXILIARY_STALE));
    for invalid in [f32::NAN, f32::INFINITY, -2e9] {
        let output = compensator.step(&with(Reading::fresh(invalid)));
        assert!(output.flags.contains(Flags::AUXILIARY_INVALID));
        assert!((output.friction_torque_nm - before.friction_torque_nm).abs() < 1e-3);
    }
    let old = Reading { value: 7.0, age_s: 0.3 };
    assert!(compensator.step(&with(old)).flags.contains(Flags::AUXILIARY_STALE));
}

#[test]
fn step_with_invalid_inputs_flags_and_replaces_them() {
    let configuration = configuration();
    let mut compensator = enabled(&configuration);
    let before = settle(&mut compensator, &loaded(2.0), 4000).friction_torque_nm;
    for (invalid, flag) in [
        (
            Inputs { radial_force_n: Reading::fresh(f32::NAN), ..loaded(2.0) },
            Flags::RADIAL_FORCE_INVALID,
        ),
        (
            Inputs { radial_force_n: Reading::fresh(-5.0), ..loaded(2.0) },
            Flags::RADIAL_FORCE_INVALID,
        ),
        (
            Inputs { radial_force_n: Reading::fresh(1e6), ..loaded(2.0) },
            Flags::RADIAL_FORCE_INVALID,
        ),
        (
            Inputs { pressure_diff_mpa: Reading::fresh(f32::INFINITY), ..loaded(2.0) },
            Flags::PRESSURE_INVALID,
        ),
    ] {
        let output = compensator.step(&invalid);
        assert!(output.flags.contains(flag), "{output:?}");
        assert!((output.friction_torque_nm - before).abs() < 1e-3);
        assert!(!compensator.step(&loaded(2.0)).flags.contains(flag), "the flag clears");
    }
    let velocity = Inputs {
        velocity_rad_s: Reading::fresh(f32::NAN),
        velocity_reference_rad_s: Reading::fresh(2.0),
        ..loaded(2.0)
    };
    let output = compensator.step(&velocity);
    assert!(output.flags.contains(Flags::VELOCITY_INVALID));
    assert!((output.friction_torque_nm - before).abs() < 1e-3);
}

#[test]
fn step_without_velocity_withdraws_compensation_at_slew_limit() {
    let configuration = configuration();
    let mut compensator = enabled(&configuration);
    let mut last = settle(&mut compensator, &loaded(2.0), 4000).compensation_torque_nm;
    let step = 2000.0 * PERIOD_S;
    for _ in 0..100 {
        let output = compensator.step(&loaded(f32::NAN));
        assert!(last - output.compensation_torque_nm <= step * 1.001);
        last = output.compensation_torque_nm;
    }
    assert_eq!(last, 0.0);
}

#[test]
fn step_near_standstill_takes_direction_of_reference() {
    let configuration = configuration();
    let mut compensator = enabled(&configuration);
    let mut output = None;
    for sample in 0..4000 {
        let noise = if sample % 2 == 0 { 1e-3 } else { -1e-3 };
        output = Some(
            compensator
                .step(&Inputs { velocity_reference_rad_s: Reading::fresh(0.02), ..loaded(noise) }),
        );
    }
    assert!(output.unwrap().friction_torque_nm > 1.5);
}

#[test]
fn sum_beyond_limits_is_limited_and_flagged() {
    let mut configuration = configuration();
    configuration.compensator.current_limit_a = 10.0;
    let mut compensator = enabled(&configuration);
    let output = settle(&mut compensator, &loaded(2.0), 4000);
    let (sum, flags) = compensator.sum(9.5, &output);
    assert_eq!(sum, 10.0);
    assert!(flags.contains(Flags::CURRENT_LIMITED));
    let (sum, flags) = compensator.sum(5.0, &output);
    assert_eq!(sum, 5.0 + output.feed_forward_current_a);
    assert!(!flags.contains(Flags::CURRENT_LIMITED));
    let (sum, flags) = compensator.sum(f32::NAN, &output);
    assert_eq!(sum, output.feed_forward_current_a);
    assert!(flags.contains(Flags::COMMAND_INVALID));

    configuration.compensator.torque_limit_nm = 1.0;
    let mut compensator = enabled(&configuration);
    let output = settle(&mut compensator, &loaded(2.0), 4000);
    assert_eq!(output.compensation_torque_nm, 1.0);
    assert!(output.flags.contains(Flags::TORQUE_LIMITED));
}

#[test]
fn step_beyond_slew_limit_sets_flag() {
    let mut configuration = configuration();
    configuration.compensator.slew_limit_nm_per_s = 10.0;
    let mut compensator = enabled(&configuration);
    let output = settle(&mut compensator, &loaded(2.0), 100);
    assert!(output.flags.contains(Flags::SLEW_LIMITED));
    assert!((output.compensation_torque_nm - 100.0 * 10.0 * PERIOD_S).abs() < 1e-5);
}

#[test]
fn sum_of_disabled_compensator_returns_command_bits() {
    let configuration = configuration();
    let mut compensator = Compensator::<f32>::build(&configuration, PERIOD_S).unwrap();
    for command in [0.0, -0.0, 1.25, -3.5e-39, 25.999] {
        let output = compensator.step(&loaded(2.0));
        assert_eq!(output.flags, Flags::DISABLED);
        let (sum, _) = compensator.sum(command, &output);
        assert_eq!(sum.to_bits(), f32::to_bits(command));
    }
}

#[test]
fn build_with_invalid_parameter_returns_error_naming_field() {
    for (field, change) in [
        (
            "scale",
            (|p: &mut CompensatorParameters| p.scale = 1.1) as fn(&mut CompensatorParameters),
        ),
        ("torque_limit_nm", |p| p.torque_limit_nm = f32::NAN),
        ("fade_s", |p| p.fade_s = 0.0),
        ("torque_constant_nm_per_a", |p| p.torque_constant_nm_per_a = 0.0),
    ] {
        let mut invalid = configuration();
        change(&mut invalid.compensator);
        assert_eq!(Compensator::<f32>::build(&invalid, PERIOD_S).unwrap_err().field, field);
    }
}

fn any_float() -> impl Strategy<Value = f32> {
    prop_oneof![any::<f32>(), any::<u32>().prop_map(f32::from_bits), -20.0f32..20.0]
}

fn reading() -> impl Strategy<Value = Reading<f32>> {
    (any_float(), any_float()).prop_map(|(value, age_s)| Reading { value, age_s })
}

prop_compose! {
    fn inputs()(
        velocity_rad_s in reading(), velocity_reference_rad_s in reading(),
        position_rad in reading(), acceleration_rad_s2 in reading(), radial_force_n in reading(),
        pressure_diff_mpa in reading(), temperature_c in reading(), load_torque_nm in reading(),
        auxiliary in reading(), campaign_time_h in any_float(),
    ) -> Inputs<f32> {
        Inputs {
            velocity_rad_s, velocity_reference_rad_s, position_rad, acceleration_rad_s2,
            radial_force_n, pressure_diff_mpa, temperature_c, load_torque_nm, auxiliary,
            campaign_time_h,
        }
    }
}

proptest! {
    /// The output is finite and within its limits for every input, and no input causes a panic.
    #[test]
    fn step_with_arbitrary_inputs_returns_bounded_output(
        inputs in proptest::collection::vec(inputs(), 1..60),
        command in any_float(),
        with_terms in any::<bool>(),
    ) {
        let mut configuration = configuration();
        if with_terms && cfg!(feature = "terms") {
            for kind in [TermKind::TemperatureViscous, TermKind::PositionRipple,
                TermKind::LookupTable, TermKind::DwellTimeStatic, TermKind::Backlash,
                TermKind::UnmodelledInertia, TermKind::ChannelDelay, TermKind::TimeDrift] {
                prop_assert!(configuration.model.add_term(kind));
            }
            configuration.model.set(ParameterId::RippleSine, 0.2);
            configuration.model.set(ParameterId::LookupColumn, 7.0);
            configuration.model.set(ParameterId::LookupTorque3, 1.0);
            configuration.model.set(ParameterId::LookupLevel5, 0.5);
            configuration.model.set(ParameterId::DwellGain, 0.1);
            configuration.model.set(ParameterId::BacklashTravel, 1e-3);
            configuration.model.set(ParameterId::Inertia, 0.01);
            configuration.model.set(ParameterId::ChannelDelay, 5.5 * PERIOD_S);
            configuration.model.set(ParameterId::TemperatureViscosity, 0.02);
        }
        let mut compensator = enabled(&configuration);
        let mut last = 0.0f32;
        for inputs in &inputs {
            let output = compensator.step(inputs);
            prop_assert!(output.compensation_torque_nm.abs() <= 6.0);
            prop_assert!((output.compensation_torque_nm - last).abs() <= 0.1001);
            prop_assert!(!output.flags.contains(Flags::MODEL_NOT_FINITE));
            last = output.compensation_torque_nm;
            let (sum, _) = compensator.sum(command, &output);
            prop_assert!(sum.abs() <= 26.0);
        }
    }
}
