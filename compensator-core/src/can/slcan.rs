//! slcan: CAN frames as lines of text on a serial line, used by USB adapters and by the emulated board.
//!
//! ```text
//! t20180011223344556677\r   classic data, 11 bits: identifier 201, eight bytes; T with 29 bits
//! r2014\r                   remote request of four bytes; R with 29 bits
//! d2019..\r  b2019..\r      CAN FD, the length a code (9 is twelve bytes); b with the rate switched
//! S8\r O\r L\r C\r          bit rate 1 Mbit/s, open, open to listen, close
//! V\r N\r F\r Z1\r Y2\r     version, serial number, status, stamps, data rate of CAN FD
//! \r  z\r  Z\r  \a          answers: done, sent (11, 29 bits), refused
//! ```
//!
//! A data frame may end with a time stamp of four digits, milliseconds within a minute. [`LineSplitter`] splits
//! bytes into lines. [`parse`] parses a line; the data bytes are decoded on access. [`Adapter`] answers as a
//! device does. [`emit`] writes lines. No input causes a panic.

mod adapter;
mod splitter;

pub use adapter::{Adapter, AdapterReply};
pub use splitter::{LinePiece, LineSplitter};

use super::Frame;
use super::fd::LENGTHS;
use core::fmt;

/// Maximum length of a line without its end, bytes: CAN FD, 29 bits, 64 data bytes, a time stamp.
pub const MAX_LINE_BYTES: usize = 1 + 8 + 1 + 128 + 4;
/// Maximum length of a line of a classic frame without its end, bytes.
pub const MAX_CLASSIC_LINE_BYTES: usize = 1 + 8 + 1 + 16 + 4;

/// End of a line. As an answer on its own it means success.
pub const DONE: u8 = b'\r';
/// Answer that means an error (BELL).
pub const REFUSED: u8 = 7;

const LAST_STANDARD: u32 = 0x7FF;
const LAST_EXTENDED: u32 = 0x1FFF_FFFF;

/// Kind of the frame in a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameKind {
    /// Classic data.
    Data,
    /// A remote request.
    Remote,
    /// CAN FD at one bit rate.
    Flexible,
    /// CAN FD with bit-rate switching for the data.
    Switched,
}

/// Header of a frame: everything except its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameHeader {
    /// Kind of the frame.
    pub kind: FrameKind,
    /// Identifier, 11 or 29 bits.
    pub identifier: u32,
    /// True if the identifier has 29 bits.
    pub extended: bool,
    /// Length of the data, or of the requested data, bytes: up to 8; CAN FD up to 64 in fixed steps.
    pub length: u8,
}

/// A frame that borrows its line; the data are still text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameView<'a> {
    header: FrameHeader,
    digits: &'a [u8],
    stamp_ms: Option<u16>,
}

impl FrameView<'_> {
    /// Header of the frame.
    pub const fn header(&self) -> FrameHeader {
        self.header
    }

    /// Time of reception by the adapter, ms within its minute.
    pub const fn stamp_ms(&self) -> Option<u16> {
        self.stamp_ms
    }

    /// The data, byte by byte.
    pub fn bytes(&self) -> impl Iterator<Item = u8> {
        let (pairs, _) = self.digits.as_chunks::<2>();
        pairs.iter().filter_map(|[high, low]| Some(digit(*high)? << 4 | digit(*low)?))
    }

    /// Converts to a [`Frame`]; `None` unless it is a classic data frame with an 11-bit identifier.
    pub fn frame(&self) -> Option<Frame> {
        let FrameHeader { kind: FrameKind::Data, identifier, extended: false, length } =
            self.header
        else {
            return None;
        };
        let mut data = [0; 8];
        data.iter_mut().zip(self.bytes()).for_each(|(to, from)| *to = from);
        Frame::new(identifier as u16, data.get(..usize::from(length))?)
    }
}

/// Bit rate by its slcan number, 0 to 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRate(u8);

impl BitRate {
    const BITS_PER_SECOND: [u32; 9] =
        [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

    /// 1 Mbit/s, required for samples at 1 kHz.
    pub const MEGABIT: Self = Self(8);

    /// Returns the rate with this number; `None` above 8.
    pub const fn new(number: u8) -> Option<Self> {
        if number <= 8 { Some(Self(number)) } else { None }
    }

    /// Returns the rate of this value, bit/s; `None` if slcan does not define it.
    pub fn from_bits_per_second(bits_per_second: u32) -> Option<Self> {
        let at = Self::BITS_PER_SECOND.iter().position(|rate| *rate == bits_per_second)?;
        u8::try_from(at).ok().map(Self)
    }

    /// Rate, bit/s.
    pub fn bits_per_second(self) -> u32 {
        Self::BITS_PER_SECOND.get(usize::from(self.0)).copied().unwrap_or(1_000_000)
    }
}

/// Command to an adapter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdapterCommand {
    /// Open the bus.
    Open,
    /// Open the bus in listen-only mode.
    Listen,
    /// Close the bus.
    Close,
    /// Set the bit rate. Valid only while closed.
    BitRate(BitRate),
    /// Set the data bit rate of CAN FD, Mbit/s, at most 9.
    DataRate(u8),
    /// Report the version.
    Version,
    /// Report the serial number.
    SerialNumber,
    /// Report the status.
    Status,
    /// Enable or disable time stamps.
    Stamps(bool),
}

/// A parsed line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlcanLine<'a> {
    /// A frame, in either direction.
    Frame(FrameView<'a>),
    /// Command to an adapter.
    Command(AdapterCommand),
    /// An empty line. From an adapter it means success.
    Done,
    /// From an adapter: the frame was sent.
    Sent {
        /// True if the identifier has 29 bits.
        extended: bool,
    },
    /// From an adapter: its version, serial number or status.
    Report {
        /// Letter of the command: `V`, `N` or `F`.
        letter: u8,
        /// The rest of the line.
        text: &'a [u8],
    },
}

/// Error of parsing a line; it names the invalid part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// The first byte is unknown.
    Unknown(u8),
    /// The identifier.
    Identifier,
    /// The length.
    Length,
    /// The data, or the text after them.
    Data,
    /// The argument of a command.
    Argument,
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(found) => write!(f, "unknown first byte {found:#04x} of an slcan line"),
            Self::Identifier => {
                f.write_str("expected an identifier, 3 digits to 7FF or 8 to 1FFFFFFF")
            }
            Self::Length => f.write_str("expected a length of one digit, to 8, CAN FD to F"),
            Self::Data => f.write_str("expected two digits a byte, then nothing or a stamp of 4"),
            Self::Argument => f.write_str("expected nothing, or a digit the command knows"),
        }
    }
}

impl core::error::Error for LineError {}

/// Parses a line without its end.
///
/// # Errors
/// Names the invalid part. Never panics.
pub fn parse(line: &[u8]) -> Result<SlcanLine<'_>, LineError> {
    let Some((&letter, rest)) = line.split_first() else { return Ok(SlcanLine::Done) };
    let (kind, extended) = match letter {
        b't' => (FrameKind::Data, false),
        b'T' => (FrameKind::Data, true),
        b'r' => (FrameKind::Remote, false),
        b'R' => (FrameKind::Remote, true),
        b'd' => (FrameKind::Flexible, false),
        b'D' => (FrameKind::Flexible, true),
        b'b' => (FrameKind::Switched, false),
        b'B' => (FrameKind::Switched, true),
        _ => return parse_command_or_answer(letter, rest),
    };
    let (places, last) = if extended { (8, LAST_EXTENDED) } else { (3, LAST_STANDARD) };
    let (identifier, rest) = rest.split_at_checked(places).ok_or(LineError::Identifier)?;
    let identifier =
        number(identifier).filter(|number| *number <= last).ok_or(LineError::Identifier)?;
    let (&code, rest) = rest.split_first().ok_or(LineError::Length)?;
    let code = digit(code).ok_or(LineError::Length)?;
    let flexible = matches!(kind, FrameKind::Flexible | FrameKind::Switched);
    if code > 8 && !flexible {
        return Err(LineError::Length);
    }
    let length = LENGTHS.get(usize::from(code)).copied().ok_or(LineError::Length)?;
    let digits = if kind == FrameKind::Remote { 0 } else { 2 * usize::from(length) };
    let (digits, stamp) = rest.split_at_checked(digits).ok_or(LineError::Data)?;
    if digits.iter().any(|text| digit(*text).is_none()) {
        return Err(LineError::Data);
    }
    let stamp_ms = match stamp {
        [] => None,
        [_, _, _, _] => Some(number(stamp).ok_or(LineError::Data)? as u16),
        _ => return Err(LineError::Data),
    };
    let header = FrameHeader { kind, identifier, extended, length };
    Ok(SlcanLine::Frame(FrameView { header, digits, stamp_ms }))
}

/// Parses a line that is not a frame.
fn parse_command_or_answer(letter: u8, rest: &[u8]) -> Result<SlcanLine<'_>, LineError> {
    let command = match (letter, rest) {
        (b'O', []) => AdapterCommand::Open,
        (b'L', []) => AdapterCommand::Listen,
        (b'C', []) => AdapterCommand::Close,
        (b'V', []) => AdapterCommand::Version,
        (b'N', []) => AdapterCommand::SerialNumber,
        (b'F', []) => AdapterCommand::Status,
        (b'S', [rate @ b'0'..=b'8']) => AdapterCommand::BitRate(BitRate(rate - b'0')),
        (b'Y', [rate @ b'0'..=b'9']) => AdapterCommand::DataRate(rate - b'0'),
        (b'Z', [on @ (b'0' | b'1')]) => AdapterCommand::Stamps(*on == b'1'),
        (b'z', []) => return Ok(SlcanLine::Sent { extended: false }),
        (b'Z', []) => return Ok(SlcanLine::Sent { extended: true }),
        (b'V' | b'N' | b'F', text) => return Ok(SlcanLine::Report { letter, text }),
        (b'O' | b'L' | b'C' | b'S' | b'Y' | b'Z' | b'z', _) => return Err(LineError::Argument),
        _ => return Err(LineError::Unknown(letter)),
    };
    Ok(SlcanLine::Command(command))
}

/// Writes a frame with the end of its line; returns the number of bytes written.
///
/// Returns `None` if the identifier or length is invalid, the length differs from that of `data`, or `out` is too
/// small. [`MAX_LINE_BYTES`]` + 1` bytes are always sufficient.
pub fn emit(header: &FrameHeader, data: &[u8], out: &mut [u8]) -> Option<usize> {
    let FrameHeader { kind, identifier, extended, length } = *header;
    let letter = match kind {
        FrameKind::Data => b't',
        FrameKind::Remote => b'r',
        FrameKind::Flexible => b'd',
        FrameKind::Switched => b'b',
    };
    let (places, last) = if extended { (8, LAST_EXTENDED) } else { (3, LAST_STANDARD) };
    let code = LENGTHS.iter().position(|known| *known == length)? as u32;
    let classic = matches!(kind, FrameKind::Data | FrameKind::Remote);
    let has_data = kind != FrameKind::Remote;
    if identifier > last
        || (classic && length > 8)
        || (has_data && data.len() != usize::from(length))
    {
        return None;
    }
    let mut text = Text { out, length: 0 };
    text.push(if extended { letter.to_ascii_uppercase() } else { letter })?;
    text.hexadecimal(identifier, places)?;
    text.hexadecimal(code, 1)?;
    if has_data {
        data.iter().try_for_each(|byte| text.hexadecimal(u32::from(*byte), 2))?;
    }
    text.push(DONE)?;
    Some(text.length)
}

/// Writes a [`Frame`] as [`emit`] does.
pub fn emit_frame(frame: &Frame, out: &mut [u8]) -> Option<usize> {
    let data = frame.data();
    let (kind, identifier) = (FrameKind::Data, u32::from(frame.identifier()));
    emit(&FrameHeader { kind, identifier, extended: false, length: data.len() as u8 }, data, out)
}

/// Writes a command with the end of its line; returns the number of bytes written, or `None` if a data rate has more
/// than one digit or `out` is too small. Three bytes are always sufficient.
pub fn emit_command(command: AdapterCommand, out: &mut [u8]) -> Option<usize> {
    let (letter, argument) = match command {
        AdapterCommand::Open => (b'O', None),
        AdapterCommand::Listen => (b'L', None),
        AdapterCommand::Close => (b'C', None),
        AdapterCommand::BitRate(BitRate(number)) => (b'S', Some(number)),
        AdapterCommand::DataRate(rate @ 0..=9) => (b'Y', Some(rate)),
        AdapterCommand::DataRate(_) => return None,
        AdapterCommand::Version => (b'V', None),
        AdapterCommand::SerialNumber => (b'N', None),
        AdapterCommand::Status => (b'F', None),
        AdapterCommand::Stamps(on) => (b'Z', Some(u8::from(on))),
    };
    let mut text = Text { out, length: 0 };
    text.push(letter)?;
    if let Some(argument) = argument {
        text.hexadecimal(u32::from(argument), 1)?;
    }
    text.push(DONE)?;
    Some(text.length)
}

/// Text writer with a bounded buffer.
struct Text<'a> {
    out: &'a mut [u8],
    length: usize,
}

impl Text<'_> {
    fn push(&mut self, byte: u8) -> Option<()> {
        *self.out.get_mut(self.length)? = byte;
        self.length += 1;
        Some(())
    }

    /// Writes the last `places` hexadecimal digits of a number.
    fn hexadecimal(&mut self, number: u32, places: u32) -> Option<()> {
        (0..places).rev().try_for_each(|place| {
            let nibble = (number >> (4 * place) & 0xF) as u8;
            self.push(if nibble < 10 { b'0' + nibble } else { b'A' + nibble - 10 })
        })
    }
}

fn digit(text: u8) -> Option<u8> {
    match text {
        b'0'..=b'9' => Some(text - b'0'),
        b'A'..=b'F' => Some(text - b'A' + 10),
        b'a'..=b'f' => Some(text - b'a' + 10),
        _ => None,
    }
}

/// Parses a hexadecimal number of up to eight digits.
fn number(text: &[u8]) -> Option<u32> {
    text.iter().try_fold(0, |value: u32, text| Some(value << 4 | u32::from(digit(*text)?)))
}

#[cfg(test)]
mod tests;
