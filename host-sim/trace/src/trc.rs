//! PEAK's TRC: the trace file of PCAN-View and PCAN-Explorer, read and written.
//!
//! ```text
//! ;$FILEVERSION=2.1
//! ;$COLUMNS=N,O,T,B,I,d,R,L,D
//!       1         1.234 DT 1      0201 Rx -  8    00 00 80 3F 00 00 00 40
//!       2         2.234 FB 1      0381 Rx -  9    01 02 03 04 05 06 07 08 09 0A 0B 0C
//! ;$FILEVERSION=1.1
//!      1)         1.2  Rx         0201  8  00 00 80 3F 00 00 00 40
//! ```
//!
//! Times are in ms since the start. The version defines the columns of a line. From version 2.0 on, the file names them
//! with one letter each: N number, O time, T type, B bus, I identifier, d direction, R reserved, L length code or
//! l length in bytes, D data. An identifier of more than four digits has 29 bits.
//!
//! Types are DT (classic data), RR (remote), FD (CAN FD), FB (with BRS), FE (with ESI) and BI (with both). All others
//! (errors, states, events) are skipped. Source: PEAK-System, "PEAK CAN TRC File Format", versions 2.0 and 2.1.

use crate::fields::{
    self, Frames, emit_bytes, fraction_digits, length_code, nanoseconds, number, padded, payload,
    words,
};
use crate::frame::{CanFrame, Direction, ERROR_PASSIVE, Fraction, Line, LineError, SWITCHED_RATE};
use compensator_core::can::fd::LENGTHS;
use std::io::Write;

/// Columns of a line in order, as the letters of `$COLUMNS`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct State {
    columns: [u8; 12],
}

/// Columns of the versions whose files do not name them.
const VERSION_COLUMNS: [(&[u8], &[u8]); 4] =
    [(b"1.0", b"NOILD"), (b"1.1", b"NOdILD"), (b"1.2", b"NOBdILD"), (b"1.3", b"NOBdIRLD")];

impl Default for State {
    fn default() -> Self {
        Self::of(VERSION_COLUMNS[0].1)
    }
}

impl State {
    fn of(letters: &[u8]) -> Self {
        let mut columns = [0; 12];
        columns.iter_mut().zip(letters).for_each(|(to, from)| *to = *from);
        Self { columns }
    }
}

/// Returns true if a file with this beginning is in this format.
pub(crate) fn is_format_of(head: &[u8]) -> bool {
    let mut lines = head.split(|byte| *byte == b'\n').map(<[u8]>::trim_ascii);
    lines.find(|line| !line.is_empty()).is_some_and(|line| line.starts_with(b";$FILEVERSION="))
}

/// Parses a line.
pub(crate) fn parse<'a>(line: &'a [u8], state: &mut State) -> Frames<'a> {
    let line = line.trim_ascii();
    if let Some(version) = line.strip_prefix(b";$FILEVERSION=") {
        if let Some((_, letters)) =
            VERSION_COLUMNS.iter().find(|(of, _)| *of == version.trim_ascii())
        {
            *state = State::of(letters);
        }
        return Frames::None;
    }
    if let Some(letters) = line.strip_prefix(b";$COLUMNS=") {
        let letters: Vec<u8> = letters.iter().copied().filter(u8::is_ascii_alphabetic).collect();
        *state = State::of(&letters);
        return Frames::None;
    }
    if line.is_empty() || line.starts_with(b";") {
        return Frames::None;
    }
    frame(line, state).unwrap_or_else(Frames::Bad)
}

/// Kind of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Data,
    Remote,
    /// CAN FD with these flags.
    Flexible(u8),
}

/// Types of frames, as in column T.
const KINDS: [(&str, Kind); 6] = [
    ("DT", Kind::Data),
    ("RR", Kind::Remote),
    ("FD", Kind::Flexible(0)),
    ("FB", Kind::Flexible(SWITCHED_RATE)),
    ("FE", Kind::Flexible(ERROR_PASSIVE)),
    ("BI", Kind::Flexible(SWITCHED_RATE | ERROR_PASSIVE)),
];

fn frame<'a>(line: &'a [u8], state: &State) -> Result<Frames<'a>, LineError> {
    let mut words = words(line);
    let (mut time_ns, mut interface, mut direction) = (0, &b"1"[..], None);
    let (mut identifier, mut extended, mut length, mut kind) = (0, false, 0, Kind::Data);
    for column in state.columns.iter().take_while(|column| !matches!(column, 0 | b'D')) {
        let word = words.next().ok_or(LineError::Data)?;
        match column {
            b'O' => time_ns = nanoseconds(word, 1_000_000).ok_or(LineError::Time)?,
            b'B' => interface = word,
            b'T' => match KINDS.iter().find(|(of, _)| of.as_bytes() == word) {
                Some((_, of)) => kind = *of,
                // Errors, states, events.
                None => return Ok(Frames::None),
            },
            b'd' if word == b"Rx" => direction = Some(Direction::Received),
            b'd' if word == b"Tx" => direction = Some(Direction::Sent),
            b'd' => return Ok(Frames::None),
            // A warning of version 1.0.
            b'I' if word == b"FFFFFFFF" => return Ok(Frames::None),
            b'I' => {
                extended = word.len() > 4;
                identifier = fields::identifier(word, extended, 16)?;
            }
            b'L' => length = length_of_code(word, kind)?,
            b'l' => length = length_in_bytes(word, kind)?,
            _ => {}
        }
    }
    // Before version 2.0, the first word of the data marks other frames.
    match words.clone().next() {
        Some(b"RTR") if kind == Kind::Data => kind = Kind::Remote,
        Some(b"ERROR") if kind == Kind::Data => return Ok(Frames::None),
        _ => {}
    }
    let frame = match kind {
        Kind::Remote => CanFrame::Remote { identifier, extended, length },
        Kind::Data => {
            let bytes = payload(length, 16, &mut words)?;
            CanFrame::Data { identifier, extended, length, bytes }
        }
        Kind::Flexible(flags) => {
            let bytes = payload(length, 16, &mut words)?;
            CanFrame::Flexible { identifier, extended, flags, length, bytes }
        }
    };
    Ok(Frames::Line(Line { time_ns, interface, frame, direction }))
}

/// Returns the length that a length code states. Codes above 8 mean eight bytes in a classic frame.
fn length_of_code(word: &[u8], kind: Kind) -> Result<u8, LineError> {
    let code = number(word, 10).and_then(|code| LENGTHS.get(code as usize));
    let length = *code.ok_or(LineError::Length)?;
    Ok(if matches!(kind, Kind::Flexible(_)) { length } else { length.min(8) })
}

fn length_in_bytes(word: &[u8], kind: Kind) -> Result<u8, LineError> {
    let last = if matches!(kind, Kind::Flexible(_)) { 64 } else { 8 };
    let length = number(word, 10).and_then(|length| u8::try_from(length).ok());
    length.filter(|length| *length <= last && LENGTHS.contains(length)).ok_or(LineError::Length)
}

/// The header of a file.
pub(crate) const HEADER: &[u8] =
    b";$FILEVERSION=2.1\n;$STARTTIME=25569.0\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n;\n";

/// Appends the line with this number, for all frames but an error frame. Every interface is bus 1.
pub(crate) fn emit(line: &Line, number: u64, fraction: Fraction, out: &mut Vec<u8>) {
    let (kind, code, bytes) = match &line.frame {
        CanFrame::Data { .. } => (Kind::Data, line.frame.data().len(), line.frame.data()),
        CanFrame::Remote { length, .. } => (Kind::Remote, usize::from(*length), line.frame.data()),
        CanFrame::Flexible { flags, length, bytes, .. } => {
            let kind = Kind::Flexible(flags & (SWITCHED_RATE | ERROR_PASSIVE));
            (kind, length_code(*length), padded(bytes, *length))
        }
        CanFrame::Error { .. } => return,
    };
    let name = KINDS.iter().find(|(_, of)| *of == kind).map_or("DT", |(name, _)| name);
    let (milliseconds, rest) = (line.time_ns / 1_000_000, line.time_ns % 1_000_000);
    let (digits, rest) = fraction_digits(rest, fraction);
    let digits = digits - 3;
    let (identifier, extended) = line.frame.identifier();
    let wide = if extended { 8 } else { 4 };
    let identifier = format!("{identifier:0wide$X}");
    let direction = if line.direction == Some(Direction::Sent) { "Tx" } else { "Rx" };
    // Writing to memory does not fail.
    let _ = write!(
        out,
        "{number:7} {milliseconds:9}.{rest:0digits$} {name} 1  {identifier:>8} {direction} -  {code:<2}  "
    );
    emit_bytes(bytes, out);
    out.push(b'\n');
}
