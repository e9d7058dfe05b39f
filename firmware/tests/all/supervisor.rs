//! Tests of the supervisor: arming, faults, time, temperature and the events it publishes.
//!
//! [`table`] raises and clears each code. [`properties`] checks invariants with random inputs.

mod bench;
mod properties;
mod table;

use bench::{Bench, STEP_US, healthy_observation};
use compensator_core::Flags;
use compensator_core::parameters::Bound;
use firmware::control::LoopFlags;
use firmware::supervisor::codes::{FAULT_CODES, register};
use firmware::supervisor::{
    ArmRefusal, CanState, Code, CodeSet, Event, JointState, Observation, ParameterSource, SelfTest,
    Supervisor, SupervisorBoot, Thresholds,
};

fn set(codes: &[Code]) -> CodeSet {
    let mut set = CodeSet::EMPTY;
    codes.iter().for_each(|code| set.insert(*code));
    set
}

#[test]
fn boot_without_causes_is_safe_without_events() {
    let mut bench = Bench::boot(&SupervisorBoot::default());
    assert_eq!(bench.supervisor.state(), JointState::Safe);
    assert!(!bench.supervisor.is_bridge_allowed() && !bench.supervisor.is_compensation_allowed());
    bench.run(5_000 * STEP_US);
    assert_eq!(bench.supervisor.state(), JointState::Safe);
    assert!(bench.events.is_empty());
    assert!(bench.supervisor.counts().iter().all(|count| *count == 0));
    assert!(bench.supervisor.limits().is_empty());
}

/// Returns the reasons that a refusal lists.
fn listed(refusal: &ArmRefusal) -> String {
    refusal.to_string().split_once(": ").expect("a list").1.to_owned()
}

#[test]
fn disarmed_joint_without_commands_reports_no_fault() {
    let mut bench = Bench::boot(&SupervisorBoot::default());
    bench.has_commands = false;
    bench.observation.bus_voltage_v = Some(0.0);
    bench.observation.heartbeat_lost = true;
    bench.observation.loop_flags = LoopFlags::ENCODER_LOST | LoopFlags::BUS_UNDERVOLTAGE;
    bench.run(500 * STEP_US);
    assert_eq!((bench.supervisor.state(), bench.events.len()), (JointState::Safe, 0));
    // Arming is refused and the refusal names every cause.
    let refusal = bench.supervisor.arm(bench.now_us).unwrap_err();
    let causes = "command-timeout heartbeat-lost bus-undervoltage encoder-lost";
    assert_eq!(listed(&refusal), causes);
}

#[test]
fn refused_arming_names_every_reason() {
    let mut supervisor = Supervisor::boot(&Thresholds::default(), &SupervisorBoot::default());
    let refusal = supervisor.arm(5).unwrap_err();
    assert_eq!(refusal.causes, set(&[Code::CommandTimeout]));
    assert_eq!(listed(&refusal), "command-timeout unobserved unmeasured");
    crate::message::check("refusals", "arming without commands", &refusal.to_string(), &[]);

    // A board that measures nothing cannot be armed.
    supervisor.record_command(1000);
    supervisor.observe(&Observation::default(), 1000);
    assert_eq!(listed(&supervisor.arm(1000).unwrap_err()), "unmeasured");
    // An observation counts for 20 ms.
    supervisor.observe(&healthy_observation(), 2000);
    assert_eq!(listed(&supervisor.arm(22_001).unwrap_err()), "unobserved");
    assert_eq!(listed(&supervisor.arm(1999).unwrap_err()), "unobserved");
    assert_eq!(supervisor.arm(22_000), Ok(()));
    // A second request leaves the joint armed.
    assert_eq!(supervisor.arm(90_000_000), Ok(()));
    supervisor.disarm();
    assert_eq!(supervisor.state(), JointState::Safe);
}

#[test]
fn setpoint_older_than_timeout_raises_command_timeout() {
    for timeout_us in [100_000, 20_000] {
        let thresholds = Thresholds { command_timeout_us: timeout_us, ..Thresholds::default() };
        let timeout = u64::from(timeout_us);
        let mut supervisor = Supervisor::boot(&thresholds, &SupervisorBoot::default());
        supervisor.observe(&healthy_observation(), 1_000_000);
        supervisor.record_command(1_000_000);
        supervisor.observe(&healthy_observation(), 1_000_001);
        assert_eq!(supervisor.arm(1_000_001), Ok(()));
        supervisor.observe(&healthy_observation(), 1_000_000 + timeout - 1);
        assert!(supervisor.is_bridge_allowed());
        supervisor.observe(&healthy_observation(), 1_000_000 + timeout);
        assert_eq!(supervisor.faults(), set(&[Code::CommandTimeout]));
        assert!(!supervisor.is_bridge_allowed() && !supervisor.is_compensation_allowed());

        // The same boundary at arming, by the time of the request.
        let later = 2_000_000;
        supervisor.record_command(later);
        supervisor.observe(&healthy_observation(), later);
        assert_eq!(supervisor.clear_faults(), Ok(()));
        supervisor.observe(&healthy_observation(), later + timeout - 1);
        assert!(supervisor.arm(later + timeout).is_err());
        assert_eq!(supervisor.arm(later + timeout - 1), Ok(()));
        supervisor.observe(&healthy_observation(), later + timeout);
        assert_eq!(supervisor.state(), JointState::Fault, "armed just before the timeout");
    }
}

#[test]
fn setpoint_between_two_observations_allows_arming() {
    let mut supervisor = Supervisor::boot(&Thresholds::default(), &SupervisorBoot::default());
    supervisor.observe(&healthy_observation(), 1_000_000);
    supervisor.record_command(1_000_100);
    assert_eq!(supervisor.arm(1_000_200), Ok(()));
    // The timeout runs from that set-point.
    supervisor.observe(&healthy_observation(), 1_100_100);
    assert_eq!(supervisor.faults(), set(&[Code::CommandTimeout]));
}

#[test]
fn overrun_disables_compensation_within_its_period() {
    let mut bench = Bench::armed();
    assert!(bench.supervisor.is_compensation_allowed());
    bench.supervisor.record_loop_overrun();
    // No observation in between: the interrupt asks in the same period.
    assert!(!bench.supervisor.is_compensation_allowed());
    assert!(bench.supervisor.is_bridge_allowed());
    assert_eq!(bench.supervisor.limits(), set(&[Code::LoopLate]));
    bench.supervisor.record_loop_on_time();
    assert!(!bench.supervisor.is_compensation_allowed());
    bench.run(100 * STEP_US);
    assert!(!bench.supervisor.is_compensation_allowed());
    bench.run(2 * STEP_US);
    assert!(bench.supervisor.is_compensation_allowed());

    // Two overruns and one period without do not make three in a row; three in a row trip.
    for _ in 0..20 {
        bench.supervisor.record_loop_overrun();
        bench.supervisor.record_loop_overrun();
        bench.supervisor.record_loop_on_time();
    }
    assert!(bench.supervisor.is_bridge_allowed());
    bench.supervisor.record_loop_overrun();
    bench.supervisor.record_loop_overrun();
    assert!(bench.supervisor.is_bridge_allowed());
    bench.supervisor.record_loop_overrun();
    assert!(!bench.supervisor.is_bridge_allowed());
    assert_eq!(bench.supervisor.faults(), set(&[Code::LoopOverrun]));
    assert_eq!(bench.supervisor.overruns(), 44);
    assert_eq!(bench.supervisor.count_of(Code::LoopLate), 2);
}

#[test]
fn trip_without_observation_opens_the_bridge() {
    for code in FAULT_CODES.iter() {
        let mut bench = Bench::armed();
        bench.supervisor.trip(code);
        assert!(!bench.supervisor.is_bridge_allowed(), "{code:?}");
        assert_eq!(bench.supervisor.faults(), set(&[code]));
        bench.run(2 * STEP_US);
        // No observation shows the cause.
        assert_eq!(bench.supervisor.clear_faults(), Ok(()));
    }
    for code in Code::ALL.iter().copied().filter(|code| !FAULT_CODES.contains(*code)) {
        let mut bench = Bench::armed();
        bench.supervisor.trip(code);
        assert!(bench.supervisor.is_armed() && bench.supervisor.limits().is_empty());
    }
}

#[test]
fn every_flag_raises_a_code_or_is_listed_as_silent() {
    // Flags that report the loop's orders, or that another code reports.
    let silent_flags = LoopFlags::BUS_INVALID
        | LoopFlags::POSITION_UNREFERENCED
        | LoopFlags::SETPOINT_STALE
        | LoopFlags::COVARIATE_INVALID
        | LoopFlags::COMPENSATION_OFF
        | LoopFlags::CROSS_FADING
        | LoopFlags::BRIDGE_OFF;
    for (name, flag) in LoopFlags::all().iter_names() {
        let mut bench = Bench::armed();
        bench.observation.loop_flags = flag;
        bench.run(200 * STEP_US);
        let is_silent = bench.events.is_empty();
        assert_eq!(is_silent, silent_flags.contains(flag), "{name}");
        let stops =
            LoopFlags::FAULTS | LoopFlags::VELOCITY_EXCEEDED | LoopFlags::ENCODER_IMPLAUSIBLE;
        assert_eq!(bench.supervisor.is_bridge_allowed(), !stops.contains(flag), "{name}");
    }
    // If one velocity is missing the other replaces it. Outside its training range a network's law uses its
    // constants, which the status and object 200Bh report.
    let silent_flags = Flags::DISABLED
        | Flags::VELOCITY_INVALID
        | Flags::REFERENCE_INVALID
        | Flags::NETWORK_OUTSIDE;
    for (name, flag) in Flags::all().iter_names() {
        let mut bench = Bench::armed();
        bench.observation.compensator = flag;
        bench.run(200 * STEP_US);
        assert_eq!(bench.events.is_empty(), silent_flags.contains(flag), "{name}");
    }
}

#[test]
fn unmeasured_quantity_is_ignored_and_invalid_one_raises_a_code() {
    let mut bench = Bench::boot(&SupervisorBoot::default());
    bench.observation = Observation::default();
    bench.run(500 * STEP_US);
    assert!(bench.events.is_empty());
    type Change = fn(&mut Observation);
    let rows: [(Change, Code); 5] = [
        (|seen| seen.bus_voltage_v = Some(f32::NAN), Code::AdcTimeout),
        (|seen| seen.phase_currents_a = Some([f32::INFINITY, 0.0, 0.0]), Code::Overcurrent),
        (|seen| seen.phase_currents_a = Some([0.0, f32::NAN, 0.0]), Code::CurrentSensorInvalid),
        (|seen| seen.motor_temperature_c = Some(f32::NAN), Code::TemperatureUnknown),
        (|seen| seen.bridge_temperature_c = Some(f32::INFINITY), Code::TemperatureUnknown),
    ];
    for (change, code) in rows {
        let mut bench = Bench::armed();
        change(&mut bench.observation);
        bench.run(200 * STEP_US);
        assert!(bench.supervisor.causes().contains(code), "{code:?}");
    }
}

#[test]
fn temperature_above_derating_level_reduces_current_share() {
    let share = |bridge: Option<f32>, motor: Option<f32>| {
        let mut bench = Bench::armed();
        bench.observation.bridge_temperature_c = bridge;
        bench.observation.motor_temperature_c = motor;
        bench.step();
        bench.supervisor.current_share()
    };
    assert_eq!(share(None, None), 1.0);
    assert_eq!(share(Some(-40.0), Some(100.0)), 1.0);
    assert_eq!(share(Some(90.0), Some(30.0)), 0.5);
    assert_eq!(share(Some(85.0), Some(115.0)), 0.25);
    assert_eq!(share(Some(100.0), None), 0.0);
    assert_eq!(share(Some(1e9), None), 0.0);
    assert_eq!(share(Some(f32::NAN), Some(30.0)), 0.5);
    assert_eq!(share(Some(f32::NAN), Some(118.0)), 0.1);
}

#[test]
fn cause_between_raise_and_clear_levels_stays_unchanged() {
    // A cause raised at its level stays until the clear level is reached.
    type Set = fn(&mut Observation, f32);
    let rows: [(Code, Set, f32, f32, f32); 6] = [
        (Code::BusOvervoltage, |seen, v| seen.bus_voltage_v = Some(v), 60.0, 56.1, 56.0),
        (Code::BusUndervoltage, |seen, v| seen.bus_voltage_v = Some(v), 36.0, 39.9, 40.0),
        (Code::BridgeOvertemperature, |s, v| s.bridge_temperature_c = Some(v), 100.0, 95.1, 95.0),
        (Code::MotorOvertemperature, |s, v| s.motor_temperature_c = Some(v), 120.0, 115.1, 115.0),
        (Code::Derated, |seen, v| seen.bridge_temperature_c = Some(v), 80.0, 75.1, 75.0),
        (Code::Overspeed, |seen, v| seen.velocity_rad_s = v, 14.0, 12.7, 12.5),
    ];
    for (code, put, level, between, left) in rows {
        let mut bench = Bench::armed();
        put(&mut bench.observation, between);
        bench.run(2_000 * STEP_US);
        assert!(!bench.supervisor.causes().contains(code), "{code:?}");
        put(&mut bench.observation, level);
        bench.run(2_000 * STEP_US);
        assert!(bench.supervisor.causes().contains(code), "{code:?}");
        put(&mut bench.observation, between);
        bench.run(2_000 * STEP_US);
        assert!(bench.supervisor.causes().contains(code), "{code:?}");
        put(&mut bench.observation, left);
        bench.run(2_000 * STEP_US);
        assert!(!bench.supervisor.causes().contains(code), "{code:?}");
    }
}

#[test]
fn flickering_cause_neither_raises_nor_clears() {
    let mut bench = Bench::armed();
    for _ in 0..1000 {
        bench.set_cause(Code::Overspeed, true);
        bench.run(5 * STEP_US);
        bench.set_cause(Code::Overspeed, false);
        bench.step();
    }
    assert!(bench.events.is_empty());
    bench.set_cause(Code::VoltageLimited, true);
    bench.run(10 * STEP_US);
    for _ in 0..100 {
        bench.set_cause(Code::VoltageLimited, false);
        bench.run(90 * STEP_US);
        bench.set_cause(Code::VoltageLimited, true);
        bench.step();
    }
    assert_eq!(bench.events, [Event { code: Code::VoltageLimited, raised: true }]);
}

#[test]
fn open_phase_is_distinguished_from_one_at_zero_current() {
    let is_phase_lost = |currents, setpoint, measured| {
        let mut bench = Bench::armed();
        bench.observation.phase_currents_a = Some(currents);
        (bench.observation.current_setpoint_a, bench.observation.current_a) = (setpoint, measured);
        bench.run(100 * STEP_US);
        bench.supervisor.faults().contains(Code::PhaseLost)
    };
    assert!(is_phase_lost([0.0, 5.0, -5.0], 10.0, 4.9));
    assert!(is_phase_lost([-5.0, 0.2, 5.0], -10.0, -4.9));
    // At a rotor angle where phase a carries nothing, the set-point is reached.
    assert!(!is_phase_lost([0.0, 8.7, -8.7], 10.0, 10.0));
    // Without voltage reserve all phases carry current; a small set-point is not checked.
    assert!(!is_phase_lost([-2.0, 4.0, -2.0], 10.0, 4.0));
    assert!(!is_phase_lost([0.0, 0.0, 0.0], 2.9, 0.0));
}

#[test]
fn bridge_stays_on_only_after_a_fault_that_permits_a_ramp() {
    let ramp = set(&[Code::CommandTimeout, Code::HeartbeatLost]);
    let silent = || {
        let mut bench = Bench::armed();
        bench.supervisor.set_ramp_faults(ramp);
        bench.has_commands = false;
        bench.run(200 * STEP_US);
        assert_eq!(bench.supervisor.state(), JointState::Fault);
        assert!(bench.supervisor.is_stopping() && bench.supervisor.is_bridge_allowed());
        assert!(!bench.supervisor.is_armed() && bench.supervisor.arm(bench.now_us).is_err());
        bench
    };
    // Another fault that permits it does not end the ramp, and one that does not opens the bridge.
    let mut bench = silent();
    bench.observation.heartbeat_lost = true;
    bench.run(5 * STEP_US);
    assert!(bench.supervisor.is_bridge_allowed());
    bench.observation.loop_flags = LoopFlags::ENCODER_LOST;
    bench.run(5 * STEP_US);
    assert!(!bench.supervisor.is_bridge_allowed(), "a fault that is watched while armed");
    let mut bench = silent();
    bench.supervisor.disarm();
    assert!(!bench.supervisor.is_bridge_allowed() && !bench.supervisor.is_stopping());
    // Without the permission, and for a joint that was not armed.
    let mut bench = Bench::armed();
    bench.supervisor.trip(Code::CommandTimeout);
    assert!(!bench.supervisor.is_bridge_allowed());
    let mut bench = Bench::boot(&SupervisorBoot::default());
    bench.supervisor.set_ramp_faults(ramp);
    bench.supervisor.trip(Code::CommandTimeout);
    assert!(!bench.supervisor.is_bridge_allowed());
}

#[test]
fn backwards_time_raises_internal_fault() {
    let mut bench = Bench::armed();
    bench.supervisor.observe(&bench.observation, bench.now_us - 1);
    assert_eq!(bench.supervisor.faults(), set(&[Code::Internal]));
    assert!(!bench.supervisor.is_bridge_allowed());
    bench.step();
    assert_eq!(bench.supervisor.clear_faults(), Ok(()));
}

#[test]
fn clear_faults_keeps_those_whose_cause_is_present() {
    let mut bench = Bench::armed();
    bench.set_cause(Code::GateDriverFault, true);
    bench.set_cause(Code::CanBusOff, true);
    bench.step();
    let both = set(&[Code::GateDriverFault, Code::CanBusOff]);
    assert_eq!(bench.supervisor.faults(), both);
    assert_eq!(both.error_register(), register::GENERIC | register::COMMUNICATION);
    assert_eq!((both.fault_bits(), both.limit_bits()), (1 << 2 | 1 << 9, 0));
    bench.set_cause(Code::GateDriverFault, false);
    bench.run(20 * STEP_US);
    assert_eq!(bench.supervisor.clear_faults(), Err(set(&[Code::CanBusOff])));
    assert_eq!(bench.supervisor.state(), JointState::Fault);
    bench.set_cause(Code::CanBusOff, false);
    bench.run(120 * STEP_US);
    assert_eq!(bench.supervisor.clear_faults(), Ok(()));
    assert_eq!(bench.supervisor.clear_faults(), Ok(()), "clearing without faults succeeds");
}

#[test]
fn full_event_queue_drops_the_oldest_events() {
    let mut supervisor = Supervisor::boot(&Thresholds::default(), &SupervisorBoot::default());
    for _ in 0..20 {
        supervisor.set_parameter_source(ParameterSource::Default);
        supervisor.set_parameter_source(ParameterSource::Set);
    }
    supervisor.set_self_test_result(Some(SelfTest::Duties));
    assert_eq!(supervisor.events_lost(), 9);
    let events: Vec<Event> = std::iter::from_fn(|| supervisor.take_event()).collect();
    assert_eq!(events.len(), 32);
    assert_eq!(events.last(), Some(&Event { code: Code::SelfTestFailed, raised: true }));
    assert_eq!(events[0], Event { code: Code::ParametersDefault, raised: false });
    assert_eq!(supervisor.count_of(Code::ParametersDefault), 20);
}

#[test]
fn invalid_thresholds_are_refused_by_name() {
    let default = Thresholds::default();
    assert_eq!(default.validate(), Ok(()));
    type Change = fn(&mut Thresholds);
    let rows: [(Change, &str, Bound); 12] = [
        (|t| t.command_timeout_us = 100_001, "command_timeout_us", Bound::AtMost(1e5)),
        (|t| t.command_timeout_us = 0, "command_timeout_us", Bound::AtLeast(1e3)),
        (|t| t.overruns_in_a_row = 0, "overruns_in_a_row", Bound::AtLeast(1.0)),
        (|t| t.overcurrent_a = f32::NAN, "overcurrent_a", Bound::Finite),
        (|t| t.overcurrent_a = 1.0, "overcurrent_a", Bound::MoreThan(1.0)),
        (|t| t.bus_overvoltage_v = 56.0, "bus_overvoltage_v", Bound::MoreThan(56.0)),
        (|t| t.bus_undervoltage_clear_v = 36.0, "bus_undervoltage_clear_v", Bound::MoreThan(36.0)),
        (|t| t.bus_overvoltage_clear_v = 40.0, "bus_overvoltage_clear_v", Bound::MoreThan(40.0)),
        (|t| t.bridge_trip_c = 85.0, "bridge_trip_c", Bound::MoreThan(85.0)),
        (|t| t.motor_trip_c = 300.0, "motor_trip_c", Bound::AtMost(250.0)),
        (|t| t.phase_check_a = 0.6, "phase_check_a", Bound::MoreThan(0.6)),
        (|t| t.temperature_hysteresis_c = 0.0, "temperature_hysteresis_c", Bound::AtLeast(0.5)),
    ];
    let mut bench = Bench::armed();
    for (change, field, bound) in rows {
        let mut thresholds = default;
        change(&mut thresholds);
        let error = bench.supervisor.configure(&thresholds).unwrap_err();
        assert_eq!((error.field.as_str(), error.bound), (field, bound));
        assert_eq!(bench.supervisor.thresholds(), &default);
        // At boot the defaults apply and a code is raised.
        let supervisor = Supervisor::boot(&thresholds, &SupervisorBoot::default());
        assert_eq!(supervisor.thresholds(), &default);
        assert_eq!(supervisor.limits(), set(&[Code::ParametersRefused]));
    }
    let other = Thresholds { bus_overvoltage_v: 70.0, ..default };
    assert_eq!(bench.supervisor.configure(&other), Ok(()));
    bench.observation.bus_voltage_v = Some(65.0);
    bench.run(10 * STEP_US);
    assert!(bench.supervisor.is_armed());
}

#[test]
fn error_passive_and_bus_off_raise_separate_codes() {
    let mut bench = Bench::armed();
    bench.observation.can = CanState::Passive;
    bench.step();
    assert!(bench.supervisor.is_armed());
    bench.observation.can = CanState::Off;
    bench.step();
    assert_eq!(bench.supervisor.faults(), set(&[Code::CanBusOff]));
}
