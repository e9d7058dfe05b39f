//! The text formats of CAN logs: detection of the format, and lines to frames.
//!
//! A line of [`candump`] is complete by itself. The formats of Vector and PEAK have headers that define the following
//! lines, so a [`TextReader`] keeps these settings.

use crate::candump::{self, CanFrame, Fraction, Line, LineError};
use crate::{asc, trc};

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
pub(crate) struct TextWriter {
    pub format: TextFormat,
    lines: u64,
}

impl TextWriter {
    pub fn new(format: TextFormat) -> Self {
        Self { format, lines: 0 }
    }

    pub fn emit(&mut self, line: &Line, fraction: Fraction, out: &mut Vec<u8>) {
        let is_first = self.lines == 0;
        self.lines += 1;
        match self.format {
            TextFormat::Candump => candump::emit(line, fraction, out),
            TextFormat::Asc => {
                if is_first {
                    asc::emit_header(out);
                }
                asc::emit(line, fraction, out);
            }
            TextFormat::Trc => {
                if is_first {
                    trc::emit_header(out);
                }
                trc::emit(line, self.lines, fraction, out);
            }
        }
    }

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

/// Parses the frame after its identifier: `d` or `r`, the length, the bytes.
pub(crate) fn data_frame<'a>(
    identifier: &[u8],
    extended: bool,
    radix: u32,
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<CanFrame, LineError> {
    let number = |text: &[u8], radix: u32| {
        std::str::from_utf8(text).ok().and_then(|text| u32::from_str_radix(text, radix).ok())
    };
    let last = if extended { 0x1FFF_FFFF } else { 0x7FF };
    let identifier = number(identifier, radix).filter(|id| *id <= last);
    let identifier = identifier.ok_or(LineError::Identifier)?;
    let kind = words.next().ok_or(LineError::Data)?;
    let length = words.next().map_or(Some(0), |text| number(text, radix));
    let length = length.filter(|length| *length <= 8).ok_or(LineError::Data)? as u8;
    match kind {
        b"r" => Ok(CanFrame::Remote { identifier, extended, length }),
        b"d" => {
            let bytes = payload_in(length, radix, words)?;
            Ok(CanFrame::Data { identifier, extended, length, bytes })
        }
        _ => Err(LineError::Data),
    }
}

/// Parses `length` bytes, each a hexadecimal word.
pub(crate) fn payload<'a>(
    length: u8,
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<[u8; 8], LineError> {
    payload_in(length, 16, words)
}

fn payload_in<'a>(
    length: u8,
    radix: u32,
    words: &mut impl Iterator<Item = &'a [u8]>,
) -> Result<[u8; 8], LineError> {
    let mut bytes = [0; 8];
    let places = bytes.get_mut(..usize::from(length)).ok_or(LineError::Data)?;
    for byte in places {
        let word = words.next().and_then(|word| std::str::from_utf8(word).ok());
        let number = word.and_then(|word| u8::from_str_radix(word, radix).ok());
        *byte = number.ok_or(LineError::Data)?;
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candump::Direction;

    fn frames<'a>(format: TextFormat, text: &'a str) -> Vec<Frames<'a>> {
        let mut reader = TextReader::new(format);
        text.lines().map(|line| reader.read(line.as_bytes())).collect()
    }

    /// Returns a frame with identifier 0x201 and two bytes, received at 1.234 ms on bus 1.
    fn example() -> Line<'static> {
        let bytes = [0x80, 0x3F, 0, 0, 0, 0, 0, 0];
        let frame = CanFrame::Data { identifier: 0x201, extended: false, length: 2, bytes };
        let direction = Some(Direction::Received);
        Line { time_ns: 1_234_000, interface: b"1", frame, direction }
    }

    #[test]
    fn reader_with_asc_file_returns_its_frames() {
        let text = "date Wed May 1 12:00:00.000 pm 2024\nbase hex  timestamps absolute\n\
            Begin Triggerblock Wed May 1\n   0.000000 Start of measurement\n\
            0.001234 1  201             Rx   d 2 80 3F  Length = 230000 BitCount = 120 ID = 513\n\
            0.002000 1  18FF1234x       Tx   d 0\n0.003000 1  ErrorFrame\n0.003 1 123 Rx r 8\n\
            0.004000 1  201 Rx d 2 80 zz\n0.005 CANFD 1 Rx 201 1 0 8 8 01\nEnd TriggerBlock";
        assert_eq!(TextFormat::of(text.as_bytes()), Some(TextFormat::Asc));
        let found = frames(TextFormat::Asc, text);
        assert_eq!(found[4], Frames::Line(example()));
        assert!(matches!(
            found[5],
            Frames::Line(Line {
                frame: CanFrame::Data { identifier: 0x18FF_1234, extended: true, .. },
                ..
            })
        ));
        assert!(matches!(found[6], Frames::Line(Line { frame: CanFrame::Error { .. }, .. })));
        assert!(matches!(
            found[7],
            Frames::Line(Line { frame: CanFrame::Remote { length: 8, .. }, .. })
        ));
        assert_eq!(found[8], Frames::Bad(LineError::Data));
        for other in [0, 1, 2, 3, 9, 10] {
            assert_eq!(found[other], Frames::None, "{other}");
        }
        let relative =
            "base dec timestamps relative\n0.001 1 513 Rx d 2 128 63\n0.000234 1 513 Rx d 2 128 63";
        assert_eq!(frames(TextFormat::Asc, relative)[2], Frames::Line(example()));
    }

    #[test]
    fn reader_with_each_trc_version_returns_the_same_frame() {
        for text in [
            ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n 1 1.234 DT 1 0201 Rx - 2 80 3F",
            ";$FILEVERSION=2.0\n;$COLUMNS=N,O,T,I,d,l,D\n 1 1.234 DT 0201 Rx 2 80 3F",
            ";$FILEVERSION=1.3\n;\n 1) 1.234 1 Rx 0201 - 2 80 3F",
            ";$FILEVERSION=1.1\n;\n 1) 1.234 Rx 0201 2 80 3F",
        ] {
            assert_eq!(TextFormat::of(text.as_bytes()), Some(TextFormat::Trc));
            assert_eq!(frames(TextFormat::Trc, text)[2], Frames::Line(example()), "{text}");
        }
        let text = ";$FILEVERSION=1.1\n 1) 1.2 Rx 0201 8 RTR\n 2) 1.2 Warng 0 8 BUSLIGHT\n 3) 1.2 Rx 0201 2 8";
        let found = frames(TextFormat::Trc, text);
        assert!(matches!(found[1], Frames::Line(Line { frame: CanFrame::Remote { .. }, .. })));
        assert_eq!(found[2..], [Frames::None, Frames::Bad(LineError::Data)]);
    }

    #[test]
    fn reader_after_writer_returns_the_same_lines() {
        for format in [TextFormat::Candump, TextFormat::Asc, TextFormat::Trc] {
            for (fraction, time_ns) in
                [(Fraction::Microseconds, 12_345_678_000), (Fraction::Nanoseconds, 12_345_678_901)]
            {
                let mut writer = TextWriter::new(format);
                let mut text = Vec::new();
                let wide = CanFrame::Data {
                    identifier: 0x18FF_1234,
                    extended: true,
                    length: 8,
                    bytes: [1, 2, 3, 4, 5, 6, 7, 255],
                };
                let lines = [
                    Line { time_ns: 0, ..example() },
                    Line { time_ns, ..example() },
                    Line { time_ns, frame: wide, ..example() },
                ];
                lines.iter().for_each(|line| writer.emit(line, fraction, &mut text));
                writer.end(&mut text);
                assert_eq!(TextFormat::of(&text), Some(format));
                let mut reader = TextReader::new(format);
                let read = text.split(|byte| *byte == b'\n').map(|line| reader.read(line));
                let read: Vec<Line> = read
                    .filter_map(|frames| match frames {
                        Frames::Line(line) => Some(line),
                        Frames::None => None,
                        Frames::Bad(error) => panic!("{error}"),
                    })
                    .collect();
                let plain = |line: &Line| (line.time_ns, line.frame);
                let expected: Vec<_> = lines.iter().map(plain).collect();
                assert_eq!(read.iter().map(plain).collect::<Vec<_>>(), expected, "{format:?}");
            }
        }
    }
}
