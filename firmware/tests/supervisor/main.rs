//! The supervisor: arming, trips, time, temperature and what it is told of.
//!
//! Each code is raised and cleared in [`table`]; what holds whatever comes is in [`properties`].

mod bench;
mod properties;
mod table;

use bench::{Bench, STEP_US, well};
use compensator_core::Flags;
use compensator_core::parameters::Bound;
use firmware::control::LoopFlags;
use firmware::supervisor::codes::{STOPPING, register};
use firmware::supervisor::{
    Boot, CanState, Code, CodeSet, Event, InUse, Observation, State, Supervisor, Thresholds,
};

fn set(codes: &[Code]) -> CodeSet {
    let mut set = CodeSet::EMPTY;
    codes.iter().for_each(|code| set.insert(*code));
    set
}

#[test]
fn a_clean_start_is_safe_and_silent() {
    let mut bench = Bench::boot(&Boot::default());
    assert_eq!(bench.supervisor.state(), State::Safe);
    assert!(!bench.supervisor.bridge_allowed() && !bench.supervisor.compensation_allowed());
    bench.run(5_000 * STEP_US);
    assert_eq!(bench.supervisor.state(), State::Safe);
    assert!(bench.events.is_empty());
    assert!(bench.supervisor.counts().iter().all(|count| *count == 0));
    assert!(bench.supervisor.limits().is_empty());
}

#[test]
fn a_joint_nobody_talks_to_is_safe_and_no_fault() {
    let mut bench = Bench::boot(&Boot::default());
    bench.commanded = false;
    bench.seen.bus_voltage_v = Some(0.0);
    bench.seen.heartbeat_lost = true;
    bench.seen.loop_flags = LoopFlags::ENCODER_LOST | LoopFlags::BUS_UNDERVOLTAGE;
    bench.run(500 * STEP_US);
    assert_eq!((bench.supervisor.state(), bench.events.len()), (State::Safe, 0));
    // But it is not armed like that, and says all of why.
    let refusal = bench.supervisor.arm(bench.now_us).unwrap_err();
    assert_eq!(
        refusal.to_string(),
        "not armed: command-timeout heartbeat-lost bus-undervoltage encoder-lost"
    );
}

#[test]
fn arming_is_refused_with_every_reason() {
    let mut supervisor = Supervisor::boot(&Thresholds::default(), &Boot::default());
    let refusal = supervisor.arm(5).unwrap_err();
    assert_eq!(refusal.causes, set(&[Code::CommandTimeout]));
    assert_eq!(refusal.to_string(), "not armed: command-timeout unobserved unmeasured");

    // A board that measures nothing cannot be armed.
    supervisor.command_received(1000);
    supervisor.observe(&Observation::default(), 1000);
    assert_eq!(supervisor.arm(1000).unwrap_err().to_string(), "not armed: unmeasured");
    // An observation counts for 20 ms.
    supervisor.observe(&well(), 2000);
    assert_eq!(supervisor.arm(22_001).unwrap_err().to_string(), "not armed: unobserved");
    assert_eq!(supervisor.arm(1999).unwrap_err().to_string(), "not armed: unobserved");
    assert_eq!(supervisor.arm(22_000), Ok(()));
    // Armed is armed, and asking again does no harm.
    assert_eq!(supervisor.arm(90_000_000), Ok(()));
    supervisor.disarm();
    assert_eq!(supervisor.state(), State::Safe);
}

#[test]
fn the_set_point_may_be_a_tenth_of_a_second_old_and_no_older() {
    for timeout_us in [100_000, 20_000] {
        let thresholds = Thresholds { command_timeout_us: timeout_us, ..Thresholds::default() };
        let timeout = u64::from(timeout_us);
        let mut supervisor = Supervisor::boot(&thresholds, &Boot::default());
        supervisor.observe(&well(), 1_000_000);
        supervisor.command_received(1_000_000);
        supervisor.observe(&well(), 1_000_001);
        assert_eq!(supervisor.arm(1_000_001), Ok(()));
        supervisor.observe(&well(), 1_000_000 + timeout - 1);
        assert!(supervisor.bridge_allowed());
        supervisor.observe(&well(), 1_000_000 + timeout);
        assert_eq!(supervisor.faults(), set(&[Code::CommandTimeout]));
        assert!(!supervisor.bridge_allowed() && !supervisor.compensation_allowed());

        // The same boundary at arming, by the time of the request.
        let later = 2_000_000;
        supervisor.command_received(later);
        supervisor.observe(&well(), later);
        assert_eq!(supervisor.clear_faults(), Ok(()));
        supervisor.observe(&well(), later + timeout - 1);
        assert!(supervisor.arm(later + timeout).is_err());
        assert_eq!(supervisor.arm(later + timeout - 1), Ok(()));
        supervisor.observe(&well(), later + timeout);
        assert_eq!(supervisor.state(), State::Fault, "armed at the last moment, still in time");
    }
}

#[test]
fn a_set_point_between_two_observations_is_enough_to_arm() {
    let mut supervisor = Supervisor::boot(&Thresholds::default(), &Boot::default());
    supervisor.observe(&well(), 1_000_000);
    supervisor.command_received(1_000_100);
    assert_eq!(supervisor.arm(1_000_200), Ok(()));
    // And its staying away is seen from there on.
    supervisor.observe(&well(), 1_100_100);
    assert_eq!(supervisor.faults(), set(&[Code::CommandTimeout]));
}

#[test]
fn an_overrun_takes_the_compensation_within_its_period() {
    let mut bench = Bench::armed();
    assert!(bench.supervisor.compensation_allowed());
    bench.supervisor.loop_overrun();
    // No observation in between: this is what the interrupt asks in the same period.
    assert!(!bench.supervisor.compensation_allowed());
    assert!(bench.supervisor.bridge_allowed());
    assert_eq!(bench.supervisor.limits(), set(&[Code::LoopLate]));
    bench.supervisor.loop_on_time();
    assert!(!bench.supervisor.compensation_allowed());
    bench.run(100 * STEP_US);
    assert!(!bench.supervisor.compensation_allowed());
    bench.run(2 * STEP_US);
    assert!(bench.supervisor.compensation_allowed());

    // One in two is never a row of three; two and one more are.
    for _ in 0..20 {
        bench.supervisor.loop_overrun();
        bench.supervisor.loop_overrun();
        bench.supervisor.loop_on_time();
    }
    assert!(bench.supervisor.bridge_allowed());
    bench.supervisor.loop_overrun();
    bench.supervisor.loop_overrun();
    assert!(bench.supervisor.bridge_allowed());
    bench.supervisor.loop_overrun();
    assert!(!bench.supervisor.bridge_allowed());
    assert_eq!(bench.supervisor.faults(), set(&[Code::LoopOverrun]));
    assert_eq!(bench.supervisor.overruns(), 44);
    assert_eq!(bench.supervisor.count_of(Code::LoopLate), 2);
}

#[test]
fn a_trip_does_not_wait_for_an_observation() {
    for code in STOPPING.iter() {
        let mut bench = Bench::armed();
        bench.supervisor.trip(code);
        assert!(!bench.supervisor.bridge_allowed(), "{code:?}");
        assert_eq!(bench.supervisor.faults(), set(&[code]));
        bench.run(2 * STEP_US);
        // Nothing shows it any more.
        assert_eq!(bench.supervisor.clear_faults(), Ok(()));
    }
    for code in Code::ALL.iter().copied().filter(|code| !STOPPING.contains(*code)) {
        let mut bench = Bench::armed();
        bench.supervisor.trip(code);
        assert!(bench.supervisor.is_armed() && bench.supervisor.limits().is_empty());
    }
}

#[test]
fn every_flag_of_loop_and_compensator_is_heeded_or_known_not_to_be() {
    // What says what the loop was ordered to do, or is told by a code of the supervisor's own.
    let known = LoopFlags::BUS_INVALID
        | LoopFlags::POSITION_UNREFERENCED
        | LoopFlags::SETPOINT_STALE
        | LoopFlags::COVARIATE_INVALID
        | LoopFlags::COMPENSATION_OFF
        | LoopFlags::CROSS_FADING
        | LoopFlags::BRIDGE_OFF;
    for (name, flag) in LoopFlags::all().iter_names() {
        let mut bench = Bench::armed();
        bench.seen.loop_flags = flag;
        bench.run(200 * STEP_US);
        let silent = bench.events.is_empty();
        assert_eq!(silent, known.contains(flag), "{name}");
        let stops = LoopFlags::FAULTS | LoopFlags::OVERSPEED | LoopFlags::ENCODER_IMPLAUSIBLE;
        assert_eq!(bench.supervisor.bridge_allowed(), !stops.contains(flag), "{name}");
    }
    // A velocity alone may be missing, the other stands in; outside of what a network knows the law's constants do, and
    // the status and object 200Bh say so.
    let known = Flags::DISABLED
        | Flags::VELOCITY_INVALID
        | Flags::REFERENCE_INVALID
        | Flags::NETWORK_OUTSIDE;
    for (name, flag) in Flags::all().iter_names() {
        let mut bench = Bench::armed();
        bench.seen.compensator = flag;
        bench.run(200 * STEP_US);
        assert_eq!(bench.events.is_empty(), known.contains(flag), "{name}");
    }
}

#[test]
fn what_is_not_measured_is_not_watched_and_what_gives_no_number_is() {
    let mut bench = Bench::boot(&Boot::default());
    bench.seen = Observation::default();
    bench.run(500 * STEP_US);
    assert!(bench.events.is_empty());
    type Spoil = fn(&mut Observation);
    let rows: [(Spoil, Code); 5] = [
        (|seen| seen.bus_voltage_v = Some(f32::NAN), Code::AdcTimeout),
        (|seen| seen.phase_currents_a = Some([f32::INFINITY, 0.0, 0.0]), Code::Overcurrent),
        (|seen| seen.phase_currents_a = Some([0.0, f32::NAN, 0.0]), Code::CurrentSensorInvalid),
        (|seen| seen.motor_temperature_c = Some(f32::NAN), Code::TemperatureUnknown),
        (|seen| seen.bridge_temperature_c = Some(f32::INFINITY), Code::TemperatureUnknown),
    ];
    for (spoil, code) in rows {
        let mut bench = Bench::armed();
        spoil(&mut bench.seen);
        bench.run(200 * STEP_US);
        assert!(bench.supervisor.causes().contains(code), "{code:?}");
    }
}

#[test]
fn temperature_takes_current_back_before_it_trips() {
    let share = |bridge: Option<f32>, motor: Option<f32>| {
        let mut bench = Bench::armed();
        bench.seen.bridge_temperature_c = bridge;
        bench.seen.motor_temperature_c = motor;
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
fn hysteresis_holds_between_two_levels() {
    // Raised at its level, a cause stays at anything short of the other one.
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
        put(&mut bench.seen, between);
        bench.run(2_000 * STEP_US);
        assert!(!bench.supervisor.causes().contains(code), "{code:?}");
        put(&mut bench.seen, level);
        bench.run(2_000 * STEP_US);
        assert!(bench.supervisor.causes().contains(code), "{code:?}");
        put(&mut bench.seen, between);
        bench.run(2_000 * STEP_US);
        assert!(bench.supervisor.causes().contains(code), "{code:?}");
        put(&mut bench.seen, left);
        bench.run(2_000 * STEP_US);
        assert!(!bench.supervisor.causes().contains(code), "{code:?}");
    }
}

#[test]
fn a_cause_that_flickers_neither_comes_nor_goes() {
    let mut bench = Bench::armed();
    for _ in 0..1000 {
        bench.spoil(Code::Overspeed, true);
        bench.run(5 * STEP_US);
        bench.spoil(Code::Overspeed, false);
        bench.step();
    }
    assert!(bench.events.is_empty());
    bench.spoil(Code::VoltageLimited, true);
    bench.run(10 * STEP_US);
    for _ in 0..100 {
        bench.spoil(Code::VoltageLimited, false);
        bench.run(90 * STEP_US);
        bench.spoil(Code::VoltageLimited, true);
        bench.step();
    }
    assert_eq!(bench.events, [Event { code: Code::VoltageLimited, raised: true }]);
}

#[test]
fn a_dead_phase_is_told_from_one_that_rests_at_zero() {
    let dead = |currents, setpoint, measured| {
        let mut bench = Bench::armed();
        bench.seen.phase_currents_a = Some(currents);
        (bench.seen.current_setpoint_a, bench.seen.current_a) = (setpoint, measured);
        bench.run(100 * STEP_US);
        bench.supervisor.faults().contains(Code::PhaseLost)
    };
    assert!(dead([0.0, 5.0, -5.0], 10.0, 4.9));
    assert!(dead([-5.0, 0.2, 5.0], -10.0, -4.9));
    // Standing where phase a carries nothing, the set-point is met.
    assert!(!dead([0.0, 8.7, -8.7], 10.0, 10.0));
    // Out of voltage, all three carry something; and a small current says nothing.
    assert!(!dead([-2.0, 4.0, -2.0], 10.0, 4.0));
    assert!(!dead([0.0, 0.0, 0.0], 2.9, 0.0));
}

#[test]
fn time_that_runs_backwards_stops_the_joint() {
    let mut bench = Bench::armed();
    bench.supervisor.observe(&bench.seen, bench.now_us - 1);
    assert_eq!(bench.supervisor.faults(), set(&[Code::Internal]));
    assert!(!bench.supervisor.bridge_allowed());
    bench.step();
    assert_eq!(bench.supervisor.clear_faults(), Ok(()));
}

#[test]
fn faults_are_cleared_one_by_one() {
    let mut bench = Bench::armed();
    bench.spoil(Code::GateDriverFault, true);
    bench.spoil(Code::CanBusOff, true);
    bench.step();
    let both = set(&[Code::GateDriverFault, Code::CanBusOff]);
    assert_eq!(bench.supervisor.faults(), both);
    assert_eq!(both.error_register(), register::GENERIC | register::COMMUNICATION);
    assert_eq!((both.fault_bits(), both.limit_bits()), (1 << 2 | 1 << 9, 0));
    bench.spoil(Code::GateDriverFault, false);
    bench.run(20 * STEP_US);
    assert_eq!(bench.supervisor.clear_faults(), Err(set(&[Code::CanBusOff])));
    assert_eq!(bench.supervisor.state(), State::Fault);
    bench.spoil(Code::CanBusOff, false);
    bench.run(120 * STEP_US);
    assert_eq!(bench.supervisor.clear_faults(), Ok(()));
    assert_eq!(bench.supervisor.clear_faults(), Ok(()), "nothing to clear is cleared");
}

#[test]
fn events_wait_in_order_and_the_oldest_are_lost_first() {
    let mut supervisor = Supervisor::boot(&Thresholds::default(), &Boot::default());
    for _ in 0..20 {
        supervisor.parameters(InUse::Default);
        supervisor.parameters(InUse::Set);
    }
    supervisor.self_test(false);
    assert_eq!(supervisor.events_lost(), 9);
    let events: Vec<Event> = std::iter::from_fn(|| supervisor.take_event()).collect();
    assert_eq!(events.len(), 32);
    assert_eq!(events.last(), Some(&Event { code: Code::SelfTestFailed, raised: true }));
    assert_eq!(events[0], Event { code: Code::ParametersDefault, raised: false });
    assert_eq!(supervisor.count_of(Code::ParametersDefault), 20);
}

#[test]
fn thresholds_are_refused_by_name() {
    let default = Thresholds::default();
    assert_eq!(default.validate(), Ok(()));
    type Spoil = fn(&mut Thresholds);
    let rows: [(Spoil, &str, Bound); 12] = [
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
        (|t| t.phase_check_a = 0.6, "phase_check_a", Bound::MoreThan(0.6_f32.into())),
        (|t| t.temperature_hysteresis_c = 0.0, "temperature_hysteresis_c", Bound::AtLeast(0.5)),
    ];
    let mut bench = Bench::armed();
    for (spoil, field, bound) in rows {
        let mut thresholds = default;
        spoil(&mut thresholds);
        let error = bench.supervisor.configure(&thresholds).unwrap_err();
        assert_eq!((error.field, error.bound), (field, bound));
        assert_eq!(bench.supervisor.thresholds(), &default);
        // At a start nobody could be told: default ones, and a code.
        let supervisor = Supervisor::boot(&thresholds, &Boot::default());
        assert_eq!(supervisor.thresholds(), &default);
        assert_eq!(supervisor.limits(), set(&[Code::ParametersRefused]));
    }
    let other = Thresholds { bus_overvoltage_v: 70.0, ..default };
    assert_eq!(bench.supervisor.configure(&other), Ok(()));
    bench.seen.bus_voltage_v = Some(65.0);
    bench.run(10 * STEP_US);
    assert!(bench.supervisor.is_armed());
}

#[test]
fn error_passive_and_bus_off_are_two_things() {
    let mut bench = Bench::armed();
    bench.seen.can = CanState::Passive;
    bench.step();
    assert!(bench.supervisor.is_armed());
    bench.seen.can = CanState::Off;
    bench.step();
    assert_eq!(bench.supervisor.faults(), set(&[Code::CanBusOff]));
}
