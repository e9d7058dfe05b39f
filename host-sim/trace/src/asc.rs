//! Vector's ASC: the text log of CANalyzer and CANoe, read and written.
//!
//! ```text
//! date Wed May 1 12:00:00.000 pm 2024
//! base hex  timestamps absolute
//! Begin Triggerblock Wed May 1 12:00:00.000 pm 2024
//!    0.001234 1  201             Rx   d 8 00 00 80 3F 00 00 00 40
//!    0.001300 1  18FF1234x       Tx   d 2 01 02
//!    0.002000 1  123             Rx   r 8
//!    0.003000 1  ErrorFrame
//!    0.004000 CANFD   1 Rx        381  Telemetry   1 0 9 12 01 .. 0C   104812  132   323000 a800f6c9 ..
//! End TriggerBlock
//! ```
//!
//! The header states the base of the numbers. It also states whether a time counts from the start of the measurement or
//! from the previous event.
//!
//! An event `CANFD` has channel, direction, identifier, the name of the message if a database is loaded, BRS, ESI, length
//! code, length (always decimal), and the data. Duration, number of bits and flags follow. A controller that is configured
//! for CAN FD logs classic frames as such events too: the flag EDL (1000h) is absent then. A remote request has the flag
//! 10h, or a length code without data. All other events (statistics, markers, variables) are skipped.

use crate::fields::{
    self, Frames, MAX_TIME_NS, emit_bytes, fraction_digits, length_code, nanoseconds, number,
    padded, payload, words,
};
use crate::frame::{CanFrame, Direction, ERROR_PASSIVE, Fraction, Line, LineError, SWITCHED_RATE};
use compensator_core::can::fd::LENGTHS;
use std::io::Write;

/// Settings from the lines read so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct State {
    is_decimal: bool,
    is_relative: bool,
    time_ns: u64,
}

/// Returns true if a file with this beginning is in this format.
pub(crate) fn is_format_of(head: &[u8]) -> bool {
    let mut lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    lines
        .by_ref()
        .take(8)
        .any(|line| line.starts_with(b"base hex") || line.starts_with(b"base dec"))
}

/// Parses a line.
pub(crate) fn parse<'a>(line: &'a [u8], state: &mut State) -> Frames<'a> {
    let mut words = words(line);
    let first = words.next().unwrap_or_default();
    if first == b"base" {
        state.is_decimal = words.next() == Some(b"dec");
        state.is_relative = words.any(|word| word == b"relative");
        return Frames::None;
    }
    let (Some(time_ns), Some(channel)) = (nanoseconds(first, 1_000_000_000), words.next()) else {
        return Frames::None;
    };
    let time_ns = if state.is_relative {
        state.time_ns.saturating_add(time_ns).min(MAX_TIME_NS)
    } else {
        time_ns
    };
    state.time_ns = time_ns;
    let radix = if state.is_decimal { 10 } else { 16 };
    let is_flexible = channel.eq_ignore_ascii_case(b"CANFD");
    let interface = if is_flexible { words.next() } else { Some(channel) };
    let Some(interface) = interface.filter(|text| text.iter().all(u8::is_ascii_digit)) else {
        return Frames::None;
    };
    let event = if is_flexible { flexible(radix, &mut words) } else { classic(radix, &mut words) };
    match event {
        Some(Ok((frame, direction))) => Frames::Line(Line { time_ns, interface, frame, direction }),
        Some(Err(error)) => Frames::Bad(error),
        None => Frames::None,
    }
}

/// A frame and its direction; `None` for all other events.
type Event = Option<Result<(CanFrame, Option<Direction>), LineError>>;

/// Parses an event after its channel.
fn classic<'a>(radix: u32, words: &mut impl Iterator<Item = &'a [u8]>) -> Event {
    let identifier = words.next()?;
    if is_error(identifier) {
        return Some(Ok((ERROR, None)));
    }
    let direction = direction(words.next()?)?;
    Some(classic_frame(identifier, radix, words).map(|frame| (frame, Some(direction))))
}

/// Parses an event `CANFD` after its channel.
fn flexible<'a>(radix: u32, words: &mut impl Iterator<Item = &'a [u8]>) -> Event {
    let direction = direction(words.next()?)?;
    let identifier = words.next()?;
    let frame =
        if is_error(identifier) { Ok(ERROR) } else { flexible_frame(identifier, radix, words) };
    Some(frame.map(|frame| (frame, Some(direction))))
}

const ERROR: CanFrame = CanFrame::Error { class: 0, length: 0, bytes: [0; 8] };

fn is_error(word: &[u8]) -> bool {
    word.eq_ignore_ascii_case(b"ErrorFrame")
}

/// Returns the direction; `None` for a request to send, which is followed by its `Tx`.
fn direction(word: &[u8]) -> Option<Direction> {
    match word {
        b"Rx" => Some(Direction::Received),
        b"Tx" => Some(Direction::Sent),
        _ => None,
    }
}

/// Parses an identifier and whether it has 29 bits.
fn identifier(word: &[u8], radix: u32) -> Result<(u32, bool), LineError> {
    let (digits, extended) = match word {
        [digits @ .., b'x' | b'X'] => (digits, true),
        digits => (digits, false),
    };
    Ok((fields::identifier(digits, extended, radix)?, extended))
}

/// Parses a frame after its direction: `d` or `r`, the length, the bytes.
fn classic_frame<'a>(
    identifier: &[u8],
    radix: u32,
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<CanFrame, LineError> {
    let (identifier, extended) = self::identifier(identifier, radix)?;
    let kind = words.next().ok_or(LineError::Data)?;
    let length = words.next().map_or(Some(0), |text| number(text, radix));
    let length = length.filter(|length| *length <= 8).ok_or(LineError::Length)? as u8;
    match kind {
        b"r" => Ok(CanFrame::Remote { identifier, extended, length }),
        b"d" => {
            let bytes = payload(length, radix, words)?;
            Ok(CanFrame::Data { identifier, extended, length, bytes })
        }
        _ => Err(LineError::Data),
    }
}

/// Flags of an event `CANFD`.
const REMOTE_FLAG: u32 = 0x10;
const EDL_FLAG: u32 = 0x1000;
const BRS_FLAG: u32 = 0x2000;
const ESI_FLAG: u32 = 0x4000;

/// Parses a frame of an event `CANFD` after its direction.
fn flexible_frame<'a>(
    identifier: &[u8],
    radix: u32,
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<CanFrame, LineError> {
    let (identifier, extended) = self::identifier(identifier, radix)?;
    let bit = |word: Option<&[u8]>| match word {
        Some(b"0") => Some(false),
        Some(b"1") => Some(true),
        _ => None,
    };
    // The name of a message is no digit.
    let switched = bit(words.next()).or_else(|| bit(words.next())).ok_or(LineError::Data)?;
    let passive = bit(words.next()).ok_or(LineError::Data)?;
    let mut next = |radix| words.next().and_then(|word| number(word, radix));
    let code = next(radix).filter(|code| *code < 16).ok_or(LineError::Length)? as u8;
    let length = next(10).and_then(|length| u8::try_from(length).ok());
    let length = length.filter(|length| LENGTHS.contains(length)).ok_or(LineError::Length)?;
    let long: [u8; 64] = payload(length, radix, words)?;
    // After the duration and the number of bits.
    let event_flags = words.nth(2).and_then(|word| number(word, 16));
    if length == 0 && (code > 0 || event_flags.is_some_and(|flags| flags & REMOTE_FLAG != 0)) {
        return Ok(CanFrame::Remote { identifier, extended, length: code.min(8) });
    }
    let is_classic = event_flags.is_some_and(|flags| flags & EDL_FLAG == 0) && !switched;
    if let (true, Some(bytes)) = (is_classic && length <= 8, long.first_chunk()) {
        return Ok(CanFrame::Data { identifier, extended, length, bytes: *bytes });
    }
    let flags = if switched { SWITCHED_RATE } else { 0 } | if passive { ERROR_PASSIVE } else { 0 };
    Ok(CanFrame::Flexible { identifier, extended, flags, length, bytes: long })
}

/// The header of a file.
pub(crate) const HEADER: &[u8] =
    b"date Thu Jan 1 00:00:00.000 am 1970\nbase hex  timestamps absolute\n\
    internal events logged\nBegin Triggerblock Thu Jan 1 00:00:00.000 am 1970\n";

/// The end of a file.
pub(crate) const FOOTER: &[u8] = b"End TriggerBlock\n";

/// Appends a line. Every interface is channel 1.
pub(crate) fn emit(line: &Line, fraction: Fraction, out: &mut Vec<u8>) {
    let (seconds, rest) = (line.time_ns / 1_000_000_000, line.time_ns % 1_000_000_000);
    let (digits, rest) = fraction_digits(rest, fraction);
    let direction = if line.direction == Some(Direction::Sent) { "Tx" } else { "Rx" };
    let (identifier, extended) = line.frame.identifier();
    let name = format!("{identifier:X}{}", if extended { "x" } else { "" });
    // Writing to memory does not fail.
    let _ = write!(out, "{seconds:4}.{rest:0digits$} ");
    match &line.frame {
        CanFrame::Data { length, bytes, .. } => {
            let _ = write!(out, "1  {name:<15} {direction}   d {length}");
            emit_bytes(bytes.get(..usize::from(*length)).unwrap_or(bytes), out);
        }
        CanFrame::Remote { length, .. } => {
            let _ = write!(out, "1  {name:<15} {direction}   r {length}");
        }
        CanFrame::Flexible { flags, length, bytes, .. } => {
            let (brs, esi) = (flags & SWITCHED_RATE != 0, flags & ERROR_PASSIVE != 0);
            let flag = |is_set, flag| if is_set { flag } else { 0 };
            let flags = EDL_FLAG | flag(brs, BRS_FLAG) | flag(esi, ESI_FLAG);
            let (code, bytes) = (length_code(*length), padded(bytes, *length));
            let (brs, esi, length) = (u8::from(brs), u8::from(esi), bytes.len());
            // The name of the message is left out.
            let _ = write!(out, "CANFD   1 {direction}   {name:>8}  {:32} ", "");
            let _ = write!(out, "{brs} {esi} {code:x} {length:>2}");
            emit_bytes(bytes, out);
            // Duration, bits, flags, checksum, and four words of bit timing.
            let _ = write!(out, " {0:>8} {0:>4} {flags:>8X}", 0);
            out.extend_from_slice(b"        0        0        0        0        0");
        }
        CanFrame::Error { .. } => out.extend_from_slice(b"1  ErrorFrame"),
    }
    out.push(b'\n');
}
