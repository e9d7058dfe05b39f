//! slcan: CAN as lines of text on a serial line, as USB adapters and the emulated board speak it.
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
//! A data frame may carry four more digits, milliseconds in a minute. The way of a byte: [`Splitter`]
//! (bytes to lines) -> [`parse`] (a line, understood; its data stay text until asked for) -> [`Adapter`]
//! (what a device answers). [`emit`] goes the other way. Whatever the bytes are, nothing here panics.

mod adapter;
mod splitter;

pub use adapter::{Adapter, Heard};
pub use splitter::{Piece, Splitter};

use super::Frame;
use core::fmt;

/// Bytes of the longest line, without its end: CAN FD, 29 bits, 64 bytes, a stamp.
pub const LONGEST: usize = 1 + 8 + 1 + 128 + 4;
/// Bytes of the longest line of a classic frame, without its end.
pub const LONGEST_CLASSIC: usize = 1 + 8 + 1 + 16 + 4;

/// What a line ends with; alone it says that something was done.
pub const DONE: u8 = b'\r';
/// Says that something was refused.
pub const REFUSED: u8 = 7;

const LAST_STANDARD: u32 = 0x7FF;
const LAST_EXTENDED: u32 = 0x1FFF_FFFF;

/// Bytes of CAN FD by length code.
const LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// What sort of frame a line holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Classic data.
    Data,
    /// A remote request.
    Remote,
    /// CAN FD at one bit rate.
    Flexible,
    /// CAN FD, the data at the higher rate.
    Switched,
}

/// All of a frame but its data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// What sort.
    pub kind: Kind,
    /// 11 or 29 bits.
    pub identifier: u32,
    /// Whether 29.
    pub extended: bool,
    /// Bytes of data, or asked for: up to 8, of CAN FD a length it knows up to 64.
    pub length: u8,
}

/// A frame in its line: the data are text still.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct View<'a> {
    header: Header,
    digits: &'a [u8],
    stamp_ms: Option<u16>,
}

impl View<'_> {
    /// All but the data.
    pub const fn header(&self) -> Header {
        self.header
    }

    /// When the adapter heard it, ms in its minute.
    pub const fn stamp_ms(&self) -> Option<u16> {
        self.stamp_ms
    }

    /// The data, byte by byte.
    pub fn bytes(&self) -> impl Iterator<Item = u8> {
        let (pairs, _) = self.digits.as_chunks::<2>();
        pairs.iter().filter_map(|[high, low]| Some(digit(*high)? << 4 | digit(*low)?))
    }

    /// As a frame a joint knows: classic data with an 11-bit identifier; `None` for any other.
    pub fn frame(&self) -> Option<Frame> {
        let Header { kind: Kind::Data, identifier, extended: false, length } = self.header else {
            return None;
        };
        let mut data = [0; 8];
        data.iter_mut().zip(self.bytes()).for_each(|(to, from)| *to = from);
        Frame::new(identifier as u16, data.get(..usize::from(length))?)
    }
}

/// A bit rate that has a number, 0 to 8.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRate(u8);

impl BitRate {
    const BITS_PER_SECOND: [u32; 9] =
        [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];

    /// 1 Mbit/s: what a joint needs for its samples at 1 kHz.
    pub const MEGABIT: Self = Self(8);

    /// The rate of this number; `None` beyond 8.
    pub const fn new(number: u8) -> Option<Self> {
        if number <= 8 { Some(Self(number)) } else { None }
    }

    /// The rate of so many bit/s; `None` where there is none.
    pub fn from_bits_per_second(bits_per_second: u32) -> Option<Self> {
        let at = Self::BITS_PER_SECOND.iter().position(|rate| *rate == bits_per_second)?;
        u8::try_from(at).ok().map(Self)
    }

    /// bit/s.
    pub fn bits_per_second(self) -> u32 {
        Self::BITS_PER_SECOND.get(usize::from(self.0)).copied().unwrap_or(1_000_000)
    }
}

/// What an adapter is told to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Take part in the bus.
    Open,
    /// Listen to the bus and send nothing.
    Listen,
    /// Leave the bus.
    Close,
    /// The bit rate, while closed.
    BitRate(BitRate),
    /// The bit rate of CAN FD's data; its digit is Mbit/s.
    DataRate(u8),
    /// Say which version it is.
    Version,
    /// Say its serial number.
    SerialNumber,
    /// Say how it is.
    Status,
    /// Put a stamp behind each frame, or do not.
    Stamps(bool),
}

/// A line, understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Line<'a> {
    /// A frame, either way.
    Frame(View<'a>),
    /// To an adapter.
    Command(Command),
    /// An empty line. From an adapter: done.
    Done,
    /// From an adapter: a frame was sent.
    Sent {
        /// Whether its identifier had 29 bits.
        extended: bool,
    },
    /// From an adapter: its version, serial number or status.
    Told {
        /// `V`, `N` or `F`.
        what: u8,
        /// The rest of the line.
        text: &'a [u8],
    },
}

/// What is wrong with a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// No line begins so.
    Unknown(u8),
    /// The identifier.
    Identifier,
    /// The length.
    Length,
    /// The data, or what follows them.
    Data,
    /// What follows the letter of a command.
    Argument,
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown(found) => write!(f, "no slcan line begins with byte {found:#04x}"),
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

/// Reads a line, without its end.
///
/// # Errors
/// Says which part is wrong; never panics, whatever the bytes.
pub fn parse(line: &[u8]) -> Result<Line<'_>, LineError> {
    let Some((&letter, rest)) = line.split_first() else { return Ok(Line::Done) };
    let (kind, extended) = match letter {
        b't' => (Kind::Data, false),
        b'T' => (Kind::Data, true),
        b'r' => (Kind::Remote, false),
        b'R' => (Kind::Remote, true),
        b'd' => (Kind::Flexible, false),
        b'D' => (Kind::Flexible, true),
        b'b' => (Kind::Switched, false),
        b'B' => (Kind::Switched, true),
        _ => return other(letter, rest),
    };
    let (places, last) = if extended { (8, LAST_EXTENDED) } else { (3, LAST_STANDARD) };
    let (identifier, rest) = rest.split_at_checked(places).ok_or(LineError::Identifier)?;
    let identifier =
        number(identifier).filter(|number| *number <= last).ok_or(LineError::Identifier)?;
    let (&code, rest) = rest.split_first().ok_or(LineError::Length)?;
    let code = digit(code).ok_or(LineError::Length)?;
    let flexible = matches!(kind, Kind::Flexible | Kind::Switched);
    if code > 8 && !flexible {
        return Err(LineError::Length);
    }
    let length = LENGTHS.get(usize::from(code)).copied().ok_or(LineError::Length)?;
    let digits = if kind == Kind::Remote { 0 } else { 2 * usize::from(length) };
    let (digits, stamp) = rest.split_at_checked(digits).ok_or(LineError::Data)?;
    if digits.iter().any(|text| digit(*text).is_none()) {
        return Err(LineError::Data);
    }
    let stamp_ms = match stamp {
        [] => None,
        [_, _, _, _] => Some(number(stamp).ok_or(LineError::Data)? as u16),
        _ => return Err(LineError::Data),
    };
    let header = Header { kind, identifier, extended, length };
    Ok(Line::Frame(View { header, digits, stamp_ms }))
}

/// A line that is no frame.
fn other(letter: u8, rest: &[u8]) -> Result<Line<'_>, LineError> {
    let command = match (letter, rest) {
        (b'O', []) => Command::Open,
        (b'L', []) => Command::Listen,
        (b'C', []) => Command::Close,
        (b'V', []) => Command::Version,
        (b'N', []) => Command::SerialNumber,
        (b'F', []) => Command::Status,
        (b'S', [rate @ b'0'..=b'8']) => Command::BitRate(BitRate(rate - b'0')),
        (b'Y', [rate @ b'0'..=b'9']) => Command::DataRate(rate - b'0'),
        (b'Z', [on @ (b'0' | b'1')]) => Command::Stamps(*on == b'1'),
        (b'z', []) => return Ok(Line::Sent { extended: false }),
        (b'Z', []) => return Ok(Line::Sent { extended: true }),
        (b'V' | b'N' | b'F', text) => return Ok(Line::Told { what: letter, text }),
        (b'O' | b'L' | b'C' | b'S' | b'Y' | b'Z' | b'z', _) => return Err(LineError::Argument),
        _ => return Err(LineError::Unknown(letter)),
    };
    Ok(Line::Command(command))
}

/// Writes a frame with the end of its line; gives the bytes written.
///
/// `None` where there is no such frame (an identifier too large, a length that is not that of the data
/// or that the kind does not have) or `out` is too small: [`LONGEST`] and one more always do.
pub fn emit(header: &Header, data: &[u8], out: &mut [u8]) -> Option<usize> {
    let Header { kind, identifier, extended, length } = *header;
    let letter = match kind {
        Kind::Data => b't',
        Kind::Remote => b'r',
        Kind::Flexible => b'd',
        Kind::Switched => b'b',
    };
    let (places, last) = if extended { (8, LAST_EXTENDED) } else { (3, LAST_STANDARD) };
    let code = LENGTHS.iter().position(|known| *known == length)? as u32;
    let classic = matches!(kind, Kind::Data | Kind::Remote);
    let has_data = kind != Kind::Remote;
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

/// Writes a joint's frame, as [`emit`] does.
pub fn emit_frame(frame: &Frame, out: &mut [u8]) -> Option<usize> {
    let data = frame.data();
    let (kind, identifier) = (Kind::Data, u32::from(frame.identifier()));
    emit(&Header { kind, identifier, extended: false, length: data.len() as u8 }, data, out)
}

/// Writes a command with the end of its line; gives the bytes written, `None` where `out` has less
/// than three.
pub fn emit_command(command: Command, out: &mut [u8]) -> Option<usize> {
    let (letter, argument) = match command {
        Command::Open => (b'O', None),
        Command::Listen => (b'L', None),
        Command::Close => (b'C', None),
        Command::BitRate(BitRate(number)) => (b'S', Some(number)),
        Command::DataRate(rate) => (b'Y', Some(rate.min(9))),
        Command::Version => (b'V', None),
        Command::SerialNumber => (b'N', None),
        Command::Status => (b'F', None),
        Command::Stamps(on) => (b'Z', Some(u8::from(on))),
    };
    let mut text = Text { out, length: 0 };
    text.push(letter)?;
    if let Some(argument) = argument {
        text.hexadecimal(u32::from(argument), 1)?;
    }
    text.push(DONE)?;
    Some(text.length)
}

/// Text written into bytes that may be too few.
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

    /// The last digits of a number.
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

/// A number of up to eight digits.
fn number(text: &[u8]) -> Option<u32> {
    text.iter().try_fold(0, |value: u32, text| Some(value << 4 | u32::from(digit(*text)?)))
}

#[cfg(test)]
mod tests;
