//! Bytes into lines.

use super::{DONE, REFUSED};
use heapless::Vec;

/// What a byte completed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Piece<'a> {
    /// A line, without its end; an empty one is an answer.
    Line(&'a [u8]),
    /// The bell: something was refused. What stood before it on its line is gone.
    Refused,
    /// A line longer than any: gone.
    Overlong,
}

/// Collects bytes until they are a line of up to `N`. A line feed is nothing: some end lines with both.
#[derive(Clone, Debug, Default)]
pub struct Splitter<const N: usize> {
    bytes: Vec<u8, N>,
    overlong: bool,
    ended: bool,
}

impl<const N: usize> Splitter<N> {
    /// With nothing collected.
    pub const fn new() -> Self {
        Self { bytes: Vec::new(), overlong: false, ended: false }
    }

    /// Takes a byte; gives what it completed.
    pub fn push(&mut self, byte: u8) -> Option<Piece<'_>> {
        if self.ended {
            self.clear();
        }
        match byte {
            b'\n' => None,
            REFUSED => {
                self.ended = true;
                Some(Piece::Refused)
            }
            DONE => {
                self.ended = true;
                Some(if self.overlong { Piece::Overlong } else { Piece::Line(&self.bytes) })
            }
            byte => {
                self.overlong |= self.bytes.push(byte).is_err();
                None
            }
        }
    }

    /// Forgets a line begun.
    pub fn clear(&mut self) {
        self.bytes.clear();
        self.overlong = false;
        self.ended = false;
    }

    /// Whether a line has begun and not ended.
    pub fn is_amid_line(&self) -> bool {
        !self.ended && (self.overlong || !self.bytes.is_empty())
    }
}
