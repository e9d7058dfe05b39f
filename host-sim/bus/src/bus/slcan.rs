//! A bus behind an slcan adapter, or behind the UART of an emulated board that uses slcan.
//!
//! Opening closes the adapter first, discards its pending output, sets the bit rate, and opens it. A missing answer to a
//! command is accepted; a refusal (BEL) is an error. After that, frames are received, and refusals and malformed lines are
//! counted. The time of a frame is the time at which its line was read. The text is coded by
//! [`compensator_core::can::slcan`], the same code as on the board.

use super::bits::padded;
use super::link::Link;
use super::{Address, Bus, BusError, Counters, OpenError, Received, SEND_TIMEOUT, WallClock};
use compensator_core::can::slcan::{
    AdapterCommand, BitRate, FrameHeader, FrameKind, FrameView, LinePiece, LineSplitter,
    MAX_LINE_BYTES, SlcanLine, emit, emit_command, parse,
};
use joint_trace::CanFrame;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Time limit for the answer to a command.
const ANSWER_TIMEOUT: Duration = Duration::from_millis(300);
/// Silence after which a closed adapter has sent all its output.
const SILENCE_AFTER_CLOSE: Duration = Duration::from_millis(30);
/// Time limit for that silence.
const SILENCE_TIMEOUT: Duration = Duration::from_millis(500);

/// Maximum number of frames read ahead.
const MAX_INBOX_FRAMES: usize = 4096;

/// Settings of an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Bit rate of the bus.
    pub bit_rate: BitRate,
    /// True to receive only, without acknowledging frames.
    pub listen: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { bit_rate: BitRate::MEGABIT, listen: false }
    }
}

/// A bus behind an adapter. Dropping it closes the adapter.
#[derive(Debug)]
pub struct Slcan {
    link: Link,
    name: String,
    decoder: LineDecoder,
    /// Text that is not written yet.
    outbox: Vec<u8>,
    clock: WallClock,
    closed: Option<String>,
}

impl Slcan {
    /// Opens an adapter and, through it, the bus.
    ///
    /// # Errors
    /// Returns [`BusError::Open`] if there is no adapter or it refuses.
    pub fn open(address: &Address, options: Options) -> Result<Self, BusError> {
        let name = format!("slcan:{address}");
        let error = |source| BusError::Open { name: name.clone(), source };
        let mut bus = Self {
            link: Link::open(address).map_err(error)?,
            name: name.clone(),
            decoder: LineDecoder::default(),
            outbox: Vec::new(),
            clock: WallClock::new(),
            closed: None,
        };
        // Empty lines first: they end a line that an earlier program left unfinished.
        bus.outbox.extend_from_slice(b"\r\r");
        bus.command(AdapterCommand::Close)?;
        bus.wait_for_silence()?;
        let open = if options.listen { AdapterCommand::Listen } else { AdapterCommand::Open };
        for command in [AdapterCommand::BitRate(options.bit_rate), open] {
            bus.decoder.answer = None;
            bus.command(command)?;
            bus.wait_for_answer()?;
            if bus.decoder.answer == Some(false) {
                return Err(error(OpenError::Refused(command)));
            }
        }
        bus.decoder.counters = Counters::default();
        Ok(bus)
    }

    fn command(&mut self, command: AdapterCommand) -> Result<(), BusError> {
        let mut text = [0; 8];
        let length = emit_command(command, &mut text).expect("a command has at most three letters");
        self.outbox.extend_from_slice(&text[..length]);
        self.write_out()
    }

    /// Discards input until the adapter is silent.
    fn wait_for_silence(&mut self) -> Result<(), BusError> {
        let start = Instant::now();
        let mut last = start;
        let mut bytes = [0; 4096];
        // The first answer may take the full time limit.
        let mut limit = ANSWER_TIMEOUT;
        while last.elapsed() < limit && start.elapsed() < SILENCE_TIMEOUT {
            self.pause(false, limit.saturating_sub(last.elapsed()))?;
            match self.link.read(&mut bytes) {
                Ok(Some(0)) => return Err(self.closed_error("closed by the other end")),
                Ok(Some(_)) => (last, limit) = (Instant::now(), SILENCE_AFTER_CLOSE),
                Ok(None) => {}
                Err(error) => return Err(self.closed_error(&error.to_string())),
            }
        }
        self.decoder.splitter.clear();
        Ok(())
    }

    fn wait_for_answer(&mut self) -> Result<(), BusError> {
        let start = Instant::now();
        while self.decoder.answer.is_none() && start.elapsed() < ANSWER_TIMEOUT {
            self.pause(false, ANSWER_TIMEOUT.saturating_sub(start.elapsed()))?;
            self.read_in();
            if let Some(why) = self.closed.clone() {
                return Err(self.closed_error(&why));
            }
        }
        Ok(())
    }

    fn closed_error(&self, why: &str) -> BusError {
        BusError::Closed { name: self.name.clone(), why: why.into() }
    }

    fn pause(&self, write: bool, time: Duration) -> Result<(), BusError> {
        let failed = |source| BusError::Io { name: self.name.clone(), source };
        self.link.wait(write, time).map_err(failed)
    }

    /// Writes the pending text. Reads meanwhile, so that both ends do not wait for each other.
    fn write_out(&mut self) -> Result<(), BusError> {
        let start = Instant::now();
        while !self.outbox.is_empty() {
            match self.link.write(&self.outbox) {
                Ok(Some(written)) => {
                    self.outbox.drain(..written);
                }
                Ok(None) if start.elapsed() < SEND_TIMEOUT => {
                    self.decoder.counters.waits += 1;
                    self.pause(true, SEND_TIMEOUT.saturating_sub(start.elapsed()))?;
                    self.read_in();
                    if let Some(why) = &self.closed {
                        return Err(self.closed_error(why));
                    }
                }
                Ok(None) => return Ok(()),
                Err(error) => {
                    let why = error.to_string();
                    self.closed.get_or_insert(why.clone());
                    return Err(self.closed_error(&why));
                }
            }
        }
        Ok(())
    }

    /// Reads the available input, up to a bound, so that an adapter that never pauses cannot block.
    fn read_in(&mut self) {
        let mut bytes = [0; 4096];
        while self.closed.is_none() && self.decoder.inbox.len() < MAX_INBOX_FRAMES {
            match self.link.read(&mut bytes) {
                Ok(Some(0)) => {
                    let amid = self.decoder.splitter.has_partial_line();
                    let end = if amid { " in the middle of a line" } else { "" };
                    self.closed = Some(format!("closed by the other end{end}"));
                }
                Ok(Some(length)) => {
                    let now_ns = self.clock.now_ns();
                    bytes[..length].iter().for_each(|byte| self.decoder.push(*byte, now_ns));
                    if length < bytes.len() {
                        return;
                    }
                }
                Ok(None) => return,
                Err(error) => self.closed = Some(error.to_string()),
            }
        }
    }
}

/// Decodes the received bytes.
#[derive(Debug, Default)]
struct LineDecoder {
    splitter: LineSplitter<MAX_LINE_BYTES>,
    inbox: VecDeque<Received>,
    /// True if the last answer was positive, false if it was a refusal, `None` before an answer.
    answer: Option<bool>,
    counters: Counters,
}

impl LineDecoder {
    fn push(&mut self, byte: u8, time_ns: u64) {
        match self.splitter.push(byte) {
            None => {}
            Some(LinePiece::Refused) => {
                self.answer = Some(false);
                self.counters.refused += 1;
            }
            Some(LinePiece::Overlong) => self.counters.garbage += 1,
            Some(LinePiece::Line(line)) => match parse(line) {
                Ok(SlcanLine::Frame(view)) => {
                    self.inbox.push_back(Received { time_ns, frame: frame_of(&view) });
                    self.counters.received += 1;
                }
                Ok(SlcanLine::Done) => self.answer = Some(true),
                Ok(SlcanLine::Sent { .. } | SlcanLine::Report { .. }) => {}
                Ok(SlcanLine::Command(_)) | Err(_) => self.counters.garbage += 1,
            },
        }
    }
}

/// Converts the frame of a line.
fn frame_of(view: &FrameView) -> CanFrame {
    let FrameHeader { kind, identifier, extended, length } = view.header();
    let fill = |bytes: &mut [u8]| {
        bytes.iter_mut().zip(view.bytes()).for_each(|(to, from)| *to = from);
    };
    match kind {
        FrameKind::Remote => CanFrame::Remote { identifier, extended, length },
        FrameKind::Data => {
            let mut bytes = [0; 8];
            fill(&mut bytes);
            CanFrame::Data { identifier, extended, length, bytes }
        }
        FrameKind::Flexible | FrameKind::Switched => {
            let mut bytes = [0; 64];
            fill(&mut bytes);
            let flags = u8::from(kind == FrameKind::Switched);
            CanFrame::Flexible { identifier, extended, flags, length, bytes }
        }
    }
}

/// Writes the line of a frame. Returns its length, or `None` for frames without a line.
fn emit_line(frame: &CanFrame, out: &mut [u8]) -> Option<usize> {
    let (kind, identifier, extended, length) = match *frame {
        CanFrame::Data { identifier, extended, length, .. } => {
            (FrameKind::Data, identifier, extended, length)
        }
        CanFrame::Remote { identifier, extended, length } => {
            (FrameKind::Remote, identifier, extended, length)
        }
        CanFrame::Flexible { identifier, extended, flags, length, .. } => {
            let kind = if flags & 1 == 1 { FrameKind::Switched } else { FrameKind::Flexible };
            (kind, identifier, extended, padded(length))
        }
        CanFrame::Error { .. } => return None,
    };
    let mut data = [0; 64];
    data.iter_mut().zip(frame.data()).for_each(|(to, from)| *to = *from);
    let data = if kind == FrameKind::Remote { &[][..] } else { data.get(..usize::from(length))? };
    emit(&FrameHeader { kind, identifier, extended, length }, data, out)
}

impl Bus for Slcan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        if let Some(why) = &self.closed {
            return Err(self.closed_error(why));
        }
        let mut text = [0; MAX_LINE_BYTES + 1];
        let what =
            if matches!(frame, CanFrame::Error { .. }) { "error frames" } else { "this frame" };
        let length = emit_line(frame, &mut text)
            .ok_or_else(|| BusError::Unsupported { name: self.name.clone(), what })?;
        // The rest of an unfinished line is sent first.
        self.write_out()?;
        if !self.outbox.is_empty() {
            let waited_ms = SEND_TIMEOUT.as_millis() as u64;
            return Err(BusError::Full { name: self.name.clone(), waited_ms });
        }
        self.outbox.extend_from_slice(&text[..length]);
        self.write_out()?;
        self.decoder.counters.sent += 1;
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        loop {
            if let Some(received) = self.decoder.inbox.pop_front() {
                return Ok(Some(received));
            }
            self.read_in();
            if !self.decoder.inbox.is_empty() {
                continue;
            }
            if let Some(why) = &self.closed {
                return Err(self.closed_error(why));
            }
            let left = self.clock.left(until_ns);
            if left.is_zero() {
                return Ok(None);
            }
            self.pause(!self.outbox.is_empty(), left)?;
            if !self.outbox.is_empty() {
                self.write_out()?;
            }
        }
    }

    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn counters(&self) -> Counters {
        self.decoder.counters
    }
}

impl Drop for Slcan {
    fn drop(&mut self) {
        // Without the close command, the adapter would keep sending.
        let start = Instant::now();
        self.outbox.extend_from_slice(b"C\r");
        while !self.outbox.is_empty() && start.elapsed() < SILENCE_AFTER_CLOSE {
            let Ok(Some(written)) = self.link.write(&self.outbox) else { return };
            self.outbox.drain(..written);
        }
        // The answer shows that the adapter has read everything. A serial line may discard unread
        // input when the connection closes.
        self.read_in();
        self.decoder.answer = None;
        let _ = self.wait_for_answer();
    }
}
