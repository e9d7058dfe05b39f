//! What is wrong on a bus is counted, and changes nothing.

use super::bench::{Bench, NODE, frame};
use super::{moving, sample};
use compensator_core::can::{Frame, Message, Sync};
use firmware::node::OUTBOX;
use firmware::node::dictionary::index;
use proptest::prelude::*;

fn armed() -> Bench {
    let mut bench = Bench::hil();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    bench
}

#[test]
fn wrong_frames_are_counted_each_for_what_it_is() {
    let mut bench = armed();
    let before = *bench.driver.counters();
    for (identifier, data) in [
        (0x301, &[0; 7][..]),
        (0x080, &[]),
        (0x080, &[0]),
        (0x080, &[241]),
        (0x202, &[0; 8]),
        (0x7E5, &[0; 8]),
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
fn syncs_lost_repeated_or_late_are_counted() {
    let mut bench = armed();
    for counter in [1, 2, 2, 5, 4] {
        bench.give(moving(0));
        bench.give(Message::Sync(Sync { counter }));
    }
    let counters = bench.driver.counters();
    assert_eq!((counters.sync_lost, counters.sync_duplicate, counters.sync_late), (2, 1, 1));
}

#[test]
fn a_flood_fills_the_outbox_and_no_more() {
    let mut bench = armed();
    for sequence in 0..1000 {
        bench.give(moving(sequence));
        bench.give(Message::Sync(Sync::of(sequence)));
    }
    assert_eq!(bench.sent().len(), OUTBOX);
    // And then it goes on as if nothing had been.
    assert_eq!(sample(&mut bench, 1000).len(), 3);
    assert!(bench.number(index::FRAME_COUNTERS, 3) >= 3000 - OUTBOX as u32);
}

proptest! {
    #[test]
    fn any_frames_at_any_time_leave_it_whole(
        frames in proptest::collection::vec(
            (0u16..=0x7FF, proptest::collection::vec(any::<u8>(), 0..=8), any::<bool>(), any::<u16>()),
            0..400,
        ),
    ) {
        let mut bench = armed();
        for (identifier, data, aimed, later_us) in frames {
            // Half of them at identifiers the driver listens to.
            let own = [0x000, 0x080, 0x301, 0x401, 0x481, 0x501, 0x681, 0x601];
            let identifier = if aimed { own[usize::from(identifier) % own.len()] } else { identifier };
            // A restart or another number would end the test, not the driver.
            if identifier == 0 && matches!(data.first(), Some(0x81 | 0x82)) {
                continue;
            }
            let frame = Frame::new(identifier, &data).unwrap();
            bench.now_us += u64::from(later_us);
            bench.driver.receive(&frame, bench.now_us);
            bench.driver.tick(bench.now_us);
            prop_assert!(bench.sent().len() <= OUTBOX);
            let orders = bench.driver.orders(bench.now_us);
            prop_assert!(!orders.bridge, "a fed joint drives nothing");
        }
        bench.start();
        bench.sent();
        prop_assert!(bench.read(index::DEVICE_TYPE, 0).is_ok());
        prop_assert_eq!(NODE.number(), 1);
    }
}
