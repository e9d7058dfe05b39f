//! The lines of `candump` without `-L`, read: the view that it shows by default.
//!
//! ```text
//! (1436509053.850870)  can0  123   [3]  11 22 33            '."3'    stamp (candump -ta), text (-a)
//! (2026-11-30 10:11:12.123456)  can0  RX B -  123  [08]  11 22 ..    date (-tA), direction and flags (-x), CAN FD
//! (000.001000)  can0  12345678   [4]  remote request                 time since the frame before (-td)
//! (000.001000)  can0  20000004   [8]  00 0C 00 00 00 00 00 00   ERRORFRAME
//!   can0  123   {E}  11 22 33 44 55 66 77 88                         no stamp, raw length code (-8)
//! ```
//!
//! Data are also in binary digits (`-i`), or in reverse order with "`" between the bytes (`-S`).

use super::{checked, hexadecimal, word};
use crate::fields::{number, payload, words};
use crate::frame::{CanFrame, Direction, ERROR_PASSIVE, Line, LineError, SWITCHED_RATE};

/// Parses a line without a stamp. Its time is 0.
///
/// # Errors
/// As [`parse`].
pub(crate) fn parse_unstamped(line: &[u8]) -> Result<Line<'_>, LineError> {
    let line = line.trim_ascii();
    let (interface, rest) = line.split_at(line.iter().position(|byte| *byte == b' ').unwrap_or(0));
    if interface.is_empty() || interface[0] == b'(' {
        return Err(LineError::Interface);
    }
    parse(rest).map(|frame| Line { interface, ..frame })
}

/// Parses what follows the interface.
///
/// # Errors
/// Returns the malformed part. Never panics for any input.
pub(super) fn parse(text: &[u8]) -> Result<Line<'_>, LineError> {
    let (direction, flags, text) = direction(text);
    let (name, text) = word(text).ok_or(LineError::Identifier)?;
    let extended = name.len() == 8;
    let identifier = hexadecimal(name).filter(|_| extended || name.len() == 3);
    let (identifier, is_error) = checked(identifier, extended)?;
    // The form of candump -L has no length, and more users know it.
    let (length, text) = word(text).ok_or(LineError::Identifier)?;
    let (length, is_fd) = match length {
        [b'[', digits @ .., b']'] => (number(digits, 10), digits.len() == 2),
        [b'{', b'9' | b'A'..=b'F', b'}'] => (Some(8), false),
        _ => return Err(LineError::Identifier),
    };
    let length = length.and_then(|length| u8::try_from(length).ok()).ok_or(LineError::Length)?;
    let frame = if is_error && !is_fd {
        let class = identifier & super::MAX_EXTENDED_IDENTIFIER;
        CanFrame::Error { class, length, bytes: data(length, text)? }
    } else if is_error {
        return Err(LineError::Length);
    } else if is_fd {
        let bytes = data(length, text)?;
        CanFrame::Flexible { identifier, extended, flags, length, bytes }
    } else if words(text).next() == Some(b"remote") && length <= 8 {
        CanFrame::Remote { identifier, extended, length }
    } else {
        CanFrame::Data { identifier, extended, length, bytes: data(length, text)? }
    };
    Ok(Line { time_ns: 0, interface: &[], frame, direction })
}

/// Returns the direction, the flags of CAN FD and the rest. Without `-x`, the rest is the whole text.
fn direction(text: &[u8]) -> (Option<Direction>, u8, &[u8]) {
    let direction = match word(text) {
        Some((b"RX", _)) => Direction::Received,
        Some((b"TX", _)) => Direction::Sent,
        _ => return (None, 0, text),
    };
    let (mut rest, mut flags) = (text, 0);
    for flag in [(b"", 0), (b"B", SWITCHED_RATE), (b"E", ERROR_PASSIVE)] as [(&[u8], u8); 3] {
        let Some((found, after)) = word(rest) else { break };
        flags |= if found == flag.0 { flag.1 } else { 0 };
        rest = after;
    }
    (Some(direction), flags, rest)
}

/// Parses the data of a frame. What follows them is a text.
fn data<const N: usize>(length: u8, text: &[u8]) -> Result<[u8; N], LineError> {
    const SWAPPED: u8 = b'`';
    let is_swapped = words(text).next().is_some_and(|first| first.contains(&SWAPPED));
    let mut bytes = words(text).flat_map(|word| word.split(|byte| *byte == SWAPPED));
    let is_binary = bytes.clone().next().is_some_and(|first| first.len() == 8);
    let mut bytes = payload(length, if is_binary { 2 } else { 16 }, &mut bytes)?;
    if is_swapped && let Some(data) = bytes.get_mut(..usize::from(length)) {
        data.reverse();
    }
    Ok(bytes)
}
