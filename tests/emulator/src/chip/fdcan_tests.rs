//! Tests of the controller and its bus.

use super::bus::DELAY_COMPENSATED;
use super::*;

fn running() -> Fdcan {
    let mut can = Fdcan::default();
    can.set_connected(true);
    can.write(BASE + CCCR, 0, 0);
    // One mask filter that accepts everything.
    can.write(RAM, 2 << 30 | 1 << 27, 0);
    can.write(BASE + RXGFC, 1 << 16 | 2 << 4, 0);
    can
}

fn frame(identifier: u16) -> Frame {
    Frame::new(identifier, &[1, 2, 3]).expect("a frame")
}

fn send(can: &mut Fdcan, identifier: u32, element: u32, now: u64) {
    let words = RAM + 4 * (TRANSMIT + ELEMENT_WORDS * element as usize) as u32;
    can.write(words, identifier << 18, now);
    can.write(words + 4, 8 << 16, now);
    can.write(BASE + TXBAR, 1 << element, now);
}

#[test]
fn lowest_identifier_wins_where_several_wait() {
    let mut can = running();
    can.deliver(frame(0x300), 0);
    can.deliver(frame(0x100), 0);
    can.deliver(frame(0x250), 0);
    send(&mut can, 0x200, 0, 0);
    let mut first = 0;
    while can.sent.is_empty() {
        let at = can.next_event();
        can.process(at);
        first += 1;
    }
    // 300h had begun; then 100h, and 200h before 250h.
    assert_eq!((first, can.filled), (3, 2));
}

#[test]
fn node_with_destroyed_frames_goes_bus_off_and_recovers() {
    let mut can = running();
    can.destroyed_share = 1.0;
    send(&mut can, 0x200, 0, 0);
    let mut now = 0;
    while can.read(BASE + PSR) & BUS_OFF == 0 {
        now = can.next_event();
        can.process(now);
    }
    assert!(can.sent.is_empty());
    assert_eq!(can.read(BASE + CCCR) & INIT, INIT);
    can.destroyed_share = 0.0;
    can.write(BASE + CCCR, 0, now);
    while can.sent.is_empty() {
        now = can.next_event();
        can.process(now);
    }
    assert_eq!(can.read(BASE + PSR) & BUS_OFF, 0);
}

#[test]
fn own_data_at_5_mbit_need_compensated_delay() {
    let mut can = running();
    // 17 quanta of two cycles, 14 of them before the sample point.
    let timing = 1 << 16 | 12 << 8 | 2 << 4;
    // Five cycles to a quantum: 2 Mbit/s.
    let slow = 4 << 16 | 12 << 8 | 2 << 4;
    for (word, offset, is_found) in [
        (timing, 0, false),
        (timing | DELAY_COMPENSATED, 28, true),
        (timing | DELAY_COMPENSATED, 0, false),
        (slow, 0, true),
        (slow | DELAY_COMPENSATED, 70, false),
    ] {
        can.write(BASE + DBTP, word, 0);
        can.write(BASE + TDCR, offset << 8, 0);
        assert_eq!(can.finds_own_data(), is_found, "{word:x}");
    }
}

#[test]
fn node_without_its_pins_receives_nothing() {
    let mut can = running();
    can.set_connected(false);
    can.deliver(frame(0x100), 0);
    can.process(1_000_000);
    assert_eq!(can.filled, 0);
}
