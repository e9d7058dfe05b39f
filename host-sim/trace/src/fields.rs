//! Fields of the lines of ASC and TRC: numbers, identifiers, times and payloads, parsed and emitted.

use crate::frame::{Fraction, Line, LineError};
use compensator_core::can::fd::LENGTHS;
use std::io::Write;

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
