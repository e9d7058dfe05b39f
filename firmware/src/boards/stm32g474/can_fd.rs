//! The frame of CAN FD per sample, if the joint is set to it.

use super::can::{Controller, FD_FRAME, LENGTH_SHIFT};
use compensator_core::can::FdTelemetry;

/// Flag of a switched bit rate, in the second word of an element.
const SWITCHED_RATE: u32 = 1 << 20;
/// Length code of 64 bytes.
const LENGTH_64: u32 = 15;

/// Sends a frame of CAN FD. Check [`Controller::has_room_for`] first.
pub fn send(controller: &mut Controller, frame: &FdTelemetry) {
    let format = LENGTH_64 | (FD_FRAME | SWITCHED_RATE) >> LENGTH_SHIFT;
    controller.transmit(frame.identifier(), format, frame.data());
}
