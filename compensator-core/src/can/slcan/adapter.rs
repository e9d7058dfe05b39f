//! The device's side: what an adapter answers, without the bus behind it.
//!
//! A joint's emulated board is its own adapter: bytes of its UART come in here, frames go to the driver,
//! answers and [`super::emit_frame`]'s lines go back. As adapters do, it takes the bit rate while closed
//! only, sends while open only, and refuses with a bell.

use super::{Command, Kind, LONGEST_CLASSIC, Line, Piece, Splitter, parse};
use crate::can::Frame;

/// What became of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heard {
    /// To be written back at once.
    pub answer: &'static [u8],
    /// For the bus.
    pub frame: Option<Frame>,
}

impl Heard {
    const DONE: Self = Self { answer: b"\r", frame: None };
    const REFUSED: Self = Self { answer: b"\x07", frame: None };
}

/// An adapter's state. Longer lines than `N` are refused.
#[derive(Clone, Debug, Default)]
pub struct Adapter<const N: usize = LONGEST_CLASSIC> {
    splitter: Splitter<N>,
    open: bool,
    listens: bool,
    refused: u32,
    foreign: u32,
}

impl<const N: usize> Adapter<N> {
    /// Closed, as adapters start.
    pub const fn new() -> Self {
        let splitter = Splitter::new();
        Self { splitter, open: false, listens: false, refused: 0, foreign: 0 }
    }

    /// Whether the host wants to hear the bus: frames go to it while this is so.
    pub const fn is_open(&self) -> bool {
        self.open
    }

    /// Lines refused so far.
    pub const fn refused(&self) -> u32 {
        self.refused
    }

    /// Frames taken that are no joint's: 29 bits, or remote.
    pub const fn foreign(&self) -> u32 {
        self.foreign
    }

    /// Takes a byte from the host; says what became of its line where it ended one.
    pub fn push(&mut self, byte: u8) -> Option<Heard> {
        let line = match self.splitter.push(byte)? {
            Piece::Line(line) => parse(line).ok(),
            Piece::Refused | Piece::Overlong => None,
        };
        let heard = match line {
            // An empty line clears what was left of another: hosts begin with some.
            Some(Line::Done) => Heard::DONE,
            Some(Line::Frame(view)) if self.open && !self.listens => {
                let header = view.header();
                let classic = matches!(header.kind, Kind::Data | Kind::Remote);
                let frame = view.frame();
                self.foreign = self.foreign.saturating_add(u32::from(classic && frame.is_none()));
                match (classic, header.extended) {
                    (false, _) => Heard::REFUSED,
                    (true, false) => Heard { answer: b"z\r", frame },
                    (true, true) => Heard { answer: b"Z\r", frame },
                }
            }
            Some(Line::Command(command)) => obey(&mut self.open, &mut self.listens, command),
            _ => Heard::REFUSED,
        };
        self.refused = self.refused.saturating_add(u32::from(heard == Heard::REFUSED));
        Some(heard)
    }
}

fn obey(open: &mut bool, listens: &mut bool, command: Command) -> Heard {
    let done = match command {
        Command::Version => return Heard { answer: b"V1013\r", frame: None },
        Command::SerialNumber => return Heard { answer: b"N0001\r", frame: None },
        Command::Status => return Heard { answer: b"F00\r", frame: None },
        Command::Open | Command::Listen => {
            let closed = !*open;
            if closed {
                *listens = command == Command::Listen;
            }
            *open = true;
            closed
        }
        Command::Close => core::mem::take(open),
        Command::BitRate(_) => !*open,
        Command::Stamps(on) => !on,
        Command::DataRate(_) => false,
    };
    if done { Heard::DONE } else { Heard::REFUSED }
}
