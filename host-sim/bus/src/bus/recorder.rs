//! A recorder around a bus.
//!
//! The lines are those of `candump -L -x`: a sent frame ends with `T`, a received one with `R`. A received frame is read
//! some time after it was on the bus. So lines are held for a short time and written in the order of their time stamps.
//! [`Recorder::flush`] writes the rest and reports errors.

use super::{Bus, BusError, Counters, Received};
use joint_trace::CanFrame;
use joint_trace::candump::emit;
use joint_trace::{Direction, Fraction, Line};
use std::collections::VecDeque;
use std::io::Write;

/// Maximum delay of a line against the latest time stamp, ns, and the maximum number of held lines.
const REORDER_WINDOW_NS: u64 = 100_000_000;
const MAX_HELD_LINES: usize = 1024;

/// A line that is not written yet.
struct HeldLine {
    time_ns: u64,
    frame: CanFrame,
    direction: Direction,
}

/// Records the frames that pass through it.
pub struct Recorder<B, W: Write> {
    bus: B,
    out: W,
    interface: String,
    fraction: Fraction,
    /// In the order of their times.
    held: VecDeque<HeldLine>,
    text: Vec<u8>,
}

impl<B, W: Write> Recorder<B, W> {
    /// Creates a recorder around a bus. `interface` is the name in the lines, in which `_` replaces blanks. `out` should be buffered.
    pub fn new(bus: B, out: W, interface: &str, fraction: Fraction) -> Self {
        let interface: String =
            interface.chars().map(|sign| if sign.is_whitespace() { '_' } else { sign }).collect();
        Self { bus, out, interface, fraction, held: VecDeque::new(), text: Vec::new() }
    }

    fn hold(&mut self, line: HeldLine) -> Result<(), BusError> {
        let place = self.held.partition_point(|earlier| earlier.time_ns <= line.time_ns);
        self.held.insert(place, line);
        let latest_ns = self.held.back().map_or(0, |latest| latest.time_ns);
        while let Some(first) = self.held.front()
            && (self.held.len() > MAX_HELD_LINES || latest_ns - first.time_ns > REORDER_WINDOW_NS)
        {
            self.write_first()?;
        }
        Ok(())
    }

    fn write_first(&mut self) -> Result<(), BusError> {
        let Some(first) = self.held.pop_front() else { return Ok(()) };
        let HeldLine { time_ns, frame, direction } = first;
        let interface = self.interface.as_bytes();
        let line = Line { time_ns, interface, frame, direction: Some(direction) };
        self.text.clear();
        emit(&line, self.fraction, &mut self.text);
        self.out.write_all(&self.text).map_err(BusError::Record)
    }

    /// Writes the held lines. Dropping does the same, but cannot report errors.
    ///
    /// # Errors
    /// Returns [`BusError::Record`].
    pub fn flush(&mut self) -> Result<(), BusError> {
        while !self.held.is_empty() {
            self.write_first()?;
        }
        self.out.flush().map_err(BusError::Record)
    }

    /// Returns the inner bus.
    pub fn bus(&self) -> &B {
        &self.bus
    }
}

impl<B, W: Write> Drop for Recorder<B, W> {
    fn drop(&mut self) {
        let _ = self.flush();
    }
}

impl<B: Bus, W: Write> Bus for Recorder<B, W> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        // Read before sending, because an answer may be on the bus before the call returns.
        let time_ns = self.bus.now_ns();
        self.bus.send(frame)?;
        self.hold(HeldLine { time_ns, frame: *frame, direction: Direction::Sent })
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        let received = self.bus.receive(until_ns)?;
        if let Some(Received { time_ns, frame }) = received {
            self.hold(HeldLine { time_ns, frame, direction: Direction::Received })?;
        }
        Ok(received)
    }

    fn now_ns(&self) -> u64 {
        self.bus.now_ns()
    }

    fn sleep_until(&mut self, until_ns: u64) -> bool {
        self.bus.sleep_until(until_ns)
    }

    fn counters(&self) -> Counters {
        self.bus.counters()
    }
}
