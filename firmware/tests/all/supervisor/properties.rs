//! Invariants of the supervisor for random inputs in random order.

use super::bench::{STEP_US, healthy_observation};
use compensator_core::Flags;
use firmware::control::LoopFlags;
use firmware::sensors::enclosure::Findings;
use firmware::store::StoreHealth;
use firmware::supervisor::codes::{COMPENSATION_DROPPING_CODES, FAULT_CODES};
use firmware::supervisor::{
    CanState, Code, JointState, Observation, ParameterSource, ResetCause, SelfTest, Supervisor,
    SupervisorBoot, Thresholds,
};
use proptest::prelude::*;

#[derive(Clone, Debug)]
enum Step {
    Observe(Box<Observation>),
    Command,
    Arm,
    Disarm,
    Clear,
    Overrun(u8),
    Trip(Code),
    Store(StoreHealth),
    Parameters(ParameterSource),
    SelfTest(bool),
}

fn number() -> impl Strategy<Value = f32> {
    prop_oneof![6 => -130.0_f32..130.0, 1 => any::<f32>(), 1 => Just(f32::NAN)]
}

fn observation() -> impl Strategy<Value = Observation> {
    let quiet = prop_oneof![3 => Just(0_u32), 1 => any::<u32>()];
    let measured = (
        proptest::option::of(number()),
        proptest::option::of(prop::array::uniform3(number())),
        prop::array::uniform6(number()),
        proptest::option::of(0_u32..2000),
    );
    let flags = (quiet.clone(), quiet, 0_u8..3, proptest::option::of(any::<bool>()));
    let bits = (
        prop::bool::weighted(0.05),
        prop::bool::weighted(0.95),
        prop::bool::weighted(0.05),
        prop::bool::weighted(0.05),
    );
    let rarely = || prop::bool::weighted(0.05);
    let motor = (rarely(), rarely(), any::<bool>(), any::<bool>());
    let motor = (motor, any::<[bool; 2]>(), [rarely(), rarely(), rarely()]);
    let all = (measured, flags, bits, motor, any::<bool>());
    all.prop_map(|(measured, flags, bits, motor, is_healthy)| {
        let (voltage, currents, [a, b, c, d, e, f], age) = measured;
        let (loop_bits, core_bits, can, in_band) = flags;
        let (motor, [radial_force_stuck, pressure_stuck], position) = motor;
        let [position_missing, following_error, turns_unseen] = position;
        if is_healthy {
            return healthy_observation();
        }
        let [leak_stops, leak_is_reported, is_torque_off] = [bits.0, bits.2, bits.3];
        let enclosure =
            Findings { leak_stops, leak_is_reported, is_torque_off, ..Findings::default() };
        Observation {
            bus_voltage_v: voltage,
            phase_currents_a: currents,
            current_a: a,
            current_setpoint_a: b,
            velocity_rad_s: c,
            bridge_temperature_c: Some(d),
            motor_temperature_c: Some(e),
            winding_temperature_c: Some(f),
            motor_against: motor.0,
            turns_unseen,
            motor_stands: motor.1,
            position_missing,
            following_error,
            stalled: motor.2,
            brake_test_failed: bits.1,
            over_compensated: motor.3,
            radial_force_stuck,
            pressure_stuck,
            sample_age_us: age,
            gate_driver_fault: bits.0,
            system_break: bits.3,
            magnet_fault: bits.2,
            enclosure,
            bridge_shorted: bits.0,
            stack_intact: bits.1,
            can: [CanState::Active, CanState::Passive, CanState::Off][usize::from(can)],
            heartbeat_lost: bits.2,
            loop_flags: LoopFlags::from_bits_truncate(loop_bits),
            compensator: Flags::from_bits_truncate(core_bits),
            model_in_band: in_band,
        }
    })
}

fn step() -> impl Strategy<Value = Step> {
    let code = (0..Code::ALL.len()).prop_map(|index| Step::Trip(Code::ALL[index]));
    let health = prop::sample::select(vec![
        StoreHealth::Sound,
        StoreHealth::Reduced,
        StoreHealth::Empty,
        StoreHealth::Damaged,
        StoreHealth::Foreign,
    ]);
    let in_use = prop::sample::select(vec![
        ParameterSource::Set,
        ParameterSource::Default,
        ParameterSource::DefaultRefused,
    ]);
    prop_oneof![
        12 => observation().prop_map(|seen| Step::Observe(Box::new(seen))),
        8 => Just(Step::Command),
        6 => Just(Step::Arm),
        1 => Just(Step::Disarm),
        6 => Just(Step::Clear),
        1 => (0_u8..5).prop_map(Step::Overrun),
        1 => code,
        1 => health.prop_map(Step::Store),
        1 => in_use.prop_map(Step::Parameters),
        1 => prop::bool::weighted(0.8).prop_map(Step::SelfTest),
    ]
}

fn boot() -> impl Strategy<Value = SupervisorBoot> {
    let resets = vec![ResetCause::PowerOn, ResetCause::Software, ResetCause::Watchdog];
    (prop::sample::select(resets), prop::bool::weighted(0.1)).prop_map(|(reset, panicked)| {
        SupervisorBoot { reset, panicked, ..SupervisorBoot::default() }
    })
}

/// Checks what holds in every state.
fn check_invariants(supervisor: &Supervisor) -> Result<(), TestCaseError> {
    let state = supervisor.state();
    prop_assert_eq!(supervisor.is_bridge_allowed(), state == JointState::Armed);
    prop_assert_eq!(state == JointState::Fault, !supervisor.faults().is_empty());
    prop_assert!(!supervisor.is_compensation_allowed() || state == JointState::Armed);
    let dropped = supervisor.limits().intersects(COMPENSATION_DROPPING_CODES);
    prop_assert!(!(dropped && supervisor.is_compensation_allowed()));
    prop_assert!(supervisor.faults().without(FAULT_CODES).is_empty());
    prop_assert!(!supervisor.limits().intersects(FAULT_CODES));
    prop_assert!((0.0..=1.0).contains(&supervisor.current_share()));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]
    #[test]
    fn random_inputs_never_arm_unrequested_nor_close_the_bridge_on_fault(
        boot in boot(),
        steps in proptest::collection::vec((step(), 0_u64..150), 1..200)
    ) {
        let mut supervisor = Supervisor::boot(&Thresholds::default(), &boot);
        let mut now_us = 10_000_000_u64;
        let mut last_command_us = None;
        prop_assert!(!supervisor.is_bridge_allowed());
        for (step, wait) in steps {
            // Usually the next millisecond, sometimes a long pause.
            now_us += STEP_US * if wait > 130 { wait } else { 1 };
            let before = supervisor.state();
            let held = supervisor.faults();
            let mut asked = false;
            let mut cleared = false;
            match step {
                Step::Observe(seen) => {
                    supervisor.observe(&seen, now_us);
                    let late = last_command_us.is_none_or(|last| now_us - last >= 100_000);
                    prop_assert!(!(late && supervisor.is_bridge_allowed()), "armed without a set-point");
                }
                Step::Command => {
                    supervisor.record_command(now_us);
                    last_command_us = Some(now_us);
                }
                Step::Arm => {
                    let armed = supervisor.arm(now_us);
                    asked = armed.is_ok();
                    prop_assert_eq!(armed.is_ok(), supervisor.is_armed());
                    if let Err(refusal) = armed {
                        prop_assert!(
                            !refusal.causes.is_empty() || refusal.unobserved || refusal.unmeasured
                        );
                        prop_assert_eq!(supervisor.state(), before);
                    } else {
                        prop_assert!(held.is_empty());
                    }
                }
                Step::Disarm => supervisor.disarm(),
                Step::Clear => {
                    cleared = true;
                    let result = supervisor.clear_faults();
                    prop_assert_eq!(result.is_ok(), supervisor.faults().is_empty());
                }
                Step::Overrun(times) => {
                    for _ in 0..times {
                        supervisor.record_loop_overrun();
                        prop_assert!(!supervisor.is_compensation_allowed());
                    }
                    supervisor.record_loop_on_time();
                }
                Step::Trip(code) => {
                    supervisor.trip(code);
                    prop_assert!(!(FAULT_CODES.contains(code) && supervisor.is_bridge_allowed()));
                }
                Step::Store(health) => supervisor.set_store_health(health),
                Step::Parameters(in_use) => supervisor.set_parameter_source(in_use),
                Step::SelfTest(passed) => {
                    supervisor.set_self_test_result((!passed).then_some(SelfTest::Wiring));
                },
            }
            let state = supervisor.state();
            prop_assert!(
                state != JointState::Armed || before == JointState::Armed || asked,
                "armed without a request"
            );
            prop_assert!(before != JointState::Fault || state == JointState::Fault || cleared);
            prop_assert!(held.without(supervisor.faults()).is_empty() || cleared, "a fault cleared by itself");
            check_invariants(&supervisor)?;
            while supervisor.take_event().is_some() {}
        }
    }
}
