//! Tests of invalid bus traffic: it is counted and changes nothing.

use super::bench::{Bench, frame};
use super::{moving, sample};
use compensator_core::can::{Message, SyncFrame};
use firmware::driver::LoopReport;
use firmware::joint_node::Joint as _;
use firmware::node::OUTBOX_CAPACITY;
use firmware::node::dictionary::index;
use proptest::prelude::*;

fn armed() -> Bench {
    let mut bench = Bench::hil();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    bench
}

#[test]
fn wrong_frames_are_counted_by_kind() {
    let mut bench = armed();
    let before = *bench.driver.joint.counters();
    for (identifier, data) in [
        (0x301, &[0; 7][..]),
        (0x080, &[1, 2]),
        (0x080, &[0]),
        (0x080, &[241]),
        (0x202, &[0; 8]),
        (0x7E6, &[0; 8]),
        (0x601, &[0x40, 0, 0x10]),
    ] {
        bench.driver.receive(&frame(identifier, data), 0);
    }
    let after = bench.driver.joint.counters();
    assert_eq!(after.received - before.received, 7);
    assert_eq!(after.wrong_length - before.wrong_length, 3);
    assert_eq!(after.wrong_content - before.wrong_content, 2);
    assert_eq!(after.foreign - before.foreign, 2);
    assert!(bench.sent().is_empty());
}

#[test]
fn syncs_lost_duplicate_or_late_are_counted() {
    let mut bench = armed();
    for counter in [1, 2, 2, 5, 4] {
        bench.give(moving(0));
        bench.give(Message::Sync(SyncFrame { counter }));
    }
    let counters = bench.driver.joint.counters();
    assert_eq!((counters.sync_lost, counters.sync_duplicate, counters.sync_late), (2, 1, 1));
}

#[test]
fn flood_of_syncs_is_limited_by_the_outbox() {
    let mut bench = armed();
    for sequence in 0..1000 {
        bench.give(moving(sequence));
        bench.give(Message::Sync(SyncFrame::of(sequence)));
    }
    assert_eq!(bench.sent().len(), OUTBOX_CAPACITY);
    // Afterwards the driver works normally.
    assert_eq!(sample(&mut bench, 1000).len(), 3);
    assert!(bench.number(index::FRAME_COUNTERS, 3) >= 3000 - OUTBOX_CAPACITY as u32);
}

/// Frames that arm a commissioned joint and drive it: NMT start, mode CST, the controlwords with a target, the request to
/// the state machine, and a command.
const ARMING: [(u16, &[u8]); 7] = [
    (0x000, &[1, 1]),
    (0x601, &[0x2F, 0x60, 0x60, 0, 10, 0, 0, 0]),
    (0x201, &[6, 0, 100, 0]),
    (0x201, &[7, 0, 100, 0]),
    (0x201, &[15, 0, 100, 0]),
    (0x601, &[0x2F, 0x02, 0x20, 1, 1, 0, 0, 0]),
    (0x301, &[0, 0, 0x80, 0x3F, 0, 0, 1, 0]),
];

/// Receives a frame while the joint reports measurements with which it can be armed.
fn receive_measuring(bench: &mut Bench, identifier: u16, data: &[u8]) {
    bench.driver.receive(&frame(identifier, data), bench.now_us);
    bench.driver.joint.report(&LoopReport {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.0; 3]),
        ..LoopReport::default()
    });
    bench.pass_ms(1);
    bench.sent();
}

fn is_driven(bench: &Bench) -> bool {
    bench.driver.joint.is_armed() || bench.driver.joint.loop_commands(bench.now_us).bridge
}

/// Starts a locked joint on its own sensors.
fn on_sensors(is_commissioned: bool) -> Bench {
    let mut bench = Bench::on_sensors();
    if is_commissioned {
        bench.commission();
        bench.write(index::ACCESS, 4, &[1]).expect("is open");
    }
    bench.sent();
    bench
}

/// Without this, the two tests below would prove nothing.
#[test]
fn arming_frames_close_the_bridge_of_a_commissioned_joint() {
    let mut bench = on_sensors(true);
    for (identifier, data) in ARMING {
        receive_measuring(&mut bench, identifier, data);
    }
    assert!(bench.driver.joint.is_armed() && bench.driver.joint.loop_commands(bench.now_us).bridge);
}

/// Excluded: arm a joint with frames of a wrong length.
#[test]
fn arming_frames_of_a_wrong_length_do_not_close_the_bridge() {
    for wrong in 0..ARMING.len() {
        let mut bench = on_sensors(true);
        for _ in 0..3 {
            for (place, (identifier, data)) in ARMING.into_iter().enumerate() {
                // Only one kind is as it must be, except the start and the mode, which drive nothing.
                let is_whole = place < 2 && place != wrong;
                let length = if is_whole { data.len() } else { data.len() - 1 };
                receive_measuring(&mut bench, identifier, &data[..length]);
                assert!(!is_driven(&bench), "{identifier:03x}");
            }
        }
    }
}

fn hostile_frame() -> impl Strategy<Value = (u16, Vec<u8>)> {
    let data = || proptest::collection::vec(any::<u8>(), 0..=8);
    // Identifiers that the driver receives.
    let joint_identifiers = [0x000, 0x080, 0x201, 0x301, 0x401, 0x481, 0x501, 0x681, 0x601, 0x7E5];
    let arming = ARMING.map(|(identifier, data)| (identifier, data.to_vec()));
    prop_oneof![
        (0u16..=0x7FF, data()),
        (proptest::sample::select(joint_identifiers.to_vec()), data()),
        proptest::sample::select(arming.to_vec()),
    ]
    // A restart would end the test.
    .prop_filter("no restart", |(identifier, data)| {
        *identifier != 0 || !matches!(data.first(), Some(0x81 | 0x82))
    })
}

proptest! {
    /// Excluded: close the bridge of a joint that is not commissioned, or stop its driver, with any frames.
    #[test]
    fn random_and_arming_frames_never_close_the_bridge_of_a_joint_that_is_not_commissioned(
        frames in proptest::collection::vec(hostile_frame(), 0..200),
    ) {
        let mut bench = on_sensors(false);
        for (identifier, data) in frames {
            receive_measuring(&mut bench, identifier, &data);
            prop_assert!(!is_driven(&bench));
        }
        bench.start();
        bench.sent();
        prop_assert!(bench.read(index::DEVICE_TYPE, 0).is_ok());
    }

    #[test]
    fn random_frames_at_random_times_leave_a_hil_joint_answering(
        frames in proptest::collection::vec((hostile_frame(), any::<u16>()), 0..400),
    ) {
        let mut bench = armed();
        for ((identifier, data), later_us) in frames {
            bench.now_us += u64::from(later_us);
            bench.driver.receive(&frame(identifier, &data), bench.now_us);
            bench.driver.tick(bench.now_us);
            prop_assert!(bench.sent().len() <= OUTBOX_CAPACITY);
        }
        bench.start();
        bench.sent();
        prop_assert!(bench.read(index::DEVICE_TYPE, 0).is_ok());
    }
}
