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
//! End TriggerBlock
//! ```
//!
//! The header states the base of the numbers. It also states whether a time counts from the start of the measurement or
//! from the previous event. CAN FD events and all other events (statistics, markers, variables) are skipped.

use crate::candump::{CanFrame, Direction, Fraction, Line};
use crate::text::{Frames, MAX_TIME_NS, data_frame, fraction_digits, nanoseconds, words};
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
    if !channel.iter().all(u8::is_ascii_digit) {
        return Frames::None;
    }
    let Some(identifier) = words.next() else { return Frames::None };
    if identifier.eq_ignore_ascii_case(b"ErrorFrame") {
        let frame = CanFrame::Error { class: 0, length: 0, bytes: [0; 8] };
        return Frames::Line(Line { time_ns, interface: channel, frame, direction: None });
    }
    let direction = match words.next() {
        Some(b"Rx") => Direction::Received,
        Some(b"Tx") => Direction::Sent,
        // TxRq, statistics, and other events with a channel.
        _ => return Frames::None,
    };
    let (digits, extended) = match identifier {
        [digits @ .., b'x' | b'X'] => (digits, true),
        digits => (digits, false),
    };
    let radix = if state.is_decimal { 10 } else { 16 };
    let frame = data_frame(digits, extended, radix, &mut words);
    match frame {
        Ok(frame) => {
            Frames::Line(Line { time_ns, interface: channel, frame, direction: Some(direction) })
        }
        Err(error) => Frames::Bad(error),
    }
}

/// Appends the header of the file.
pub(crate) fn emit_header(out: &mut Vec<u8>) {
    let lines: [&[u8]; 4] = [
        b"date Thu Jan 1 00:00:00.000 am 1970\n",
        b"base hex  timestamps absolute\n",
        b"internal events logged\n",
        b"Begin Triggerblock Thu Jan 1 00:00:00.000 am 1970\n",
    ];
    lines.iter().for_each(|line| out.extend_from_slice(line));
}

/// Appends the end of the file.
pub(crate) fn emit_footer(out: &mut Vec<u8>) {
    out.extend_from_slice(b"End TriggerBlock\n");
}

/// Appends a line. Only classic data frames are written. Every interface is channel 1.
pub(crate) fn emit(line: &Line, fraction: Fraction, out: &mut Vec<u8>) {
    let CanFrame::Data { identifier, extended, length, bytes } = line.frame else { return };
    let (seconds, rest) = (line.time_ns / 1_000_000_000, line.time_ns % 1_000_000_000);
    let (digits, rest) = fraction_digits(rest, fraction);
    let mark = if extended { "x" } else { "" };
    let name = format!("{identifier:X}{mark}");
    // Writing to memory does not fail.
    let _ = write!(out, "{seconds:4}.{rest:0digits$} 1  {name:<15} Rx   d {length}");
    for byte in bytes.iter().take(usize::from(length)) {
        let _ = write!(out, " {byte:02X}");
    }
    out.push(b'\n');
}
