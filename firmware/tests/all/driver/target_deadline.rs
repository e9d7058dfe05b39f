//! Tests of the deadline of a CiA 402 master's targets: what counts as a life sign, and what its absence causes.
//!
//! A repeated target is a life sign. SYNC and heartbeat are none, because their producers may outlive the controller that
//! computes the targets. Only with 1400h:5 = 0 the monitored heartbeat confirms the last target.

use super::bench::{Bench, frame};
use super::drive::{control, in_cst, pass, state};
use compensator_core::can::{Message, SyncFrame};
use firmware::driver::Boot;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;
use firmware::supervisor::{Code, JointState};

/// Life signs of a master: name, and what it sends at a time.
type LifeSign = (&'static str, fn(&mut Bench, u64));

const SAME_FRAME: LifeSign = ("the same frame", |bench, _| control(bench, 0x0F, 100));
const TARGET_OBJECT: LifeSign = ("the target as an object", |bench, _| {
    bench.write(index::TARGET_TORQUE, 0, &100i16.to_le_bytes()).unwrap();
});
const SYNC: LifeSign = ("SYNC", |bench, at| {
    bench.give(Message::Sync(SyncFrame { counter: (at % 240) as u8 + 1 }));
    bench.sent();
});
const HEARTBEAT: LifeSign = ("the awaited heartbeat", |bench, _| {
    bench.driver.receive(&frame(0x707, &[5]), bench.now_us);
});
const LONG_HEARTBEAT: LifeSign = ("a heartbeat of two bytes", |bench, _| {
    bench.driver.receive(&frame(0x707, &[5, 0]), bench.now_us);
});
const SYNC_AND_HEARTBEAT: LifeSign = ("SYNC and heartbeat", |bench, at| {
    (SYNC.1)(bench, at);
    (HEARTBEAT.1)(bench, at);
});

/// Returns an enabled drive that monitors a heartbeat, with this deadline of its targets.
fn enabled_with_deadline(event_timer_ms: u16) -> Bench {
    let mut bench = in_cst();
    bench.write(index::AWAITED_HEARTBEAT, 1, &(7u32 << 16 | 500).to_le_bytes()).unwrap();
    bench.write(index::RECEIVE_DRIVE, 5, &event_timer_ms.to_le_bytes()).unwrap();
    bench.driver.receive(&frame(0x707, &[5]), bench.now_us);
    for word in [0x06, 0x0F] {
        control(&mut bench, word, 100);
    }
    assert!(bench.driver.joint.is_armed());
    bench
}

/// Sends a life sign every 5 ms; returns the time until the joint is disarmed, ms, or `None` after 0.4 s.
fn armed_ms(bench: &mut Bench, (_, sign): LifeSign) -> Option<u64> {
    (0..400u64).find(|at| {
        if at % 5 == 0 {
            sign(bench, at / 5);
        }
        pass(bench, 1);
        !bench.driver.joint.is_armed()
    })
}

#[test]
fn repeated_target_keeps_the_joint_armed_and_silence_stops_it() {
    for sign in [SAME_FRAME, TARGET_OBJECT] {
        let name = sign.0;
        let mut bench = enabled_with_deadline(100);
        assert_eq!(armed_ms(&mut bench, sign), None, "{name}");
        assert!(bench.driver.joint.loop_commands(bench.now_us).setpoint.age_s < 6e-3, "{name}");
        pass(&mut bench, 94);
        assert!(bench.driver.joint.is_armed(), "{name}");
        pass(&mut bench, 4);
        assert_eq!(bench.driver.joint.supervisor().state(), JointState::Fault, "{name}");
        assert!(bench.driver.joint.supervisor().faults().contains(Code::CommandTimeout));
        assert_eq!(state(&mut bench), 0x08);
        assert_eq!(bench.number(index::ERROR_CODE, 0), 0x8250);
        // An edge clears the fault, and the drive does not restart.
        control(&mut bench, 0x00, 0);
        pass(&mut bench, 2);
        control(&mut bench, 0x80, 0);
        assert_eq!(state(&mut bench), 0x40, "{name}");
        control(&mut bench, 0x0F, 100);
        assert!(!bench.driver.joint.is_armed(), "{name}");
    }
}

/// The producers of SYNC and heartbeat may outlive the controller that computes the targets.
#[test]
fn sync_or_heartbeat_without_targets_stops_the_joint_at_the_deadline() {
    for sign in [SYNC, HEARTBEAT, SYNC_AND_HEARTBEAT] {
        for (event_timer_ms, expected_ms) in [(100, 98..=100), (20, 18..=20), (5, 3..=5)] {
            let mut bench = enabled_with_deadline(event_timer_ms);
            let found = armed_ms(&mut bench, sign).expect("it stops");
            assert!(expected_ms.contains(&found), "{}: {found} ms of {event_timer_ms}", sign.0);
            assert!(bench.driver.joint.supervisor().faults().contains(Code::CommandTimeout));
        }
    }
}

#[test]
fn heartbeat_with_event_timer_zero_confirms_the_target_and_sync_does_not() {
    let mut bench = enabled_with_deadline(0);
    assert_eq!(armed_ms(&mut bench, HEARTBEAT), None);
    assert!(bench.driver.joint.loop_commands(bench.now_us).setpoint.age_s < 6e-3);
    for sign in [SYNC, LONG_HEARTBEAT] {
        let mut bench = enabled_with_deadline(0);
        let stopped_ms = armed_ms(&mut bench, sign).expect("it stops");
        assert!((90..=100).contains(&stopped_ms), "{}: {stopped_ms} ms", sign.0);
    }
}

#[test]
fn event_timer_beyond_its_range_is_refused_and_a_legal_one_is_kept() {
    let mut bench = in_cst();
    assert_eq!(bench.number(index::RECEIVE_DRIVE, 5), 100);
    assert!(bench.write(index::RECEIVE_DRIVE, 5, &101u16.to_le_bytes()).is_err());
    bench.check_refusal("deadline of targets", &["event_timer_ms", "1", "100", "0"]);
    bench.write(index::RECEIVE_DRIVE, 5, &30u16.to_le_bytes()).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    assert_eq!(bench.number(index::RECEIVE_DRIVE, 5), 30);
}
