//! CAN over a serial line, as slcan text: the board is its own adapter, and what can use a USB adapter can use it.
//!
//! Nothing is thrown away to save time: while there is no room for answers no byte is taken in, and the host waits.

use compensator_core::can::Frame;
use compensator_core::can::slcan::{Adapter, LONGEST_CLASSIC, emit_frame};
use heapless::Deque;

/// Text that waits to be sent, bytes.
const WAITING: usize = 4096;
/// Room there must be before a byte is taken in: for all the driver can say to one frame.
const ROOM: usize = 1024;

/// A serial line, byte by byte.
pub trait SerialLine {
    /// The byte that came, if one did.
    fn receive(&mut self) -> Option<u8>;

    /// Sends a byte; `false` where it cannot be taken yet.
    fn send(&mut self, byte: u8) -> bool;
}

/// CAN on a serial line.
pub struct SerialBus<L> {
    /// The line.
    pub line: L,
    adapter: Adapter,
    waiting: Deque<u8, WAITING>,
}

impl<L: SerialLine> SerialBus<L> {
    /// A bus that nobody listens to yet.
    pub fn new(line: L) -> Self {
        Self { line, adapter: Adapter::new(), waiting: Deque::new() }
    }

    /// The next frame of the text that came, as long as there is room for what is said to it.
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

    /// Puts a frame in the queue, if the host wants to hear the bus. There is room: no byte is taken in without.
    pub fn publish(&mut self, frame: &Frame) {
        let mut text = [0; LONGEST_CLASSIC + 1];
        if self.adapter.is_open()
            && let Some(length) = emit_frame(frame, &mut text)
        {
            for byte in text.get(..length).unwrap_or_default() {
                let _ = self.waiting.push_back(*byte);
            }
        }
    }

    /// Whether there is room for all the driver can say to one frame.
    pub fn has_room(&self) -> bool {
        self.waiting.capacity() - self.waiting.len() >= ROOM
    }

    /// Sends as much as is taken.
    pub fn send_waiting(&mut self) {
        while let Some(byte) = self.waiting.front() {
            if !self.line.send(*byte) {
                break;
            }
            self.waiting.pop_front();
        }
    }

    /// Whether everything has left, once as much as is taken was sent.
    pub fn is_idle(&mut self) -> bool {
        self.send_waiting();
        self.waiting.is_empty()
    }
}
