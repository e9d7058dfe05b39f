//! The lines of a `candump -L` log, read and written.
//!
//! ```text
//! (1436509052.249713) vcan0 044#2A366C2BBA        data, 11-bit identifier
//! (1436509052.249713123) can0 0000F12A#.11.22 T   29 bits, nanoseconds, dots, sent (candump -x)
//! (0000000001.000000) can0 123#R4                 remote request of four bytes
//! (0000000001.000000) can0 123#1122334455667788_E raw length code 14 of eight bytes
//! (0000000001.000000) can0 123##5112233           CAN FD, flags 5
//! (0000000001.000000) can0 20000004#000C000000000000   error frame
//! ```
//!
//! The module `view` reads the lines of candump without `-L`. A stamp may be a date (`-tA`).
//!
//! The grammar is that of can-utils (`lib.h`, `candump.c`). The parser reads bytes without copies, because logs have
//! millions of lines. The parser of the `socketcan` crate is not used: it reads microseconds only, allocates for each
//! line, and depends on the socket code.

mod view;

use crate::fields::fraction_digits;
use crate::frame::{CanFrame, Direction, Fraction, Line, LineError, MAX_FD_BYTES};
use chrono::NaiveDate;
use std::io::Write;
pub(crate) use view::parse_unstamped;

/// Flag of an error frame in an identifier of eight digits.
const ERROR_FLAG: u32 = 0x2000_0000;
const MAX_EXTENDED_IDENTIFIER: u32 = 0x1FFF_FFFF;
const MAX_STANDARD_IDENTIFIER: u32 = 0x7FF;

/// Maximum time stamp, s: the range of nanoseconds in 64 bits, rounded down.
const MAX_TIME_S: u64 = 18_000_000_000;

/// Length of the beginning of a log in which its stamps are judged, bytes.
const JUDGED_BYTES: usize = 64 * 1024;

/// Minimum number of frames there for a decision.
const MIN_JUDGED_FRAMES: usize = 20;

/// Minimum share of stamps that are before the stamp above. The frames of a log with one clock are in order.
const MIN_BACKWARD_SHARE: f64 = 0.05;

/// Maximum median of the times between frames, ns.
const MAX_MEDIAN_STEP_NS: u64 = 100_000_000;

/// Value of each hexadecimal digit; [`NO_DIGIT`] for all other bytes.
const DIGITS: [u8; 256] = {
    let mut table = [NO_DIGIT; 256];
    let mut digit = 0;
    while digit < 16 {
        table[b"0123456789ABCDEF"[digit] as usize] = digit as u8;
        table[b"0123456789abcdef"[digit] as usize] = digit as u8;
        digit += 1;
    }
    table
};
const NO_DIGIT: u8 = 0xFF;

/// Parses a line, with or without its line end.
///
/// # Errors
/// Returns the malformed part. Never panics for any input.
#[inline]
pub fn parse(line: &[u8]) -> Result<Line<'_>, LineError> {
    let line = line.trim_ascii();
    let (time_ns, rest) = stamp(line).ok_or(LineError::Time)?;
    let (interface, rest) = word(rest).ok_or(LineError::Interface)?;
    let (text, after) = word(rest).ok_or(LineError::Identifier)?;
    if !text.contains(&b'#') {
        return view::parse(rest).map(|frame| Line { time_ns, interface, ..frame });
    }
    let direction = match after.trim_ascii_start() {
        [] => None,
        [b'R' | b'r'] => Some(Direction::Received),
        [b'T' | b't'] => Some(Direction::Sent),
        _ => return Err(LineError::Direction),
    };
    Ok(Line { time_ns, interface, frame: frame(text)?, direction })
}

/// Returns true if the stamps of a log with this beginning are the times since the frame before, as `candump -td` writes
/// them: they fall back again and again, and the last of them are no larger than the first.
pub(crate) fn has_relative_stamps(head: &[u8]) -> bool {
    let head = &head[..head.len().min(JUDGED_BYTES)];
    let lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    let stamps: Vec<u64> = lines.filter_map(|line| Some(stamp(line)?.0)).collect();
    let backward = stamps.windows(2).filter(|pair| pair[1] < pair[0]).count();
    if stamps.len() < MIN_JUDGED_FRAMES
        || (backward as f64) < MIN_BACKWARD_SHARE * stamps.len() as f64
    {
        return false;
    }
    let least_late = stamps[stamps.len() / 3 * 2..].iter().min().copied().unwrap_or_default();
    let mut sorted = stamps;
    sorted.sort_unstable();
    let median = sorted[sorted.len() / 2];
    least_late <= median && median <= MAX_MEDIAN_STEP_NS
}

/// Returns the time stamp in ns and the rest of the line.
#[inline]
fn stamp(line: &[u8]) -> Option<(u64, &[u8])> {
    let mut rest = line.strip_prefix(b"(")?;
    // Fast path for the fixed-width form that candump writes.
    if let Some((text, after)) = rest.split_first_chunk::<18>()
        && (text[10], text[17]) == (b'.', b')')
        && let (Some(seconds), Some(fraction)) = (decimals(&text[..10]), decimals(&text[11..17]))
    {
        return Some((seconds * 1_000_000_000 + fraction * 1000, after));
    }
    let mut number = |most: usize| {
        let (mut value, mut digits) = (0u64, 0);
        while let [digit @ b'0'..=b'9', after @ ..] = rest {
            if digits == most {
                return None;
            }
            value = value * 10 + u64::from(digit - b'0');
            digits += 1;
            rest = after;
        }
        let (end, after) = rest.split_first()?;
        rest = after;
        (digits > 0).then_some((value, digits, *end))
    };
    let (mut seconds, _, mut point) = number(12)?;
    if point == b'-' {
        let mut part = |end: u8| number(2).filter(|of| of.2 == end).map(|of| of.0 as u32);
        let (month, day) = (part(b'-')?, part(b' ')?);
        let (hour, minute, second) = (part(b':')?, part(b':')?, part(b'.')?);
        let date = NaiveDate::from_ymd_opt(i32::try_from(seconds).ok()?, month, day)?;
        let time = date.and_hms_opt(hour, minute, second)?.and_utc().timestamp();
        (seconds, point) = (u64::try_from(time).ok()?, b'.');
    }
    let (fraction, digits, close) = number(9)?;
    if point != b'.' || close != b')' || seconds >= MAX_TIME_S {
        return None;
    }
    const UNITS: [u64; 10] =
        [0, 100_000_000, 10_000_000, 1_000_000, 100_000, 10_000, 1000, 100, 10, 1];
    Some((seconds * 1_000_000_000 + fraction * UNITS[digits], rest))
}

/// Returns the decimal number, or `None` if a byte is not a digit.
#[inline(always)]
fn decimals(text: &[u8]) -> Option<u64> {
    let (mut value, mut largest) = (0u64, 0u8);
    for byte in text {
        let digit = byte.wrapping_sub(b'0');
        largest = largest.max(digit);
        value = value * 10 + u64::from(digit);
    }
    (largest <= 9).then_some(value)
}

/// Returns the next word, which must follow a blank, and the rest.
#[inline]
fn word(text: &[u8]) -> Option<(&[u8], &[u8])> {
    let start = text.trim_ascii_start();
    let length = start.iter().position(|byte| *byte == b' ').unwrap_or(start.len());
    (length > 0 && start.len() < text.len()).then(|| start.split_at(length))
}

#[inline]
fn frame(text: &[u8]) -> Result<CanFrame, LineError> {
    let (identifier, extended, data) = match text {
        [a, b, c, b'#', data @ ..] => (hexadecimal(&[*a, *b, *c]), false, data),
        [a, b, c, d, e, f, g, h, b'#', data @ ..] => {
            (hexadecimal(&[*a, *b, *c, *d, *e, *f, *g, *h]), true, data)
        }
        _ => return Err(LineError::Identifier),
    };
    let (identifier, is_error) = checked(identifier, extended)?;
    match data {
        [b'R' | b'r', length @ ..] if !is_error => {
            let (length, code) = match length {
                [digit @ b'0'..=b'8', code @ ..] => (digit - b'0', code),
                code => (0, code),
            };
            raw_length(code, length)?;
            Ok(CanFrame::Remote { identifier, extended, length })
        }
        [b'#', flags, data @ ..] if !is_error => {
            let flags = DIGITS[usize::from(*flags)];
            let mut bytes = [0; MAX_FD_BYTES];
            let (length, rest) = payload(data, &mut bytes).ok_or(LineError::Data)?;
            if flags == NO_DIGIT || !rest.is_empty() {
                return Err(LineError::Data);
            }
            Ok(CanFrame::Flexible { identifier, extended, flags, length, bytes })
        }
        data => {
            let mut bytes = [0; 8];
            let (length, rest) = payload(data, &mut bytes).ok_or(LineError::Data)?;
            raw_length(rest, length)?;
            Ok(if is_error {
                CanFrame::Error { class: identifier & MAX_EXTENDED_IDENTIFIER, length, bytes }
            } else {
                CanFrame::Data { identifier, extended, length, bytes }
            })
        }
    }
}

/// Returns an identifier, and whether it is that of an error frame.
#[inline]
fn checked(identifier: Option<u32>, extended: bool) -> Result<(u32, bool), LineError> {
    let identifier = identifier.ok_or(LineError::Identifier)?;
    let is_error = extended && identifier & ERROR_FLAG != 0;
    let last = if extended { MAX_EXTENDED_IDENTIFIER } else { MAX_STANDARD_IDENTIFIER };
    if !is_error && identifier > last {
        return Err(LineError::Identifier);
    }
    Ok((identifier, is_error))
}

#[inline]
fn hexadecimal(digits: &[u8]) -> Option<u32> {
    let (mut value, mut wrong) = (0u32, 0);
    for digit in digits {
        let digit = DIGITS[usize::from(*digit)];
        wrong |= digit;
        value = value << 4 | u32::from(digit & 0xF);
    }
    (wrong != NO_DIGIT).then_some(value)
}

/// Parses bytes of two digits each, with an optional dot before each. Returns their number and the rest.
#[inline]
fn payload<'a>(text: &'a [u8], bytes: &mut [u8]) -> Option<(u8, &'a [u8])> {
    // Fast path: eight bytes without dots, the form of nearly every frame.
    if let (Some((digits, rest)), Ok(eight)) =
        (text.split_first_chunk::<16>(), <&mut [u8; 8]>::try_from(&mut *bytes))
    {
        let mut wrong = 0;
        for (byte, pair) in eight.iter_mut().zip(digits.as_chunks::<2>().0) {
            let [high, low] = pair.map(|digit| DIGITS[usize::from(digit)]);
            wrong |= high | low;
            *byte = high << 4 | low & 0xF;
        }
        if wrong != NO_DIGIT {
            return Some((8, rest));
        }
        *eight = [0; 8];
    }
    let (mut rest, mut length) = (text, 0u8);
    for byte in bytes {
        if let [b'.', after @ ..] = rest {
            rest = after;
        }
        let [high, low, after @ ..] = rest else { break };
        let (high, low) = (DIGITS[usize::from(*high)], DIGITS[usize::from(*low)]);
        if high == NO_DIGIT {
            break;
        }
        if low == NO_DIGIT {
            return None;
        }
        *byte = high << 4 | low;
        length += 1;
        rest = after;
    }
    Some((length, rest))
}

/// Accepts an empty text or the raw length code of eight bytes, such as `_E`.
#[inline]
fn raw_length(text: &[u8], length: u8) -> Result<(), LineError> {
    match text {
        [] => Ok(()),
        [b'_', b'9' | b'A'..=b'F' | b'a'..=b'f'] if length == 8 => Ok(()),
        _ => Err(LineError::Data),
    }
}

/// Appends the line and its line end in the form of candump. A raw length code is not written.
pub fn emit(line: &Line, fraction: Fraction, out: &mut Vec<u8>) {
    let (seconds, rest) = (line.time_ns / 1_000_000_000, line.time_ns % 1_000_000_000);
    let (digits, rest) = fraction_digits(rest, fraction);
    let (identifier, extended) = line.frame.identifier();
    let width = if extended { 8 } else { 3 };
    let is_error = matches!(line.frame, CanFrame::Error { .. });
    let identifier = if is_error { identifier | ERROR_FLAG } else { identifier };
    // Writing to memory does not fail.
    let _ = write!(out, "({seconds:010}.{rest:0digits$}) ");
    out.extend_from_slice(line.interface);
    let _ = write!(out, " {identifier:0width$X}#");
    let _ = match &line.frame {
        CanFrame::Remote { length: 0, .. } => write!(out, "R"),
        CanFrame::Remote { length, .. } => write!(out, "R{length:X}"),
        CanFrame::Flexible { flags, .. } => write!(out, "#{:X}", flags & 0xF),
        CanFrame::Data { .. } | CanFrame::Error { .. } => Ok(()),
    };
    for byte in line.frame.data() {
        let _ = write!(out, "{byte:02X}");
    }
    out.extend_from_slice(match line.direction {
        Some(Direction::Received) => b" R\n",
        Some(Direction::Sent) => b" T\n",
        None => b"\n",
    });
}

#[cfg(test)]
mod tests;
