//! The image on a bus with bit errors.

use super::access::unlock;
use super::start::started;
use compensator_core::can::Frame;
use emulated_board::chip::CORE_HZ;

const MILLISECOND: u64 = CORE_HZ / 1000;
/// Request of the device type, and the identifier of its answer.
const REQUEST: [u8; 8] = [0x40, 0x00, 0x10, 0, 0, 0, 0, 0];
const ANSWER: u16 = 0x581;

#[test]
fn requests_on_disturbed_bus_are_all_answered() {
    let mut machine = started();
    machine.run(100 * MILLISECOND);
    machine.chip_mut().can.sent.clear();
    machine.chip_mut().can.destroyed_share = 0.1;
    for _ in 0..100 {
        machine.chip_mut().deliver(Frame::new(0x601, &REQUEST).expect("a frame"));
        machine.run(3 * MILLISECOND);
    }
    let sent = &machine.chip().can.sent;
    let answers = sent.iter().filter(|(_, frame)| frame.identifier() == ANSWER).count();
    assert_eq!(answers, 100);
}

#[test]
fn node_without_working_bus_goes_off_and_answers_again() {
    let mut machine = started();
    machine.run(100 * MILLISECOND);
    machine.chip_mut().deliver(Frame::new(0x601, &REQUEST).expect("a frame"));
    // The request has come; from now on its answer is destroyed.
    machine.run(MILLISECOND / 7);
    machine.chip_mut().can.destroyed_share = 1.0;
    machine.run(20 * MILLISECOND);
    assert!(machine.chip().can.bus_offs > 0, "the controller never stops");
    machine.chip_mut().can.destroyed_share = 0.0;
    machine.run(50 * MILLISECOND);
    machine.chip_mut().can.sent.clear();
    machine.chip_mut().deliver(Frame::new(0x601, &REQUEST).expect("a frame"));
    machine.run(10 * MILLISECOND);
    let sent = &machine.chip().can.sent;
    assert!(sent.iter().any(|(_, frame)| frame.identifier() == ANSWER), "{sent:?}");
}

/// Delivers a frame, runs for a time, and returns what the image has sent.
pub fn exchange(
    machine: &mut emulated_board::Machine<impl emulated_board::world::World>,
    identifier: u16,
    data: &[u8],
    milliseconds: u64,
) -> Vec<Frame> {
    machine.chip_mut().can.sent.clear();
    machine.chip_mut().deliver(Frame::new(identifier, data).expect("a frame"));
    machine.run(milliseconds * MILLISECOND);
    machine.chip().can.sent.iter().map(|(_, frame)| *frame).collect()
}

fn answers(frames: &[Frame], identifier: u16) -> Vec<&[u8]> {
    frames.iter().filter(|frame| frame.identifier() == identifier).map(Frame::data).collect()
}

#[test]
fn controller_accepts_moved_pdo_and_lss_and_follows_flexible_frames() {
    let mut machine = started();
    machine.run(100 * MILLISECOND);
    assert_eq!(machine.chip().can.data_bit_rate(), Some(2_000_000));
    // The Command frame comes with the identifier of another node.
    let moved = [0x23, 0x01, 0x14, 1, 0x82, 0x01, 0, 0];
    let current = 1.5f32.to_le_bytes();
    let [a, b, c, d] = current;
    let command = [a, b, c, d, 0, 0, 0, 1];
    assert_eq!(answers(&exchange(&mut machine, 0x601, &moved, 3), ANSWER).len(), 1);
    exchange(&mut machine, 0, &[1, 1], 3);
    exchange(&mut machine, 0x182, &command, 3);
    let read = [0x40, 0x04, 0x20, 9, 0, 0, 0, 0];
    assert_eq!(answers(&exchange(&mut machine, 0x601, &read, 3), ANSWER)[0][4..], current);
    // A joint without stored settings answers to LSS.
    let unconfigured = exchange(&mut machine, 0x7E5, &[0x4C, 0, 0, 0, 0, 0, 0, 0], 3);
    assert_eq!(answers(&unconfigured, 0x7E4), [[0x50, 0, 0, 0, 0, 0, 0, 0]]);
}

#[test]
fn telemetry_in_a_frame_of_can_fd_contains_the_classic_frames() {
    let mut machine = started();
    machine.run(100 * MILLISECOND);
    exchange(&mut machine, 0, &[1, 1], 3);
    let identifiers = |frames: Vec<Frame>| -> Vec<u16> {
        let sent = frames.iter().map(Frame::identifier);
        let mut found: Vec<u16> =
            sent.filter(|identifier| !matches!(identifier & 0x780, 0x080 | 0x700)).collect();
        // Their order is that of the bus, which the lowest identifier wins.
        found.sort_unstable();
        found
    };
    // All frames are sent at the tenth SYNC.
    let mut classic = Vec::new();
    for counter in 1..=10 {
        classic = identifiers(exchange(&mut machine, 0x080, &[counter], 3));
    }
    assert_eq!(classic, [0x181, 0x281, 0x381, 0x481, 0x681]);
    assert!(machine.chip().can.sent_fd.is_empty());
    unlock(&mut machine);
    let on = [0x2F, 0x01, 0x20, 9, 1, 0, 0, 0];
    let answer = exchange(&mut machine, 0x601, &on, 20);
    assert_eq!(answers(&answer, ANSWER)[0][0], 0x60);
    // The frames are those in the frame of CAN FD.
    assert_eq!(identifiers(exchange(&mut machine, 0x080, &[11], 3)), classic);
    let sent = &machine.chip().can.sent_fd;
    let [(_, frame)] = sent.iter().collect::<Vec<_>>()[..] else { panic!("{sent:?}") };
    assert_eq!((frame.identifier(), frame.counter()), (0x381, 11));
    assert!((100_000..300_000).contains(&frame.time_us()), "{} us", frame.time_us());
    assert!(frame.get(5).is_some(), "the drive");
}

#[test]
fn record_is_read_in_one_block_through_a_fifo_of_three_frames() {
    let mut machine = started();
    machine.run(100 * MILLISECOND);
    let begin = exchange(&mut machine, 0x601, &[0xA4, 0x27, 0x20, 5, 127, 0, 0, 0], 3);
    let begin = answers(&begin, ANSWER)[0];
    let length = u32::from_le_bytes(begin[4..8].try_into().expect("four bytes")) as usize;
    assert_eq!((begin[0], begin.len()), (0xC6, 8));
    let segments = exchange(&mut machine, 0x601, &[0xA3, 0, 0, 0, 0, 0, 0, 0], 40);
    let segments = answers(&segments, ANSWER);
    assert_eq!(segments.len(), length.div_ceil(7));
    for (place, segment) in segments.iter().enumerate() {
        let last = if place + 1 == segments.len() { 0x80 } else { 0 };
        assert_eq!(segment[0], (place as u8 + 1) | last);
    }
    let confirm = [0xA2, segments.len() as u8, 127, 0, 0, 0, 0, 0];
    let end = exchange(&mut machine, 0x601, &confirm, 3);
    assert_eq!(answers(&end, ANSWER)[0][0] & 0xE3, 0xC1);
}
