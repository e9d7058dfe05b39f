//! A bus behind an slcan adapter, or an emulated board that speaks slcan as its UART.
//!
//! Opening closes the adapter first and drops what it still had to say, then sets the bit rate and opens
//! it. Adapters answer each command; one that does not is believed, one that rings the bell is not.
//! After that lines are taken as they come: frames are heard, answers mean nothing more than that, bells
//! and lines without sense are counted. A frame's time is the time its line was read. The text itself is
//! [`compensator_core::can::slcan`], the same code as on the board.

use super::address::Address;
use super::bits::padded;
use super::link::Link;
use super::{Bus, BusError, Counters, LONGEST_WAIT, Received, WallClock};
use compensator_core::can::slcan::{
    BitRate, Command, Header, Kind, LONGEST, Line, Piece, Splitter, View, emit, emit_command, parse,
};
use joint_trace::CanFrame;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// How long an adapter has to answer a command.
const ANSWER: Duration = Duration::from_millis(300);
/// Silence after which an adapter that was closed has nothing more to say; and the most that is waited.
const SILENCE: Duration = Duration::from_millis(30);
const SILENCE_AT_LAST: Duration = Duration::from_millis(500);

/// Frames read ahead before no more are read for now.
const INBOX: usize = 4096;

/// How an adapter is to be set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Bit rate of the bus.
    pub bit_rate: BitRate,
    /// Bit rate of CAN FD's data, Mbit/s; `None` leaves it, for adapters that know nothing of it.
    pub data_rate: Option<u8>,
    /// To hear the bus only, and not to acknowledge.
    pub listen: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self { bit_rate: BitRate::MEGABIT, data_rate: None, listen: false }
    }
}

/// A bus behind an adapter. Dropped, it closes the adapter.
#[derive(Debug)]
pub struct Slcan {
    link: Link,
    name: String,
    intake: Intake,
    /// Text that had no room on the line yet.
    outbox: Vec<u8>,
    clock: WallClock,
    closed: Option<String>,
}

impl Slcan {
    /// Opens an adapter and, through it, the bus.
    ///
    /// # Errors
    /// [`BusError::Open`]: nothing there, or the adapter refused.
    pub fn open(address: &Address, options: Options) -> Result<Self, BusError> {
        let name = format!("slcan:{address}");
        let error = |why: String| BusError::Open { name: name.clone(), why };
        let mut bus = Self {
            link: Link::open(address).map_err(error)?,
            name: name.clone(),
            intake: Intake::default(),
            outbox: Vec::new(),
            clock: WallClock::new(),
            closed: None,
        };
        // Empty lines first: they end whatever somebody before us left unfinished.
        bus.outbox.extend_from_slice(b"\r\r");
        bus.command(Command::Close)?;
        bus.wait_for_silence()?;
        let mut commands = vec![Command::BitRate(options.bit_rate)];
        commands.extend(options.data_rate.map(Command::DataRate));
        commands.push(if options.listen { Command::Listen } else { Command::Open });
        for command in commands {
            bus.intake.answer = None;
            bus.command(command)?;
            bus.wait_for_answer()?;
            if bus.intake.answer == Some(false) {
                return Err(error(format!("the adapter refuses {command:?}")));
            }
        }
        bus.intake.counters = Counters::default();
        Ok(bus)
    }

    fn command(&mut self, command: Command) -> Result<(), BusError> {
        let mut text = [0; 8];
        let length = emit_command(command, &mut text).unwrap_or(0);
        self.outbox.extend_from_slice(&text[..length]);
        self.write_out()
    }

    /// Drops what comes until nothing does.
    fn wait_for_silence(&mut self) -> Result<(), BusError> {
        let start = Instant::now();
        let mut last = start;
        let mut bytes = [0; 4096];
        // Some answers must come; who says nothing at all gets the time of an answer.
        let mut patience = ANSWER;
        while last.elapsed() < patience && start.elapsed() < SILENCE_AT_LAST {
            self.pause(false, patience.saturating_sub(last.elapsed()))?;
            match self.link.read(&mut bytes) {
                Ok(Some(0)) => return Err(self.gone("closed by the other end")),
                Ok(Some(_)) => (last, patience) = (Instant::now(), SILENCE),
                Ok(None) => {}
                Err(error) => return Err(self.gone(&error.to_string())),
            }
        }
        self.intake.splitter.clear();
        Ok(())
    }

    fn wait_for_answer(&mut self) -> Result<(), BusError> {
        let start = Instant::now();
        while self.intake.answer.is_none() && start.elapsed() < ANSWER {
            self.pause(false, ANSWER.saturating_sub(start.elapsed()))?;
            self.read_in();
            if let Some(why) = self.closed.clone() {
                return Err(self.gone(&why));
            }
        }
        Ok(())
    }

    fn gone(&self, why: &str) -> BusError {
        BusError::Closed { name: self.name.clone(), why: why.into() }
    }

    fn pause(&self, write: bool, time: Duration) -> Result<(), BusError> {
        let failed = |source| BusError::Io { name: self.name.clone(), source };
        self.link.wait(write, time).map_err(failed)
    }

    /// Writes all that is to be written, reading meanwhile, or both ends could wait for each other.
    fn write_out(&mut self) -> Result<(), BusError> {
        let start = Instant::now();
        while !self.outbox.is_empty() {
            match self.link.write(&self.outbox) {
                Ok(Some(written)) => {
                    self.outbox.drain(..written);
                }
                Ok(None) if start.elapsed() < LONGEST_WAIT => {
                    self.intake.counters.waits += 1;
                    self.pause(true, LONGEST_WAIT.saturating_sub(start.elapsed()))?;
                    self.read_in();
                    if let Some(why) = &self.closed {
                        return Err(self.gone(why));
                    }
                }
                Ok(None) => return Ok(()),
                Err(error) => {
                    let why = error.to_string();
                    self.closed.get_or_insert(why.clone());
                    return Err(self.gone(&why));
                }
            }
        }
        Ok(())
    }

    /// Reads what there is, up to a bound: from who never stops talking, somebody must take frames.
    fn read_in(&mut self) {
        let mut bytes = [0; 4096];
        while self.closed.is_none() && self.intake.inbox.len() < INBOX {
            match self.link.read(&mut bytes) {
                Ok(Some(0)) => {
                    let amid = self.intake.splitter.is_amid_line();
                    let end = if amid { " in the middle of a line" } else { "" };
                    self.closed = Some(format!("closed by the other end{end}"));
                }
                Ok(Some(length)) => {
                    let now_ns = self.clock.now_ns();
                    bytes[..length].iter().for_each(|byte| self.intake.take(*byte, now_ns));
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

/// What is made of the bytes that come.
#[derive(Debug, Default)]
struct Intake {
    splitter: Splitter<LONGEST>,
    inbox: VecDeque<Received>,
    /// Whether the last answer was that it is done, or the bell; `None` where none came since asked.
    answer: Option<bool>,
    counters: Counters,
}

impl Intake {
    fn take(&mut self, byte: u8, time_ns: u64) {
        match self.splitter.push(byte) {
            None => {}
            Some(Piece::Refused) => {
                self.answer = Some(false);
                self.counters.refused += 1;
            }
            Some(Piece::Overlong) => self.counters.garbage += 1,
            Some(Piece::Line(line)) => match parse(line) {
                Ok(Line::Frame(view)) => {
                    self.inbox.push_back(Received { time_ns, frame: heard(&view) });
                    self.counters.received += 1;
                }
                Ok(Line::Done) => self.answer = Some(true),
                Ok(Line::Sent { .. } | Line::Told { .. }) => {}
                Ok(Line::Command(_)) | Err(_) => self.counters.garbage += 1,
            },
        }
    }
}

/// The frame of a line.
fn heard(view: &View) -> CanFrame {
    let Header { kind, identifier, extended, length } = view.header();
    let fill = |bytes: &mut [u8]| {
        bytes.iter_mut().zip(view.bytes()).for_each(|(to, from)| *to = from);
    };
    match kind {
        Kind::Remote => CanFrame::Remote { identifier, extended, length },
        Kind::Data => {
            let mut bytes = [0; 8];
            fill(&mut bytes);
            CanFrame::Data { identifier, extended, length, bytes }
        }
        Kind::Flexible | Kind::Switched => {
            let mut bytes = [0; 64];
            fill(&mut bytes);
            let flags = u8::from(kind == Kind::Switched);
            CanFrame::Flexible { identifier, extended, flags, length, bytes }
        }
    }
}

/// The line of a frame, if there is one.
fn line(frame: &CanFrame, out: &mut [u8]) -> Option<usize> {
    let (kind, identifier, extended, length) = match *frame {
        CanFrame::Data { identifier, extended, length, .. } => {
            (Kind::Data, identifier, extended, length)
        }
        CanFrame::Remote { identifier, extended, length } => {
            (Kind::Remote, identifier, extended, length)
        }
        CanFrame::Flexible { identifier, extended, flags, length, .. } => {
            let kind = if flags & 1 == 1 { Kind::Switched } else { Kind::Flexible };
            (kind, identifier, extended, padded(length))
        }
        CanFrame::Error { .. } => return None,
    };
    let mut data = [0; 64];
    data.iter_mut().zip(frame.data()).for_each(|(to, from)| *to = *from);
    let data = if kind == Kind::Remote { &[][..] } else { data.get(..usize::from(length))? };
    emit(&Header { kind, identifier, extended, length }, data, out)
}

impl Bus for Slcan {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        if let Some(why) = &self.closed {
            return Err(self.gone(why));
        }
        let mut text = [0; LONGEST + 1];
        let what =
            if matches!(frame, CanFrame::Error { .. }) { "error frames" } else { "this frame" };
        let length = line(frame, &mut text)
            .ok_or_else(|| BusError::Unsupported { name: self.name.clone(), what })?;
        // What is left of a line goes first: no line is torn.
        self.write_out()?;
        if !self.outbox.is_empty() {
            let waited_ms = LONGEST_WAIT.as_millis() as u64;
            return Err(BusError::Full { name: self.name.clone(), waited_ms });
        }
        self.outbox.extend_from_slice(&text[..length]);
        self.write_out()?;
        self.intake.counters.sent += 1;
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        loop {
            if let Some(received) = self.intake.inbox.pop_front() {
                return Ok(Some(received));
            }
            self.read_in();
            if !self.intake.inbox.is_empty() {
                continue;
            }
            if let Some(why) = &self.closed {
                return Err(self.gone(why));
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
        self.intake.counters
    }
}

impl Drop for Slcan {
    fn drop(&mut self) {
        // An adapter that is not told goes on talking to nobody.
        let start = Instant::now();
        self.outbox.extend_from_slice(b"C\r");
        while !self.outbox.is_empty() && start.elapsed() < SILENCE {
            let Ok(Some(written)) = self.link.write(&self.outbox) else { return };
            self.outbox.drain(..written);
        }
        // Once it answers it has taken all that was sent. Whoever hangs up earlier may take that back:
        // QEMU drops what it has not read.
        self.read_in();
        self.intake.answer = None;
        let _ = self.wait_for_answer();
    }
}
