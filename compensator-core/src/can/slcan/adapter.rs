//! The device side of slcan: answers of an adapter, independent of the bus.
//!
//! The emulated board of a joint is its own adapter. Bytes of its UART enter here and frames go to the driver.
//! Answers and the lines of [`super::emit_frame`] go back. As other adapters do, it accepts a bit rate only while
//! closed, sends only while open, and answers an error with BELL.

use super::{
    AdapterCommand, FrameKind, LinePiece, LineSplitter, MAX_CLASSIC_LINE_BYTES, SlcanLine, parse,
};
use crate::can::Frame;

/// Reply to a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AdapterReply {
    /// Bytes to write back to the host.
    pub answer: &'static [u8],
    /// Frame to send on the bus.
    pub frame: Option<Frame>,
}

impl AdapterReply {
    const DONE: Self = Self { answer: b"\r", frame: None };
    const REFUSED: Self = Self { answer: b"\x07", frame: None };
}

/// State of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum BusState {
    #[default]
    Closed,
    Open,
    /// Open, and sends nothing.
    Listening,
}

/// An slcan adapter. Lines longer than `N` bytes are rejected.
#[derive(Clone, Debug, Default)]
pub struct Adapter<const N: usize = MAX_CLASSIC_LINE_BYTES> {
    splitter: LineSplitter<N>,
    bus: BusState,
    refused: u32,
    foreign: u32,
}

impl<const N: usize> Adapter<N> {
    /// Creates a closed adapter.
    pub const fn new() -> Self {
        let splitter = LineSplitter::new();
        Self { splitter, bus: BusState::Closed, refused: 0, foreign: 0 }
    }

    /// Returns true while the bus is open; received frames are then forwarded to the host.
    pub const fn is_open(&self) -> bool {
        matches!(self.bus, BusState::Open | BusState::Listening)
    }

    /// Number of rejected lines.
    pub const fn refused(&self) -> u32 {
        self.refused
    }

    /// Number of accepted frames that a joint does not use: 29-bit identifiers or remote requests.
    pub const fn foreign(&self) -> u32 {
        self.foreign
    }

    /// Processes a byte from the host; returns the reply if the byte completes a line.
    pub fn push(&mut self, byte: u8) -> Option<AdapterReply> {
        let line = match self.splitter.push(byte)? {
            LinePiece::Line(line) => parse(line).ok(),
            LinePiece::Refused | LinePiece::Overlong => None,
        };
        let reply = match line {
            // Hosts start with empty lines to flush an incomplete one.
            Some(SlcanLine::Done) => AdapterReply::DONE,
            Some(SlcanLine::Frame(view)) if self.bus == BusState::Open => {
                let header = view.header();
                let classic = matches!(header.kind, FrameKind::Data | FrameKind::Remote);
                let frame = view.frame();
                self.foreign = self.foreign.saturating_add(u32::from(classic && frame.is_none()));
                match (classic, header.extended) {
                    (false, _) => AdapterReply::REFUSED,
                    (true, false) => AdapterReply { answer: b"z\r", frame },
                    (true, true) => AdapterReply { answer: b"Z\r", frame },
                }
            }
            Some(SlcanLine::Command(command)) => self.execute(command),
            _ => AdapterReply::REFUSED,
        };
        self.refused = self.refused.saturating_add(u32::from(reply == AdapterReply::REFUSED));
        Some(reply)
    }

    fn execute(&mut self, command: AdapterCommand) -> AdapterReply {
        let is_done = match command {
            AdapterCommand::Version => return AdapterReply { answer: b"V1013\r", frame: None },
            AdapterCommand::SerialNumber => {
                return AdapterReply { answer: b"N0001\r", frame: None };
            }
            AdapterCommand::Status => return AdapterReply { answer: b"F00\r", frame: None },
            AdapterCommand::Open => self.change(BusState::Open),
            AdapterCommand::Listen => self.change(BusState::Listening),
            AdapterCommand::Close => self.change(BusState::Closed),
            AdapterCommand::BitRate(_) => !self.is_open(),
            AdapterCommand::Stamps(on) => !on,
            AdapterCommand::DataRate(_) => false,
        };
        if is_done { AdapterReply::DONE } else { AdapterReply::REFUSED }
    }

    /// Opens a closed bus or closes an open one. Returns true if it did.
    fn change(&mut self, bus: BusState) -> bool {
        let may_change = self.is_open() == (bus == BusState::Closed);
        if may_change {
            self.bus = bus;
        }
        may_change
    }
}
