//! Tests of the whole driver in virtual time: CAN frames, background loop, queues, interrupt, bridge and plant.

use super::driver::{Joint, NODE};
use super::plant::Machine;
use firmware::background::{RoundOutcome, TICK_US};
use firmware::control::{BridgeFault, StageSample, ValidChannels};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use firmware::sensors::SensorParameters;
use firmware::supervisor::Code;

#[test]
fn state_request_over_can_starts_and_stops_joint() {
    let mut joint = Joint::started();
    joint.drive_ms(5.0, 5);
    assert!(!joint.stage.is_on(), "a command alone enables the bridge");
    joint.request_state(1);
    joint.drive_ms(5.0, 100);
    assert!(joint.background.node().joint.is_armed() && joint.stage.is_on());
    let velocity = joint.stage.plant.velocity();
    assert!((0.5..3.0).contains(&velocity), "{velocity} rad/s");
    joint.request_state(0);
    joint.drive_ms(5.0, 2);
    assert!(!joint.stage.is_on());
}

#[test]
fn committed_set_reaches_loop_before_later_requests() {
    let mut joint = Joint::started();
    let names = firmware::control::MotorParameters::NAMES.iter();
    let sub_index = names.take_while(|name| **name != "current_limit_a").count() as u8 + 1;
    joint.write_object(index::MOTOR, sub_index, 2f32.to_le_bytes(), 4);
    joint.run_ms(1);
    joint.queue_frame(0x601, &[0x40, 0x27, 0x20, 2, 0, 0, 0, 0]);
    joint.run_ms(1);
    let answer = joint.board.sent.last().expect("the staged CRC").data();
    let crc = answer[4..8].try_into().expect("four bytes");
    // The request follows the commit in the same millisecond.
    joint.write_object(index::COMMIT, 3, crc, 4);
    joint.request_state(1);
    joint.drive_ms(10.0, 2);
    joint.request_state(1);
    joint.drive_ms(10.0, 20);
    assert!(joint.stage.is_on());
    let largest =
        joint.stage.plant.phase_currents().into_iter().fold(0.0, |a, b| f64::max(a, b.abs()));
    assert!((0.5..2.4).contains(&largest), "{largest} A");
}

#[test]
fn stopped_loop_ends_watchdog_refresh_and_raises_fault() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request_state(1);
    joint.drive_ms(1.0, 5);
    assert!(joint.background.node().joint.is_armed());
    let missing = |joint: &Joint| {
        joint.background.node().joint.supervisor().faults().contains(Code::AdcTimeout)
    };
    assert!(!missing(&joint));
    let watchdog_refreshes = joint.board.watchdog_refreshes;
    for _ in 0..20 {
        joint.queue_command(1.0);
        assert_eq!(joint.run_round(), RoundOutcome::Sleep);
    }
    // A report is valid for 5 ms.
    assert_eq!(joint.board.watchdog_refreshes - watchdog_refreshes, 4);
    assert!(missing(&joint) && !joint.background.node().joint.is_armed());
}

#[test]
fn answers_with_full_transmit_queue_wait_for_room() {
    let mut joint = Joint::started();
    joint.board.sent.clear();
    joint.board.room = 1;
    for _ in 0..3 {
        joint.queue_frame(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    }
    joint.run_ms(3);
    assert_eq!(joint.board.sent.len(), 1);
    joint.board.room = usize::MAX;
    joint.run_ms(1);
    assert_eq!(joint.board.sent.len(), 3);
}

#[test]
fn missed_ticks_are_skipped() {
    let mut joint = Joint::started();
    let state_reads = joint.board.state_reads;
    joint.board.now_us += 100 * TICK_US;
    for _ in 0..2 {
        assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Sleep);
    }
    assert_eq!(joint.board.state_reads - state_reads, 1);
    // After a delay of less than a tick, the next tick keeps its time.
    joint.board.now_us += TICK_US / 2;
    joint.run_ms(1);
    joint.board.now_us += TICK_US / 2;
    assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Sleep);
    assert_eq!(joint.board.state_reads - state_reads, 3);
}

#[test]
fn restart_waits_for_last_frames_or_timeout() {
    let mut joint = Joint::started();
    joint.board.sent.clear();
    joint.queue_frame(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    joint.queue_frame(0, &[0x81, NODE.number()]);
    joint.queue_frame(0x601, &[0x40, 0x18, 0x10, 1, 0, 0, 0, 0]);
    joint.board.is_idle = false;
    joint.board.reading_us = 1;
    joint.run_interrupts();
    assert_eq!(joint.run_round(), RoundOutcome::Restart);
    assert_eq!(joint.board.sent.len(), 1, "a frame was processed after the restart request");
    let began_us = joint.board.now_us;
    assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Restart);
    assert!((500..520).contains(&(joint.board.now_us - began_us)));
    joint.board.is_idle = true;
    let began_us = joint.board.now_us;
    assert_eq!(joint.background.round(&mut joint.board), RoundOutcome::Restart);
    assert!(joint.board.now_us - began_us < 10);
}

/// The interrupt compares the speed in each of its periods: a background that hangs does not delay the stop.
#[test]
fn overspeed_opens_the_bridge_while_the_background_hangs() {
    let mut set = ParameterSet::default();
    set.motor.velocity_max_rad_s = 20.0;
    set.thresholds.overspeed_rad_s = 8.0;
    let mut joint = Joint::with(Machine::default(), &set);
    joint.drive_ms(0.0, 5);
    joint.request_state(1);
    joint.drive_ms(0.0, 30);
    for _ in 0..500 {
        joint.drive_ms(10.0, 1);
        if joint.stage.plant.velocity() > 7.0 {
            break;
        }
    }
    assert!(joint.stage.is_on());
    for _ in 0..50 {
        joint.run_interrupts();
    }
    let speed = joint.stage.plant.velocity();
    println!("measured: {speed} rad/s");
    assert!(!joint.stage.is_on() && (7.5..8.2).contains(&speed), "{speed} rad/s");
    joint.run_ms(10);
    assert!(joint.has_fault(Code::Overspeed));
}

/// Attack: flood the joint with frames. Bound: its supervision is late by one frame at most.
#[test]
fn flood_of_frames_delays_a_tick_by_one_frame() {
    const FRAME_US: u64 = 700;
    let mut joint = Joint::started();
    joint.run_ms(50);
    assert!(joint.board.longest_pause_us <= TICK_US);
    let flood: [(u16, &[u8]); 6] = [
        (0x601, &[0x40, 0x27, 0x20, 1, 0, 0, 0, 0]),
        (0x601, &[0x40, 0x27, 0x20, 5, 0, 0, 0, 0]),
        (0x000, &[0x81, NODE.number() + 1]),
        (0x7E5, &[0x5E, 0, 0, 0, 0, 0, 0, 0]),
        (0x080, &[]),
        (0x77F, &[5]),
    ];
    joint.board.frame_us = FRAME_US;
    let refreshes = joint.board.watchdog_refreshes;
    for (identifier, data) in flood {
        for _ in 0..200 {
            joint.queue_frame(identifier, data);
        }
    }
    let mut rounds = 0;
    while !joint.board.received.is_empty() {
        assert_ne!(joint.background.round(&mut joint.board), RoundOutcome::Restart);
        joint.run_interrupts();
        rounds += 1;
    }
    let pause_us = joint.board.longest_pause_us;
    println!("measured: {pause_us} us between two ticks, {rounds} rounds");
    assert!(pause_us <= TICK_US + FRAME_US, "{pause_us} us");
    assert!(joint.board.watchdog_refreshes - refreshes > 400, "{rounds} rounds");
}

/// The amplifiers' offsets drift as they warm up. The driver measures them with the bridge open at each arming.
#[test]
fn shunt_offset_is_removed_at_next_arming() {
    let current_error = |offset_a: [f64; 3], is_before_arming: bool| {
        let mut joint = Joint::started();
        if is_before_arming {
            joint.stage.shunt_offset_a = offset_a;
        }
        joint.drive_ms(0.0, 5);
        joint.request_state(1);
        joint.drive_ms(0.0, 20);
        joint.stage.shunt_offset_a = offset_a;
        joint.drive_ms(0.0, 50);
        assert!(joint.background.node().joint.is_armed() && joint.stage.is_on());
        // The plant's largest phase current while the loop measures 0 A.
        joint.stage.plant.phase_currents().into_iter().fold(0.0, |a, b| f64::max(a, b.abs()))
    };
    let offset_a = [0.3, -0.26, 0.0];
    let (after, before) = (current_error(offset_a, false), current_error(offset_a, true));
    assert!((0.15..0.6).contains(&after), "offset after arming: {after} A");
    assert!(before < 0.08, "offset before arming: {before} A");
}

/// The gate driver latches its fault until its enable input is low. A first "clear" over CAN may only lower the enable
/// input; a second one then clears the fault.
#[test]
fn latched_gate_driver_fault_is_cleared_over_can() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request_state(1);
    joint.drive_ms(1.0, 30);
    assert!(joint.stage.is_on());
    (joint.stage.fault, joint.stage.has_latched_fault) = (Some(BridgeFault::GateDriver), true);
    joint.drive_ms(1.0, 1);
    assert!(!joint.stage.is_on() && !joint.stage.is_awake, "duties off and gate driver disabled");
    let has =
        |joint: &Joint, code| joint.background.node().joint.supervisor().faults().contains(code);
    joint.drive_ms(1.0, 50);
    assert!(
        has(&joint, Code::GateDriverFault)
            && joint.stage.is_awake
            && !joint.stage.has_latched_fault
    );
    assert!(!has(&joint, Code::CurrentSensorInvalid), "disabled amplifiers reported as faulty");
    joint.request_state(2);
    joint.drive_ms(1.0, 2);
    assert!(!has(&joint, Code::GateDriverFault));
    // With the bridge off, a fault does not lower the enable input. The first "clear" does.
    (joint.stage.fault, joint.stage.has_latched_fault) = (Some(BridgeFault::GateDriver), true);
    joint.drive_ms(1.0, 50);
    assert!(has(&joint, Code::GateDriverFault) && joint.stage.has_latched_fault);
    joint.request_state(2);
    joint.drive_ms(1.0, 30);
    assert!(has(&joint, Code::GateDriverFault) && !joint.stage.has_latched_fault);
    joint.request_state(2);
    joint.drive_ms(1.0, 2);
    assert!(!has(&joint, Code::GateDriverFault));
    joint.request_state(1);
    joint.drive_ms(1.0, 30);
    assert!(joint.stage.is_on());
}

#[test]
fn system_break_is_distinguished_from_gate_driver_fault() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request_state(1);
    joint.drive_ms(1.0, 30);
    joint.stage.fault = Some(BridgeFault::System);
    joint.drive_ms(1.0, 3);
    assert!(!joint.stage.is_on());
    let supervisor = joint.background.node().joint.supervisor();
    assert!(supervisor.faults().contains(Code::SystemBreak));
    assert!(!supervisor.faults().contains(Code::GateDriverFault));
}

#[test]
fn committed_constants_of_the_sensors_reach_the_board() {
    let mut joint = Joint::started();
    let place = SensorParameters::NAMES.iter().position(|name| *name == "strain_range_n");
    let sub_index = place.expect("a parameter") as u8 + 1;
    joint.write_object(index::SENSORS, sub_index, (-800f32).to_le_bytes(), 4);
    joint.run_ms(2);
    assert_eq!(joint.board.sensors, SensorParameters::default(), "staged values have no effect");
    joint.commit_staged();
    joint.run_ms(2);
    let expected = SensorParameters { strain_range_n: -800.0, ..SensorParameters::default() };
    assert_eq!(joint.board.sensors, expected);
    assert_eq!(joint.background.node().joint.set().sensors, expected);
}

#[test]
fn magnet_fault_of_the_encoder_is_reported_and_the_joint_stays_armed() {
    let mut joint = Joint::started();
    joint.drive_ms(1.0, 5);
    joint.request_state(1);
    joint.drive_ms(1.0, 30);
    let limits = |joint: &Joint| joint.background.node().joint.supervisor().limits();
    // A frame with the diagnostics has no angle.
    joint.stage.injected_sample = {
        let sample = joint.stage.measure();
        Some(StageSample { valid: sample.valid - ValidChannels::ENCODER, ..sample })
    };
    joint.drive_ms(1.0, 3);
    assert!(!limits(&joint).contains(Code::EncoderCoasting), "one missing angle");
    assert!(!limits(&joint).contains(Code::EncoderMagnet));
    joint.stage.magnet_fault = true;
    joint.drive_ms(1.0, 3);
    assert!(limits(&joint).contains(Code::EncoderMagnet) && joint.stage.is_on());
    joint.stage.magnet_fault = false;
    joint.drive_ms(1.0, 110);
    assert!(!limits(&joint).contains(Code::EncoderMagnet));
}
