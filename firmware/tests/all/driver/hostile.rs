//! Tests of invalid bus traffic: it is counted and changes nothing.

use super::bench::{Bench, NODE, frame};
use super::{moving, sample};
use compensator_core::can::{Frame, Message, SyncFrame};
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
    let before = *bench.driver.counters();
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
    let after = bench.driver.counters();
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
    let counters = bench.driver.counters();
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

proptest! {
    /// Excluded: close the bridge or stop the driver with malformed frames.
    #[test]
    fn random_frames_at_random_times_never_close_the_bridge(
        frames in proptest::collection::vec(
            (0u16..=0x7FF, proptest::collection::vec(any::<u8>(), 0..=8), any::<bool>(), any::<u16>()),
            0..400,
        ),
    ) {
        let mut bench = armed();
        for (identifier, data, aimed, later_us) in frames {
            // Half of the frames have identifiers that the driver receives.
            let own = [0x000, 0x080, 0x301, 0x401, 0x481, 0x501, 0x681, 0x601];
            let identifier = if aimed { own[usize::from(identifier) % own.len()] } else { identifier };
            // A restart or a new node number would end the test.
            if identifier == 0 && matches!(data.first(), Some(0x81 | 0x82)) {
                continue;
            }
            let frame = Frame::new(identifier, &data).unwrap();
            bench.now_us += u64::from(later_us);
            bench.driver.receive(&frame, bench.now_us);
            bench.driver.tick(bench.now_us);
            prop_assert!(bench.sent().len() <= OUTBOX_CAPACITY);
            let commands = bench.driver.loop_commands(bench.now_us);
            prop_assert!(!commands.bridge, "a joint in HIL drives nothing");
        }
        bench.start();
        bench.sent();
        prop_assert!(bench.read(index::DEVICE_TYPE, 0).is_ok());
        prop_assert_eq!(NODE.number(), 1);
    }
}
