//! PEAK's TRC: the trace file of PCAN-View and PCAN-Explorer, read and written.
//!
//! ```text
//! ;$FILEVERSION=2.1
//! ;$COLUMNS=N,O,T,B,I,d,R,L,D
//!       1         1.234 DT 1      0201 Rx -  8    00 00 80 3F 00 00 00 40
//! ;$FILEVERSION=1.1
//!      1)         1.2  Rx         0201  8  00 00 80 3F 00 00 00 40
//! ```
//!
//! Times are in ms since the start. The version defines the columns of a line. From version 2.0 on, the file names them
//! with one letter each: N number, O time, T type (DT data, RR remote), B bus, I identifier, d direction, R reserved,
//! L or l length, D data. An identifier of more than four digits has 29 bits.

use crate::candump::{CanFrame, Direction, Fraction, Line, LineError};
use crate::text::{Frames, fraction_digits, nanoseconds, payload, words};
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

fn frame<'a>(line: &'a [u8], state: &State) -> Result<Frames<'a>, LineError> {
    let mut words = words(line);
    let mut next = || words.next().ok_or(LineError::Data);
    let (mut time_ns, mut interface, mut direction) = (0, &b"1"[..], None);
    let (mut identifier, mut extended, mut length, mut remote) = (0, false, 0u8, false);
    for column in state.columns.iter().take_while(|column| **column != 0) {
        if *column == b'D' {
            break;
        }
        let word = next()?;
        match column {
            b'O' => time_ns = nanoseconds(word, 1_000_000).ok_or(LineError::Time)?,
            b'B' => interface = word,
            b'T' if word == b"RR" => remote = true,
            b'T' if word == b"DT" => {}
            // CAN FD, error counters, events.
            b'T' => return Ok(Frames::None),
            b'd' if word == b"Rx" => direction = Some(Direction::Received),
            b'd' if word == b"Tx" => direction = Some(Direction::Sent),
            b'd' => return Ok(Frames::None),
            b'I' => {
                extended = word.len() > 4;
                let text = std::str::from_utf8(word).map_err(|_| LineError::Identifier)?;
                identifier = u32::from_str_radix(text, 16).map_err(|_| LineError::Identifier)?;
            }
            b'L' | b'l' => {
                let text = std::str::from_utf8(word).map_err(|_| LineError::Data)?;
                length = text.parse().ok().filter(|of| *of <= 8).ok_or(LineError::Data)?;
            }
            _ => {}
        }
    }
    let last = if extended { 0x1FFF_FFFF } else { 0x7FF };
    if identifier > last {
        return Err(LineError::Identifier);
    }
    let is_remote = |word: Option<&[u8]>| word == Some(b"RTR");
    let frame = if remote || is_remote(words.clone().next()) {
        CanFrame::Remote { identifier, extended, length }
    } else {
        CanFrame::Data { identifier, extended, length, bytes: payload(length, &mut words)? }
    };
    Ok(Frames::Line(Line { time_ns, interface, frame, direction }))
}

/// Appends the header of the file.
pub(crate) fn emit_header(out: &mut Vec<u8>) {
    let lines: [&[u8]; 4] = [
        b";$FILEVERSION=2.1\n",
        b";$STARTTIME=25569.0\n",
        b";$COLUMNS=N,O,T,B,I,d,R,L,D\n",
        b";\n",
    ];
    lines.iter().for_each(|line| out.extend_from_slice(line));
}

/// Appends the line with this number. Only classic data frames are written. Every interface is bus 1.
pub(crate) fn emit(line: &Line, number: u64, fraction: Fraction, out: &mut Vec<u8>) {
    let CanFrame::Data { identifier, extended, length, bytes } = line.frame else { return };
    let (milliseconds, rest) = (line.time_ns / 1_000_000, line.time_ns % 1_000_000);
    let (digits, rest) = fraction_digits(rest, fraction);
    let digits = digits - 3;
    let wide = if extended { 8 } else { 4 };
    // Writing to memory does not fail.
    let _ = write!(
        out,
        "{number:7} {milliseconds:9}.{rest:0digits$} DT 1  {:>8} Rx -  {length}   ",
        format!("{identifier:0wide$X}")
    );
    for byte in bytes.iter().take(usize::from(length)) {
        let _ = write!(out, " {byte:02X}");
    }
    out.push(b'\n');
}
