//! The image on a bus with bit errors.

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
