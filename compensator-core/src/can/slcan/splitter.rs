//! Splits a byte stream into lines.

use super::{DONE, REFUSED};
use heapless::Vec;

/// Part of the stream completed by a byte.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinePiece<'a> {
    /// A line without its end. An empty line is an answer.
    Line(&'a [u8]),
    /// BELL: the adapter reports an error. Text before it on the line is discarded.
    Refused,
    /// The line was too long and is discarded.
    Overlong,
}

/// Collects bytes into lines of up to `N` bytes. Line feeds are ignored, because some devices end lines with CR LF.
#[derive(Clone, Debug, Default)]
pub struct LineSplitter<const N: usize> {
    bytes: Vec<u8, N>,
    overlong: bool,
    ended: bool,
}

impl<const N: usize> LineSplitter<N> {
    /// Creates an empty splitter.
    pub const fn new() -> Self {
        Self { bytes: Vec::new(), overlong: false, ended: false }
    }

    /// Processes a byte; returns the part that it completes.
    pub fn push(&mut self, byte: u8) -> Option<LinePiece<'_>> {
        if self.ended {
            self.clear();
        }
        match byte {
            b'\n' => None,
            REFUSED => {
                self.ended = true;
                Some(LinePiece::Refused)
            }
            DONE => {
                self.ended = true;
                Some(if self.overlong { LinePiece::Overlong } else { LinePiece::Line(&self.bytes) })
            }
            byte => {
                self.overlong |= self.bytes.push(byte).is_err();
                None
            }
        }
    }

    /// Discards an incomplete line.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.overlong = false;
        self.ended = false;
    }

    /// Returns true if a line has begun and not ended.
    pub fn has_partial_line(&self) -> bool {
        !self.ended && (self.overlong || !self.bytes.is_empty())
    }
}
