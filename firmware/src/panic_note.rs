//! The last words of a firmware, kept in RAM over a reset.
//!
//! RAM keeps its content over a reset but not over a loss of power, and after that it is chance. So a
//! note is believed only where a magic word, its length and a CRC over its text agree, and it is wiped as
//! it is read: told once. It is made of words of which every pattern is legal, so that looking at chance is
//! no mistake. Text that does not fit is cut at a whole letter. Where the note lies is `crate::panic`'s.

use core::fmt::{self, Display, Write};
use heapless::String;

/// Longest text, bytes.
pub const PANIC_TEXT: usize = 160;

const MAGIC: u32 = u32::from_le_bytes(*b"NOTE");

const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// A text of at most [`PANIC_TEXT`] bytes that says itself whether it is one.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Note {
    magic: u32,
    length: u32,
    crc: u32,
    text: [u8; PANIC_TEXT],
}

impl Default for Note {
    fn default() -> Self {
        Self { magic: 0, length: 0, crc: 0, text: [0; PANIC_TEXT] }
    }
}

impl Note {
    /// Writes a text over whatever is there.
    pub fn write(&mut self, what: &dyn Display) {
        self.magic = 0;
        self.text = [0; PANIC_TEXT];
        let mut line = Line { into: &mut self.text, length: 0 };
        // What does not fit is cut, not lost.
        let _ = write!(line, "{what}");
        self.length = line.length as u32;
        self.crc = self.check();
        self.magic = MAGIC;
    }

    /// The text, once; `None` where there is none.
    pub fn take(&mut self) -> Option<String<PANIC_TEXT>> {
        let sound = self.magic == MAGIC && self.crc == self.check();
        self.magic = 0;
        let bytes = self.text.get(..self.length as usize).filter(|_| sound)?;
        let mut text = String::new();
        text.push_str(core::str::from_utf8(bytes).ok()?).ok()?;
        Some(text)
    }

    fn check(&self) -> u32 {
        let mut digest = CRC.digest();
        digest.update(&self.length.to_le_bytes());
        digest.update(&self.text);
        digest.finalize()
    }
}

struct Line<'a> {
    into: &'a mut [u8; PANIC_TEXT],
    length: usize,
}

impl Write for Line<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for letter in text.chars() {
            let end = self.length + letter.len_utf8();
            let place = self.into.get_mut(self.length..end).ok_or(fmt::Error)?;
            letter.encode_utf8(place);
            self.length = end;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_told_once() {
        let mut note = Note::default();
        assert_eq!(note.take(), None);
        note.write(&"src/x.rs:7: out of turns");
        assert_eq!(note.take().unwrap(), "src/x.rs:7: out of turns");
        assert_eq!(note.take(), None);
    }

    #[test]
    fn a_long_text_is_cut_at_a_whole_letter() {
        let mut note = Note::default();
        note.write(&format_args!("x{}", "ä".repeat(PANIC_TEXT)));
        let text = note.take().unwrap();
        assert_eq!(text.len(), PANIC_TEXT - 1);
        assert!(text.ends_with('ä'));
    }

    #[test]
    fn chance_is_no_text() {
        let mut note = Note::default();
        note.write(&"gone");
        let written = note.clone();
        for (broken, what) in [
            (Note { magic: 1, ..written.clone() }, "magic"),
            (Note { length: 3, ..written.clone() }, "length"),
            (Note { length: u32::MAX, ..written.clone() }, "huge length"),
            (Note { crc: written.crc ^ 1, ..written.clone() }, "crc"),
        ] {
            assert_eq!({ broken }.take(), None, "{what}");
        }
        let mut broken = written.clone();
        broken.text[PANIC_TEXT - 1] ^= 1;
        assert_eq!(broken.take(), None);
        assert_eq!({ written }.take().unwrap(), "gone");
    }
}
