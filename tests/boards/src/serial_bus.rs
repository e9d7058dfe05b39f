//! CAN over a serial line as slcan text. The board acts as its own adapter, so any program for a USB
//! adapter can use it.
//!
//! No frame is dropped to save time: without room for answers no byte is received, and the host waits.

use compensator_core::can::Frame;
use compensator_core::can::slcan::{Adapter, MAX_CLASSIC_LINE_BYTES, emit_frame};
use heapless::Deque;

/// Capacity of the send queue, bytes.
const SEND_QUEUE_BYTES: usize = 4096;
/// Free space required before a byte is received, bytes: all answers to one frame fit.
const MIN_FREE_BYTES: usize = 1024;

/// A serial line, byte by byte.
pub trait SerialLine {
    /// Returns the received byte, if there is one.
    fn receive(&mut self) -> Option<u8>;

    /// Sends a byte; returns false if it cannot be accepted yet.
    fn send(&mut self, byte: u8) -> bool;
}

/// CAN on a serial line.
pub struct SerialBus<L> {
    /// The serial line.
    pub line: L,
    adapter: Adapter,
    waiting: Deque<u8, SEND_QUEUE_BYTES>,
}

impl<L: SerialLine> SerialBus<L> {
    /// Creates a closed bus.
    pub fn new(line: L) -> Self {
        Self { line, adapter: Adapter::new(), waiting: Deque::new() }
    }

    /// Returns the next frame from the received text, as long as there is room for its answers.
    pub fn receive(&mut self) -> Option<Frame> {
        loop {
            self.send_waiting();
            if !self.has_room() {
                return None;
            }
            let Some(received) = self.adapter.push(self.line.receive()?) else {
                continue;
            };
            for byte in received.answer {
                let _ = self.waiting.push_back(*byte);
            }
            if received.frame.is_some() {
                return received.frame;
            }
        }
    }

    /// Queues a frame if the host has opened the channel. There is always room, because no byte is received
    /// without.
    pub fn publish(&mut self, frame: &Frame) {
        let mut text = [0; MAX_CLASSIC_LINE_BYTES + 1];
        if self.adapter.is_open()
            && let Some(length) = emit_frame(frame, &mut text)
        {
            for byte in text.get(..length).unwrap_or_default() {
                let _ = self.waiting.push_back(*byte);
            }
        }
    }

    /// Returns true if there is room for all answers to one frame.
    pub fn has_room(&self) -> bool {
        self.waiting.capacity() - self.waiting.len() >= MIN_FREE_BYTES
    }

    /// Sends as many bytes as the line accepts.
    pub fn send_waiting(&mut self) {
        while let Some(byte) = self.waiting.front() {
            if !self.line.send(*byte) {
                break;
            }
            self.waiting.pop_front();
        }
    }

    /// Sends as many bytes as possible and returns true if the queue is empty.
    pub fn is_idle(&mut self) -> bool {
        self.send_waiting();
        self.waiting.is_empty()
    }
}
