//! The text formats of CAN logs: detection of the format, and lines to frames.
//!
//! A line of [`candump`] is complete by itself. The formats of Vector and PEAK have headers that define the following
//! lines, so a [`TextReader`] keeps these settings.

use crate::candump::{self, CanFrame, Fraction, Line, LineError};
use crate::{asc, trc};
use compensator_core::can::fd::LENGTHS;
use std::io::Write;

/// A text format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextFormat {
    /// `candump -L`.
    #[default]
    Candump,
    /// Vector's ASC.
    Asc,
    /// PEAK's TRC.
    Trc,
}

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
        is_candump.then_some(Self::Candump)
    }

    /// Returns the file name extension.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Candump => "log",
            Self::Asc => "asc",
            Self::Trc => "trc",
        }
    }
}

/// The content of a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Frames<'a> {
    /// A frame.
    Line(Line<'a>),
    /// No frame: a comment, a setting, or another event.
    None,
    /// A malformed frame.
    Bad(LineError),
}

/// Reads the lines of a file in order.
#[derive(Clone, Copy, Debug, Default)]
pub struct TextReader {
    format: TextFormat,
    asc: asc::State,
    trc: trc::State,
}

impl TextReader {
    /// Creates a reader for this format.
    pub fn new(format: TextFormat) -> Self {
        Self { format, ..Self::default() }
    }

    /// Parses the next line, with or without its line end. Never panics for any input.
    #[inline]
    pub fn read<'a>(&mut self, line: &'a [u8]) -> Frames<'a> {
        match self.format {
            TextFormat::Candump => match candump::parse(line) {
                Ok(line) => Frames::Line(line),
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
                    asc::emit_header(out);
                }
                asc::emit(line, fraction, out);
            }
            TextFormat::Trc => {
                if matches!(line.frame, CanFrame::Error { .. }) {
                    return;
                }
                if self.lines == 0 {
                    trc::emit_header(out);
                }
                trc::emit(line, self.lines + 1, fraction, out);
            }
        }
        self.lines += 1;
    }

    /// Appends the end of the file.
    pub fn end(&self, out: &mut Vec<u8>) {
        if self.format == TextFormat::Asc && self.lines > 0 {
            asc::emit_footer(out);
        }
    }
}

/// Splits a line into words.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> + Clone {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}

/// Maximum time stamp, ns; the same range as in candump logs.
pub(crate) const MAX_TIME_NS: u64 = 17_999_999_999_999_999_999;

/// Parses a decimal number in units of `unit_ns`. Returns ns.
pub(crate) fn nanoseconds(text: &[u8], unit_ns: u64) -> Option<u64> {
    let text = std::str::from_utf8(text).ok()?;
    let (whole, fraction) = text.split_once('.').unwrap_or((text, ""));
    let digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    if whole.is_empty() || whole.len() > 14 || !digits(whole) || !digits(fraction) {
        return None;
    }
    let mut time = whole.parse::<u64>().ok()?.checked_mul(unit_ns)?;
    let mut place = unit_ns;
    for digit in fraction.bytes() {
        place /= 10;
        time = time.checked_add(u64::from(digit - b'0') * place)?;
    }
    (time <= MAX_TIME_NS).then_some(time)
}

/// Returns the number of digits of a fraction of a second, and the fraction in that resolution.
pub(crate) fn fraction_digits(nanoseconds: u64, fraction: Fraction) -> (usize, u64) {
    match fraction {
        Fraction::Microseconds => (6, nanoseconds / 1000),
        Fraction::Nanoseconds => (9, nanoseconds),
    }
}

/// Parses a number.
pub(crate) fn number(text: &[u8], radix: u32) -> Option<u32> {
    std::str::from_utf8(text).ok().and_then(|text| u32::from_str_radix(text, radix).ok())
}

/// Parses an identifier of 11 or 29 bits.
pub(crate) fn identifier(text: &[u8], extended: bool, radix: u32) -> Result<u32, LineError> {
    let last = if extended { 0x1FFF_FFFF } else { 0x7FF };
    number(text, radix).filter(|id| *id <= last).ok_or(LineError::Identifier)
}

/// Returns the length code of CAN FD for a number of bytes; for a length without a code, that of the next one.
pub(crate) fn length_code(bytes: u8) -> usize {
    LENGTHS.iter().position(|length| bytes <= *length).unwrap_or(LENGTHS.len() - 1)
}

/// Returns the data of a CAN FD frame, padded with 0 to the next length that has a code.
pub(crate) fn padded(bytes: &[u8; 64], length: u8) -> &[u8] {
    bytes.get(..usize::from(LENGTHS[length_code(length)])).unwrap_or(bytes)
}

/// Parses `length` bytes, each a word.
pub(crate) fn payload<'a, const N: usize>(
    length: u8,
    radix: u32,
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<[u8; N], LineError> {
    let mut bytes = [0; N];
    let places = bytes.get_mut(..usize::from(length)).ok_or(LineError::Length)?;
    for byte in places {
        let number = words.next().and_then(|word| number(word, radix));
        *byte = number.and_then(|number| u8::try_from(number).ok()).ok_or(LineError::Data)?;
    }
    Ok(bytes)
}

/// Appends the bytes in hexadecimal, each after a blank.
pub(crate) fn emit_bytes(bytes: &[u8], out: &mut Vec<u8>) {
    for byte in bytes {
        // Writing to memory does not fail.
        let _ = write!(out, " {byte:02X}");
    }
}

#[cfg(test)]
mod tests;
