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

/// An slcan adapter. Lines longer than `N` bytes are rejected.
#[derive(Clone, Debug, Default)]
pub struct Adapter<const N: usize = MAX_CLASSIC_LINE_BYTES> {
    splitter: LineSplitter<N>,
    open: bool,
    listen_only: bool,
    refused: u32,
    foreign: u32,
}

impl<const N: usize> Adapter<N> {
    /// Creates a closed adapter.
    pub const fn new() -> Self {
        let splitter = LineSplitter::new();
        Self { splitter, open: false, listen_only: false, refused: 0, foreign: 0 }
    }

    /// Returns true while the bus is open; received frames are then forwarded to the host.
    pub const fn is_open(&self) -> bool {
        self.open
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
            Some(SlcanLine::Frame(view)) if self.open && !self.listen_only => {
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
            Some(SlcanLine::Command(command)) => {
                execute(&mut self.open, &mut self.listen_only, command)
            }
            _ => AdapterReply::REFUSED,
        };
        self.refused = self.refused.saturating_add(u32::from(reply == AdapterReply::REFUSED));
        Some(reply)
    }
}

fn execute(open: &mut bool, listen_only: &mut bool, command: AdapterCommand) -> AdapterReply {
    let done = match command {
        AdapterCommand::Version => return AdapterReply { answer: b"V1013\r", frame: None },
        AdapterCommand::SerialNumber => return AdapterReply { answer: b"N0001\r", frame: None },
        AdapterCommand::Status => return AdapterReply { answer: b"F00\r", frame: None },
        AdapterCommand::Open | AdapterCommand::Listen => {
            let closed = !*open;
            if closed {
                *listen_only = command == AdapterCommand::Listen;
            }
            *open = true;
            closed
        }
        AdapterCommand::Close => core::mem::take(open),
        AdapterCommand::BitRate(_) => !*open,
        AdapterCommand::Stamps(on) => !on,
        AdapterCommand::DataRate(_) => false,
    };
    if done { AdapterReply::DONE } else { AdapterReply::REFUSED }
}
