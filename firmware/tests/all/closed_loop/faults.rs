//! Tests of sensor faults. The loop opens the bridge or continues, and every duty is a number from 0 to 1.

use super::plant::Machine;
use super::rig::{PERIOD_S, Rig, cycles, lugre, no_compensation, parameters};
use compensator_core::compensator::Reading;
use firmware::control::{
    Bridge, Covariates, CurrentLoop, CycleResult, JointCompensator, LoopFlags, MotorParameters,
    Setpoint, StageSample, ValidChannels,
};
use proptest::prelude::*;

fn is_open(cycle: &CycleResult) -> bool {
    cycle.bridge == Bridge::Off
}

#[test]
fn bridge_with_invalid_currents_opens_for_one_cycle() {
    let mut rig = Rig::settled(Machine::default(), parameters(), no_compensation());
    rig.setpoint.current_a = 2.0;
    rig.run(cycles(0.01));
    let good = rig.stage.measure();
    let [a, b, c] = good.currents_a;
    let all = ValidChannels::all();
    for (currents_a, valid, flag) in [
        ([f32::NAN, b, c], good.valid, LoopFlags::CURRENT_INVALID),
        ([a, f32::INFINITY, c], good.valid, LoopFlags::CURRENT_INVALID),
        ([a, b, f32::NAN], all, LoopFlags::CURRENT_INVALID),
        (
            [a, b, c],
            ValidChannels::BUS | ValidChannels::ENCODER | ValidChannels::CURRENT_B,
            LoopFlags::CURRENT_INVALID,
        ),
        ([41.0, -20.0, c], good.valid, LoopFlags::OVERCURRENT),
        ([-21.0, -21.0, c], good.valid, LoopFlags::OVERCURRENT),
        ([f32::MAX, f32::MIN, 0.0], good.valid, LoopFlags::CURRENT_INVALID),
    ] {
        rig.stage.injected_sample = Some(StageSample { currents_a, valid, ..good });
        let cycle = rig.cycle();
        assert!(is_open(&cycle) && cycle.flags.contains(flag), "{currents_a:?}: {:?}", cycle.flags);
        let cycle = rig.cycle();
        assert!(!is_open(&cycle), "{:?}", cycle.flags);
    }
    // The value of an unmeasured phase is ignored.
    rig.stage.injected_sample = Some(StageSample { currents_a: [a, b, f32::NAN], ..good });
    assert!(!is_open(&rig.cycle()));
    rig.stage.injected_sample =
        Some(StageSample { currents_a: [a, b, 5.0 - a - b], valid: all, ..good });
    let cycle = rig.cycle();
    assert!(!is_open(&cycle) && cycle.flags.contains(LoopFlags::CURRENT_IMBALANCE));
    let end = rig.run(cycles(0.02));
    assert!((end.current_q_a - 2.0).abs() < 0.15, "{}", end.current_q_a);
}

#[test]
fn bus_voltage_without_measurement_is_held_for_twenty_cycles() {
    let mut rig = Rig::settled(Machine::default(), parameters(), no_compensation());
    rig.setpoint.current_a = 1.0;
    rig.stage.valid.remove(ValidChannels::BUS);
    for _ in 0..20 {
        let cycle = rig.cycle();
        assert!(!is_open(&cycle) && cycle.flags.contains(LoopFlags::BUS_INVALID));
    }
    let cycle = rig.cycle();
    assert!(is_open(&cycle) && cycle.flags.contains(LoopFlags::BUS_UNKNOWN));
    rig.stage.valid.insert(ValidChannels::BUS);
    assert!(!is_open(&rig.cycle()));
    for (bus, flag) in [(17.9, LoopFlags::BUS_UNDERVOLTAGE), (56.1, LoopFlags::BUS_OVERVOLTAGE)] {
        rig.stage.injected_sample = Some(StageSample { bus_v: bus, ..rig.stage.measure() });
        let cycle = rig.cycle();
        assert!(is_open(&cycle) && cycle.flags.contains(flag), "{bus}");
    }
    rig.stage.injected_sample = Some(StageSample { bus_v: f32::NAN, ..rig.stage.measure() });
    let cycle = rig.cycle();
    assert!(!is_open(&cycle) && cycle.flags.contains(LoopFlags::BUS_INVALID));
    assert_eq!(cycle.bus_v, 56.1);
}

#[test]
fn bridge_with_lost_encoder_opens_after_coast_time() {
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 0.6, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    rig.run(cycles(0.5));
    let before = rig.stage.plant.current()[1];
    rig.stage.valid.remove(ValidChannels::ENCODER);
    let coast_cycles = cycles(f64::from(MotorParameters::default().encoder_coast_s));
    for k in 0..coast_cycles {
        let cycle = rig.cycle();
        assert!(cycle.flags.contains(LoopFlags::ENCODER_COASTING | LoopFlags::ENCODER_INVALID));
        assert!(!is_open(&cycle) && !cycle.residual_valid, "{k}");
    }
    // The torque continues during the coast time.
    assert!((rig.stage.plant.current()[1] - before).abs() < 0.2);
    let cycle = rig.cycle();
    assert!(is_open(&cycle) && cycle.flags.contains(LoopFlags::ENCODER_LOST), "{:?}", cycle.flags);
    assert!(cycle.flags.contains(LoopFlags::COMPENSATION_OFF));
    rig.run(cycles(0.01));
    assert!(rig.stage.plant.current()[1].abs() < 0.3, "the current continues with an open bridge");
    // After the encoder returns, the bridge stays open until the observer has settled.
    rig.stage.valid.insert(ValidChannels::ENCODER);
    let mut wait_cycles = 0;
    while is_open(&rig.cycle()) {
        wait_cycles += 1;
    }
    let wait_s = wait_cycles as f32 * PERIOD_S;
    assert!((0.01..0.03).contains(&wait_s), "{wait_s}");
}

#[test]
fn field_orientation_with_every_second_sample_missing_stays_aligned() {
    let mut rig = Rig::settled(
        Machine { driven: Some(5.0), ..Machine::default() },
        parameters(),
        no_compensation(),
    );
    rig.setpoint.current_a = 5.0;
    for k in 0..cycles(0.1) {
        rig.stage.valid.set(ValidChannels::ENCODER, k % 2 == 0);
        assert!(!is_open(&rig.cycle()));
    }
    let [d, q] = rig.stage.plant.current();
    assert!(d.abs() < 0.3 && (q - 5.0).abs() < 0.15, "{d} {q}");
}

#[test]
fn current_after_single_encoder_jump_is_unchanged() {
    let mut rig = Rig::settled(Machine::default(), parameters(), no_compensation());
    rig.setpoint.current_a = 1.5;
    rig.run(cycles(0.01));
    let good = rig.stage.measure();
    rig.stage.injected_sample =
        Some(StageSample { encoder: good.encoder.wrapping_add(1 << 28), ..good });
    let cycle = rig.cycle();
    assert!(cycle.flags.contains(LoopFlags::ENCODER_IMPLAUSIBLE));
    assert!(!is_open(&cycle));
    rig.run(2);
    assert!((rig.stage.plant.current()[1] - 1.5).abs() < 0.1);
}

#[test]
fn bridge_enabled_after_disable_starts_without_current_peak() {
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 3.0, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    rig.run(cycles(0.1));
    rig.control.set_driving(false);
    let cycle = rig.run(cycles(0.02));
    assert!(is_open(&cycle));
    assert!(cycle.flags.contains(LoopFlags::BRIDGE_OFF | LoopFlags::COMPENSATION_OFF));
    rig.setpoint.current_a = 0.0;
    rig.control.set_compensating(false);
    rig.control.set_driving(true);
    let peak = (0..cycles(0.005)).fold(0.0f64, |peak, _| {
        rig.cycle();
        peak.max(rig.stage.plant.current()[1].abs())
    });
    assert!(peak < 0.6, "{peak}");
}

/// Generates plausible values, arbitrary bits and special values.
fn any_number() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -60.0f32..60.0,
        2 => any::<u32>().prop_map(f32::from_bits),
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
        1 => Just(-0.0f32),
    ]
}

prop_compose! {
    fn any_reading()(value in any_number(), age_s in any_number()) -> Reading<f32> {
        Reading { value, age_s }
    }
}

prop_compose! {
    fn any_input()(
        currents_a in [any_number(), any_number(), any_number()],
        bus_v in any_number(),
        encoder in any::<u32>(),
        is_constant in any::<bool>(),
        valid in prop_oneof![3 => Just(ValidChannels::all()), 1 => any::<u8>().prop_map(ValidChannels::from_bits_truncate)],
        setpoint in [any_number(), any_number(), any_number()],
        readings in proptest::array::uniform5(any_reading()),
        campaign_time_h in any_number(),
        enable_bits in any::<u8>(),
    ) -> (StageSample, Setpoint, Covariates, u8) {
        let [radial_force_n, pressure_diff_mpa, temperature_c, load_torque_nm, auxiliary] = readings;
        // In half of the samples the encoder is constant, so that the observer can settle.
        let encoder = if is_constant { 77 << 20 } else { encoder };
        let [current_a, velocity_reference_rad_s, age_s] = setpoint;
        (
            StageSample { currents_a, bus_v, encoder, valid },
            Setpoint { current_a, velocity_reference_rad_s, age_s },
            Covariates {
                radial_force_n, pressure_diff_mpa, temperature_c, load_torque_nm, auxiliary,
                campaign_time_h,
            },
            enable_bits,
        )
    }
}

/// Checks that the outputs are finite and that the bridge is off if there is a fault.
fn check_cycle(cycle: &CycleResult) -> Result<(), TestCaseError> {
    if let Bridge::Drive(duty) = cycle.bridge {
        prop_assert!(duty.iter().all(|share| (0.0..=1.0).contains(share)), "{:?}", cycle);
        prop_assert!(!cycle.flags.intersects(LoopFlags::FAULTS), "{:?}", cycle);
    }
    for number in [
        cycle.current_d_a,
        cycle.current_q_a,
        cycle.current_reference_a,
        cycle.voltage_v.d,
        cycle.voltage_v.q,
        cycle.bus_v,
        cycle.position_rad,
        cycle.velocity_rad_s,
        cycle.acceleration_rad_s2,
        cycle.friction_torque_nm,
        cycle.feed_forward_current_a,
        cycle.motor_torque_nm,
        cycle.residual_torque_nm,
    ] {
        prop_assert!(number.is_finite(), "{:?}", cycle);
    }
    prop_assert!(cycle.current_reference_a.abs() <= 26.0);
    prop_assert!(!cycle.flags.contains(LoopFlags::NOT_FINITE), "{:?}", cycle);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn loop_with_arbitrary_inputs_gives_valid_duties_and_recovers(
        inputs in proptest::collection::vec(any_input(), 1..80),
    ) {
        let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
        let mut fixed = CurrentLoop::new(
            parameters().build(PERIOD_S).expect("valid parameters"),
            JointCompensator::<compensator_core::Fixed>::build(
                &firmware::reference_joint::configuration(compensator_core::LawKind::ImprovedLugre, &[]),
                PERIOD_S,
            ).expect("the joint is valid"),
        );
        for (sample, setpoint, covariates, enable_bits) in inputs {
            rig.control.set_driving(enable_bits & 3 != 0);
            rig.control.set_compensating(enable_bits & 4 != 0);
            fixed.set_driving(enable_bits & 3 != 0);
            fixed.set_compensating(enable_bits & 4 != 0);
            check_cycle(&rig.control.step(&sample, &setpoint, &covariates))?;
            check_cycle(&fixed.step(&sample, &setpoint, &covariates))?;
        }
        // With valid inputs, the loop works normally within 50 ms.
        rig.control.set_driving(true);
        rig.control.set_compensating(true);
        rig.setpoint = Setpoint { current_a: 1.0, velocity_reference_rad_s: 0.0, age_s: 0.0 };
        let cycle = rig.run(cycles(0.05));
        prop_assert!(!cycle.flags.intersects(LoopFlags::FAULTS), "{:?}", cycle.flags);
        let q = rig.stage.plant.current()[1];
        prop_assert!((q - f64::from(cycle.current_reference_a)).abs() < 0.3, "{} {:?}", q, cycle);
    }
}

#[test]
fn power_stage_is_switched_off_in_each_cycle_with_bridge_off() {
    let mut rig = Rig::settled(Machine::default(), parameters(), no_compensation());
    let before = rig.stage.off_count;
    rig.control.set_driving(false);
    rig.run(5);
    assert_eq!(rig.stage.off_count, before + 5);
}
