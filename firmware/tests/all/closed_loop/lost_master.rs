//! Tests of a CiA 402 master that fails while other nodes continue to send.

use super::driver::{Joint, NODE};
use compensator_core::can::{Message, SyncFrame};
use firmware::node::dictionary::index;
use firmware::supervisor::Code;

const CSV: u8 = 9;

/// Queues a SYNC and the heartbeat of node 7.
fn queue_life_signs(joint: &mut Joint, millisecond: u32) {
    joint.board.received.push_back(Message::Sync(SyncFrame::of(millisecond)).emit());
    joint.queue_frame(0x707, &[5]);
}

/// The controller fails at 3 rad/s; SYNC and heartbeat go on. Returns the time until the bridge is open, ms, and the
/// joint 1 s after the failure.
fn fail_at_speed(event_timer_ms: u16) -> (usize, Joint) {
    let mut joint = Joint::started();
    assert_eq!(NODE.number(), 1);
    joint.write_object(index::AWAITED_HEARTBEAT, 1, (7u32 << 16 | 500).to_le_bytes(), 4);
    let [low, high] = event_timer_ms.to_le_bytes();
    joint.write_object(index::RECEIVE_DRIVE, 5, [low, high, 0, 0], 2);
    joint.enable_mode(CSV);
    for ms in 0..500 {
        queue_life_signs(&mut joint, ms);
        joint.drive_velocity(0x0F, 3.0);
    }
    let velocity = joint.stage.plant.velocity();
    assert!((velocity - 3.0).abs() < 0.1, "{velocity} rad/s before the failure");
    let mut open_ms = None;
    for ms in 0..1000 {
        queue_life_signs(&mut joint, 500 + ms as u32);
        joint.run_ms(1);
        if !joint.stage.is_on() {
            open_ms.get_or_insert(ms + 1);
        }
    }
    (open_ms.expect("the bridge opens"), joint)
}

#[test]
fn csv_whose_targets_stop_while_sync_and_heartbeat_go_on_opens_the_bridge_at_the_deadline() {
    for (event_timer_ms, expected_ms) in [(100, 98..=102), (10, 8..=12)] {
        let (open_ms, joint) = fail_at_speed(event_timer_ms);
        println!("event timer {event_timer_ms} ms: bridge open after {open_ms} ms");
        assert!(expected_ms.contains(&open_ms), "{open_ms} ms of {event_timer_ms} ms");
        assert!(joint.has_fault(Code::CommandTimeout));
        assert!(!joint.has_fault(Code::HeartbeatLost), "the heartbeat went on");
        let velocity = joint.stage.plant.velocity();
        assert!(velocity.abs() < 0.01, "{velocity} rad/s a second later");
    }
}
