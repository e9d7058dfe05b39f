//! The text of a panic, kept in RAM across a reset.
//!
//! RAM keeps its content across a reset but not without power, after which it is random. A note is
//! therefore valid only if a magic word, its length and a CRC over its text agree. Reading clears it, so it
//! is reported once. It consists of words of which every bit pattern is valid, so random content is safe to
//! inspect. Text that does not fit is cut at a whole character. `crate::panic` defines where the note is
//! stored.

use compensator_core::crc32::Crc32;
use heapless::String;

/// Maximum length of the text, bytes.
pub const MAX_PANIC_TEXT_BYTES: usize = 160;

const MAGIC: u32 = u32::from_le_bytes(*b"NOTE");

/// A text of at most [`MAX_PANIC_TEXT_BYTES`] bytes with its own validity check.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct PanicNote {
    magic: u32,
    length: u32,
    crc: u32,
    text: [u8; MAX_PANIC_TEXT_BYTES],
}

/// Part of the text of a note.
///
/// The parts are written without the formatter of the standard library, which the image has for nothing else.
#[derive(Clone, Copy, Debug)]
pub enum Part<'a> {
    /// A text.
    Text(&'a str),
    /// A number, decimal.
    Decimal(u32),
    /// A number, as `0x` and eight digits.
    Hexadecimal(u32),
}

impl Default for PanicNote {
    fn default() -> Self {
        Self { magic: 0, length: 0, crc: 0, text: [0; MAX_PANIC_TEXT_BYTES] }
    }
}

impl PanicNote {
    /// Writes a text of these parts and replaces the previous one.
    pub fn write(&mut self, parts: &[Part]) {
        self.magic = 0;
        self.text = [0; MAX_PANIC_TEXT_BYTES];
        let mut writer = NoteWriter { into: &mut self.text, length: 0 };
        parts.iter().for_each(|part| writer.part(*part));
        self.length = writer.length as u32;
        self.crc = self.compute_crc();
        self.magic = MAGIC;
    }

    /// Returns the text and clears it; `None` if there is none.
    pub fn take(&mut self) -> Option<String<MAX_PANIC_TEXT_BYTES>> {
        let is_valid = self.magic == MAGIC && self.crc == self.compute_crc();
        self.magic = 0;
        let bytes = self.text.get(..self.length as usize).filter(|_| is_valid)?;
        let mut text = String::new();
        text.push_str(core::str::from_utf8(bytes).ok()?).ok()?;
        Some(text)
    }

    /// Returns the note as it lies in memory, to place it in that of an emulated board.
    #[cfg(not(target_os = "none"))]
    pub fn to_bytes(&self) -> [u8; 12 + MAX_PANIC_TEXT_BYTES] {
        let mut bytes = [0; 12 + MAX_PANIC_TEXT_BYTES];
        let words = [self.magic, self.length, self.crc].map(u32::to_le_bytes);
        let content = words.iter().flatten().chain(&self.text);
        bytes.iter_mut().zip(content).for_each(|(place, byte)| *place = *byte);
        bytes
    }

    fn compute_crc(&self) -> u32 {
        let mut digest = Crc32::new();
        digest.update(&self.length.to_le_bytes());
        digest.update(&self.text);
        digest.value()
    }
}

struct NoteWriter<'a> {
    into: &'a mut [u8; MAX_PANIC_TEXT_BYTES],
    length: usize,
}

impl NoteWriter<'_> {
    /// Appends a part. What does not fit is cut.
    fn part(&mut self, part: Part) {
        match part {
            Part::Text(text) => {
                let end = text.floor_char_boundary(self.into.len() - self.length);
                let places = self.into.iter_mut().skip(self.length);
                places.zip(text.as_bytes()).take(end).for_each(|(to, from)| *to = *from);
                self.length += end;
            }
            Part::Decimal(number) => self.number(number, 10),
            Part::Hexadecimal(number) => {
                self.part(Part::Text("0x"));
                self.number(number, 16);
            }
        }
    }

    #[inline(never)]
    fn number(&mut self, number: u32, base: u32) {
        let largest = if base == 10 { 1_000_000_000 } else { 1 << 28 };
        let (mut divisor, mut begun) = (largest, false);
        while divisor > 0 {
            let digit = number / divisor % base;
            begun |= digit > 0 || base == 16 || divisor == 1;
            if begun {
                self.letter(char::from_digit(digit, base).map_or(b'?', |digit| digit as u8));
            }
            divisor /= base;
        }
    }

    fn letter(&mut self, letter: u8) {
        if let Some(place) = self.into.get_mut(self.length) {
            *place = letter;
            self.length += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn take_returns_the_text_once() {
        let mut note = PanicNote::default();
        assert_eq!(note.take(), None);
        note.write(&[
            Part::Text("src/x.rs:"),
            Part::Decimal(70),
            Part::Text(" "),
            Part::Decimal(0),
        ]);
        assert_eq!(note.take().unwrap(), "src/x.rs:70 0");
        note.write(&[Part::Hexadecimal(0x0800_5A0F)]);
        assert_eq!(note.take().unwrap(), "0x08005a0f");
        note.write(&[Part::Decimal(u32::MAX)]);
        assert_eq!(note.take().unwrap(), "4294967295");
        assert_eq!(note.take(), None);
    }

    #[test]
    fn long_text_is_cut_at_a_whole_character() {
        let mut note = PanicNote::default();
        note.write(&[Part::Text("x"), Part::Text(&"ä".repeat(MAX_PANIC_TEXT_BYTES))]);
        let text = note.take().unwrap();
        assert_eq!(text.len(), MAX_PANIC_TEXT_BYTES - 1);
        assert!(text.ends_with('ä'));
    }

    #[test]
    fn take_of_damaged_note_returns_none() {
        let mut note = PanicNote::default();
        note.write(&[Part::Text("gone")]);
        let written = note.clone();
        for (broken, what) in [
            (PanicNote { magic: 1, ..written.clone() }, "magic"),
            (PanicNote { length: 3, ..written.clone() }, "length"),
            (PanicNote { length: u32::MAX, ..written.clone() }, "huge length"),
            (PanicNote { crc: written.crc ^ 1, ..written.clone() }, "crc"),
        ] {
            assert_eq!({ broken }.take(), None, "{what}");
        }
        let mut broken = written.clone();
        broken.text[MAX_PANIC_TEXT_BYTES - 1] ^= 1;
        assert_eq!(broken.take(), None);
        assert_eq!({ written }.take().unwrap(), "gone");
    }
}
