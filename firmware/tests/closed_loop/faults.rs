//! Sensors that fail: the bridge opens or the loop goes on, and never a duty that is no number.

use crate::plant::Machine;
use crate::rig::{PERIOD_S, Rig, cycles, lugre, none, parameters};
use compensator_core::compensator::Reading;
use firmware::control::{
    Bridge, Covariates, CurrentLoop, Cycle, JointCompensator, LoopFlags, MotorParameters, Setpoint,
    StageSample, Valid,
};
use proptest::prelude::*;

fn open(cycle: &Cycle) -> bool {
    cycle.bridge == Bridge::Off
}

#[test]
fn bad_currents_open_the_bridge_for_their_cycle_alone() {
    let mut rig = Rig::settled(Machine::default(), parameters(), none());
    rig.setpoint.current_a = 2.0;
    rig.run(cycles(0.01));
    let good = rig.stage.measured();
    let [a, b, c] = good.currents_a;
    let all = Valid::all();
    for (currents_a, valid, flag) in [
        ([f32::NAN, b, c], good.valid, LoopFlags::CURRENT_INVALID),
        ([a, f32::INFINITY, c], good.valid, LoopFlags::CURRENT_INVALID),
        ([a, b, f32::NAN], all, LoopFlags::CURRENT_INVALID),
        ([a, b, c], Valid::BUS | Valid::ENCODER | Valid::CURRENT_B, LoopFlags::CURRENT_INVALID),
        ([41.0, -20.0, c], good.valid, LoopFlags::OVERCURRENT),
        ([-21.0, -21.0, c], good.valid, LoopFlags::OVERCURRENT),
        ([f32::MAX, f32::MIN, 0.0], good.valid, LoopFlags::CURRENT_INVALID),
    ] {
        rig.stage.forged = Some(StageSample { currents_a, valid, ..good });
        let cycle = rig.cycle();
        assert!(open(&cycle) && cycle.flags.contains(flag), "{currents_a:?}: {:?}", cycle.flags);
        let cycle = rig.cycle();
        assert!(!open(&cycle), "{:?}", cycle.flags);
    }
    // The third of an unmeasured phase may be anything.
    rig.stage.forged = Some(StageSample { currents_a: [a, b, f32::NAN], ..good });
    assert!(!open(&rig.cycle()));
    rig.stage.forged = Some(StageSample { currents_a: [a, b, 5.0 - a - b], valid: all, ..good });
    let cycle = rig.cycle();
    assert!(!open(&cycle) && cycle.flags.contains(LoopFlags::CURRENT_IMBALANCE));
    let end = rig.run(cycles(0.02));
    assert!((end.current_q_a - 2.0).abs() < 0.15, "{}", end.current_q_a);
}

#[test]
fn the_bus_is_held_for_twenty_cycles_and_its_range_kept() {
    let mut rig = Rig::settled(Machine::default(), parameters(), none());
    rig.setpoint.current_a = 1.0;
    rig.stage.valid.remove(Valid::BUS);
    for _ in 0..20 {
        let cycle = rig.cycle();
        assert!(!open(&cycle) && cycle.flags.contains(LoopFlags::BUS_INVALID));
    }
    let cycle = rig.cycle();
    assert!(open(&cycle) && cycle.flags.contains(LoopFlags::BUS_UNKNOWN));
    rig.stage.valid.insert(Valid::BUS);
    assert!(!open(&rig.cycle()));
    for (bus, flag) in [(17.9, LoopFlags::BUS_UNDERVOLTAGE), (56.1, LoopFlags::BUS_OVERVOLTAGE)] {
        rig.stage.forged = Some(StageSample { bus_v: bus, ..rig.stage.measured() });
        let cycle = rig.cycle();
        assert!(open(&cycle) && cycle.flags.contains(flag), "{bus}");
    }
    rig.stage.forged = Some(StageSample { bus_v: f32::NAN, ..rig.stage.measured() });
    let cycle = rig.cycle();
    assert!(!open(&cycle) && cycle.flags.contains(LoopFlags::BUS_INVALID));
    assert_eq!(cycle.bus_v, 56.1);
}

#[test]
fn an_encoder_that_goes_is_coasted_over_then_the_bridge_opens() {
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 0.6, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    rig.run(cycles(0.5));
    let before = rig.stage.plant.current()[1];
    rig.stage.valid.remove(Valid::ENCODER);
    let coast = cycles(f64::from(MotorParameters::default().encoder_coast_s));
    for k in 0..coast {
        let cycle = rig.cycle();
        assert!(cycle.flags.contains(LoopFlags::ENCODER_COASTING | LoopFlags::ENCODER_INVALID));
        assert!(!open(&cycle) && !cycle.residual_valid, "{k}");
    }
    // Torque went on meanwhile.
    assert!((rig.stage.plant.current()[1] - before).abs() < 0.2);
    let cycle = rig.cycle();
    assert!(open(&cycle) && cycle.flags.contains(LoopFlags::ENCODER_LOST), "{:?}", cycle.flags);
    assert!(cycle.flags.contains(LoopFlags::COMPENSATION_OFF));
    rig.run(cycles(0.01));
    assert!(rig.stage.plant.current()[1].abs() < 0.3, "the diodes end the current");
    // Back: open until the observer has settled, then as before.
    rig.stage.valid.insert(Valid::ENCODER);
    let mut waited = 0;
    while open(&rig.cycle()) {
        waited += 1;
    }
    let waited = waited as f32 * PERIOD_S;
    assert!((0.01..0.03).contains(&waited), "{waited}");
}

#[test]
fn the_rotor_coasts_through_every_second_sample_missing() {
    let mut rig =
        Rig::settled(Machine { driven: Some(5.0), ..Machine::default() }, parameters(), none());
    rig.setpoint.current_a = 5.0;
    for k in 0..cycles(0.1) {
        rig.stage.valid.set(Valid::ENCODER, k % 2 == 0);
        assert!(!open(&rig.cycle()));
    }
    let [d, q] = rig.stage.plant.current();
    assert!(d.abs() < 0.3 && (q - 5.0).abs() < 0.15, "{d} {q}");
}

#[test]
fn an_encoder_jump_is_not_driven_by() {
    let mut rig = Rig::settled(Machine::default(), parameters(), none());
    rig.setpoint.current_a = 1.5;
    rig.run(cycles(0.01));
    let good = rig.stage.measured();
    rig.stage.forged = Some(StageSample { encoder: good.encoder.wrapping_add(1 << 28), ..good });
    let cycle = rig.cycle();
    assert!(cycle.flags.contains(LoopFlags::ENCODER_IMPLAUSIBLE));
    assert!(!open(&cycle));
    rig.run(2);
    assert!((rig.stage.plant.current()[1] - 1.5).abs() < 0.1);
}

#[test]
fn not_driving_is_open_and_starts_without_a_bump() {
    let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
    rig.control.set_compensating(true);
    rig.setpoint = Setpoint { current_a: 3.0, velocity_reference_rad_s: 1.0, age_s: 0.0 };
    rig.run(cycles(0.1));
    rig.control.set_driving(false);
    let cycle = rig.run(cycles(0.02));
    assert!(open(&cycle));
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

fn anything() -> impl Strategy<Value = f32> {
    prop_oneof![
        4 => -60.0f32..60.0,
        2 => any::<u32>().prop_map(f32::from_bits),
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
        1 => Just(-0.0f32),
    ]
}

prop_compose! {
    fn any_reading()(value in anything(), age_s in anything()) -> Reading<f32> {
        Reading { value, age_s }
    }
}

prop_compose! {
    fn any_input()(
        currents_a in [anything(), anything(), anything()],
        bus_v in anything(),
        encoder in any::<u32>(),
        still in any::<bool>(),
        valid in prop_oneof![3 => Just(Valid::all()), 1 => any::<u8>().prop_map(Valid::from_bits_truncate)],
        setpoint in [anything(), anything(), anything()],
        readings in proptest::array::uniform5(any_reading()),
        campaign_time_h in anything(),
        orders in any::<u8>(),
    ) -> (StageSample, Setpoint, Covariates, u8) {
        let [radial_force_n, pressure_diff_mpa, temperature_c, load_torque_nm, auxiliary] = readings;
        // An encoder that stands still in half the samples lets the rotor be found.
        let encoder = if still { 77 << 20 } else { encoder };
        let [current_a, velocity_reference_rad_s, age_s] = setpoint;
        (
            StageSample { currents_a, bus_v, encoder, valid },
            Setpoint { current_a, velocity_reference_rad_s, age_s },
            Covariates {
                radial_force_n, pressure_diff_mpa, temperature_c, load_torque_nm, auxiliary,
                campaign_time_h,
            },
            orders,
        )
    }
}

fn check(cycle: &Cycle) -> Result<(), TestCaseError> {
    if let Bridge::Drive(duty) = cycle.bridge {
        prop_assert!(duty.iter().all(|share| (0.0..=1.0).contains(share)), "{:?}", cycle);
        prop_assert!(!cycle.flags.intersects(LoopFlags::FAULTS), "{:?}", cycle);
    }
    for number in [
        cycle.current_d_a,
        cycle.current_q_a,
        cycle.current_reference_a,
        cycle.voltage_v[0],
        cycle.voltage_v[1],
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
    fn whatever_is_measured_duties_are_numbers_and_the_loop_recovers(
        inputs in proptest::collection::vec(any_input(), 1..80),
    ) {
        let mut rig = Rig::settled(Machine::default(), parameters(), lugre(0.9));
        let mut fixed = CurrentLoop::new(
            parameters().build(PERIOD_S).expect("legal"),
            JointCompensator::<compensator_core::Fixed>::build(
                &firmware::reference_joint::configuration(compensator_core::LawKind::ImprovedLugre, &[]),
                PERIOD_S,
            ).expect("legal"),
        );
        for (sample, setpoint, covariates, orders) in inputs {
            rig.control.set_driving(orders & 3 != 0);
            rig.control.set_compensating(orders & 4 != 0);
            fixed.set_driving(orders & 3 != 0);
            fixed.set_compensating(orders & 4 != 0);
            check(&rig.control.step(&sample, &setpoint, &covariates))?;
            check(&fixed.step(&sample, &setpoint, &covariates))?;
        }
        // Well again: within 50 ms the loop drives as if nothing had been.
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
fn the_power_stage_is_opened_whenever_the_cycle_says_so() {
    let mut rig = Rig::settled(Machine::default(), parameters(), none());
    let before = rig.stage.offs;
    rig.control.set_driving(false);
    rig.run(5);
    assert_eq!(rig.stage.offs, before + 5);
}
