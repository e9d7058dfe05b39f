//! A bus that is written down as it is used.
//!
//! Lines are those of `candump -L -x`: what was sent ends with `T`, what was heard with `R`. A frame heard
//! is read some time after it was on the bus, so lines are held back a moment and written in the order of
//! their stamps; [`Recorder::finish`] writes what is left and says whether all went well.

use super::{Bus, BusError, Counters, Received};
use joint_trace::CanFrame;
use joint_trace::candump::{Direction, Fraction, Line, emit};
use std::collections::VecDeque;
use std::io::Write;

/// How far behind the latest stamp a line may come, ns; and how many lines are held back for it.
const WINDOW_NS: u64 = 100_000_000;
const WINDOW_LINES: usize = 1024;

/// Writes down what goes through it.
pub struct Recorder<B, W: Write> {
    bus: B,
    out: W,
    interface: String,
    fraction: Fraction,
    held: VecDeque<(u64, CanFrame, Direction)>,
    text: Vec<u8>,
}

impl<B, W: Write> Recorder<B, W> {
    /// Around a bus. `interface` is what lines call it, without blanks; `out` should have a buffer.
    pub fn new(bus: B, out: W, interface: &str, fraction: Fraction) -> Self {
        let interface: String =
            interface.chars().map(|sign| if sign.is_whitespace() { '_' } else { sign }).collect();
        let (held, text) = (VecDeque::new(), Vec::new());
        Self { bus, out, interface, fraction, held, text }
    }

    fn hold(&mut self, time_ns: u64, frame: CanFrame, way: Direction) -> Result<(), BusError> {
        let at = self.held.partition_point(|(earlier, ..)| *earlier <= time_ns);
        self.held.insert(at, (time_ns, frame, way));
        let latest = self.held.back().map_or(0, |(latest, ..)| *latest);
        while let Some((time_ns, ..)) = self.held.front()
            && (self.held.len() > WINDOW_LINES || latest - time_ns > WINDOW_NS)
        {
            self.write_first()?;
        }
        Ok(())
    }

    fn write_first(&mut self) -> Result<(), BusError> {
        let Some((time_ns, frame, direction)) = self.held.pop_front() else { return Ok(()) };
        let interface = self.interface.as_bytes();
        let line = Line { time_ns, interface, frame, direction: Some(direction) };
        self.text.clear();
        emit(&line, self.fraction, &mut self.text);
        self.out.write_all(&self.text).map_err(BusError::Record)
    }

    /// Writes what is held back.
    ///
    /// # Errors
    /// [`BusError::Record`].
    pub fn flush(&mut self) -> Result<(), BusError> {
        while !self.held.is_empty() {
            self.write_first()?;
        }
        self.out.flush().map_err(BusError::Record)
    }

    /// Writes all there is and ends. Dropping does so too, but cannot say what went wrong.
    ///
    /// # Errors
    /// [`BusError::Record`].
    pub fn finish(mut self) -> Result<(), BusError> {
        self.flush()
    }

    /// The bus inside.
    pub fn bus(&self) -> &B {
        &self.bus
    }
}

impl<B, W: Write> Drop for Recorder<B, W> {
    fn drop(&mut self) {
        while !self.held.is_empty() && self.write_first().is_ok() {}
        let _ = self.out.flush();
    }
}

impl<B: Bus, W: Write> Bus for Recorder<B, W> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        // The time before: an answer may be on the bus before this call is done.
        let time_ns = self.bus.now_ns();
        self.bus.send(frame)?;
        self.hold(time_ns, *frame, Direction::Sent)
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        let received = self.bus.receive(until_ns)?;
        if let Some(Received { time_ns, frame }) = received {
            self.hold(time_ns, frame, Direction::Received)?;
        }
        Ok(received)
    }

    fn now_ns(&self) -> u64 {
        self.bus.now_ns()
    }

    fn rest(&mut self, until_ns: u64) -> bool {
        self.bus.rest(until_ns)
    }

    fn counters(&self) -> Counters {
        self.bus.counters()
    }
}
