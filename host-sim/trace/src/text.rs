//! The text formats of CAN logs: detection of the format, and lines to frames.
//!
//! A line of [`candump`] is complete by itself. The formats of Vector and PEAK have headers that define the following
//! lines, so a [`TextReader`] keeps these settings.

use crate::fields::{Frames, MAX_TIME_NS};
use crate::frame::{CanFrame, Fraction, Line, LineError, TextFormat};
use crate::{asc, candump, trc};

impl TextFormat {
    /// Returns the format of a file with this beginning, or `None` if it is not a CAN log.
    pub fn of(head: &[u8]) -> Option<Self> {
        if asc::is_format_of(head) {
            return Some(Self::Asc);
        }
        if trc::is_format_of(head) {
            return Some(Self::Trc);
        }
        let mut lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
        let first = lines.find(|line| !line.is_empty() && line[0] != b'#');
        // A line that ends at the end of `head` still has a complete time stamp.
        let is_candump = first.is_some_and(|line| candump::parse(line) != Err(LineError::Time));
        (is_candump || lacks_stamps(head)).then_some(Self::Candump)
    }
}

/// Number of lines at the start of a file, one of which must be a frame for a log of candump without stamps.
const JUDGED_LINES: usize = 5;

/// Returns true for a log of candump whose lines have no stamps.
fn lacks_stamps(head: &[u8]) -> bool {
    let mut lines = head.split(|byte| *byte == b'\n').take(JUDGED_LINES);
    lines.any(|line| candump::parse_unstamped(line).is_ok())
}

/// Reads the lines of a file in order.
#[derive(Clone, Copy, Debug, Default)]
pub struct TextReader {
    format: TextFormat,
    /// Sum of the stamps so far, ns, if a candump log states the time since the frame before.
    since_start_ns: Option<u64>,
    lacks_stamps: bool,
    asc: asc::State,
    trc: trc::State,
}

impl TextReader {
    /// Creates a reader for this format.
    pub fn new(format: TextFormat) -> Self {
        Self { format, ..Self::default() }
    }

    /// Creates a reader for a file with this beginning. Stamps of `candump -td`, which state the time since the frame before, are
    /// added up.
    pub fn of(head: &[u8]) -> Self {
        let format = TextFormat::of(head).unwrap_or_default();
        let is_candump = format == TextFormat::Candump;
        let is_relative = is_candump && candump::has_relative_stamps(head);
        let lacks_stamps = is_candump && lacks_stamps(head);
        Self { since_start_ns: is_relative.then_some(0), lacks_stamps, ..Self::new(format) }
    }

    /// Returns true if the lines of a candump log have no stamps. The time of each frame is then 0.
    pub fn lacks_stamps(&self) -> bool {
        self.lacks_stamps
    }

    /// Returns true if the stamps of a candump log are added up.
    pub fn adds_up_stamps(&self) -> bool {
        self.since_start_ns.is_some()
    }

    /// Parses the next line, with or without its line end. Never panics for any input.
    #[inline]
    pub fn read<'a>(&mut self, line: &'a [u8]) -> Frames<'a> {
        match self.format {
            TextFormat::Candump if self.lacks_stamps => {
                candump::parse_unstamped(line).map_or(Frames::None, Frames::Line)
            }
            TextFormat::Candump => match candump::parse(line) {
                Ok(mut line) => {
                    if let Some(total_ns) = &mut self.since_start_ns {
                        *total_ns = total_ns.saturating_add(line.time_ns).min(MAX_TIME_NS);
                        line.time_ns = *total_ns;
                    }
                    Frames::Line(line)
                }
                Err(error) if line.trim_ascii_start().starts_with(b"(") => Frames::Bad(error),
                Err(_) => Frames::None,
            },
            TextFormat::Asc => asc::parse(line, &mut self.asc),
            TextFormat::Trc => trc::parse(line, &mut self.trc),
        }
    }
}

/// Writes lines in order.
#[derive(Clone, Copy, Debug, Default)]
pub struct TextWriter {
    format: TextFormat,
    lines: u64,
}

impl TextWriter {
    /// Creates a writer for this format.
    pub fn new(format: TextFormat) -> Self {
        Self { format, lines: 0 }
    }

    /// Appends a line. The first one is preceded by the header of the file.
    ///
    /// ASC and TRC have numbers instead of names of interfaces: every interface is channel 1. A CAN FD frame is padded
    /// to the next data length that its code can state. TRC has no error frame without its details, so none is written.
    pub fn emit(&mut self, line: &Line, fraction: Fraction, out: &mut Vec<u8>) {
        match self.format {
            TextFormat::Candump => candump::emit(line, fraction, out),
            TextFormat::Asc => {
                if self.lines == 0 {
                    out.extend_from_slice(asc::HEADER);
                }
                asc::emit(line, fraction, out);
            }
            TextFormat::Trc => {
                if matches!(line.frame, CanFrame::Error { .. }) {
                    return;
                }
                if self.lines == 0 {
                    out.extend_from_slice(trc::HEADER);
                }
                trc::emit(line, self.lines + 1, fraction, out);
            }
        }
        self.lines += 1;
    }

    /// Appends the end of the file.
    pub fn end(&self, out: &mut Vec<u8>) {
        if self.format == TextFormat::Asc && self.lines > 0 {
            out.extend_from_slice(asc::FOOTER);
        }
    }
}

#[cfg(test)]
mod tests;
