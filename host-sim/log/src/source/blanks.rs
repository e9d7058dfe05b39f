//! Tables whose cells are separated by blanks, as numpy's `savetxt` and Fortran write them.
//!
//! Columns are often aligned with several blanks. They are one separator here, and blanks at either end of a line are
//! none, so that the `csv` crate can split at single blanks.

use std::io::{BufReader, Read};

/// Reads a text with single blanks between the words of a line.
pub(super) struct SingleBlanks<R> {
    inner: BufReader<R>,
    is_active: bool,
    /// True if a blank was read and a word precedes it in the line.
    is_blank_due: bool,
    /// True if the line has a word.
    has_word: bool,
    ready: Vec<u8>,
    given: usize,
}

impl<R: Read> SingleBlanks<R> {
    /// Wraps a text. Without `is_active`, it is unchanged.
    pub fn new(inner: R, is_active: bool) -> Self {
        Self {
            inner: BufReader::new(inner),
            is_active,
            is_blank_due: false,
            has_word: false,
            ready: Vec::new(),
            given: 0,
        }
    }

    fn collapse(&mut self, bytes: &[u8]) {
        self.ready.clear();
        self.given = 0;
        for &byte in bytes {
            match byte {
                b' ' | b'\r' => self.is_blank_due = self.has_word,
                b'\n' => {
                    self.ready.push(byte);
                    (self.is_blank_due, self.has_word) = (false, false);
                }
                _ => {
                    if self.is_blank_due {
                        self.ready.push(b' ');
                    }
                    self.ready.push(byte);
                    (self.is_blank_due, self.has_word) = (false, true);
                }
            }
        }
    }
}

/// Bytes read at once.
const CHUNK: usize = 16 * 1024;

impl<R: Read> Read for SingleBlanks<R> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        if !self.is_active {
            return self.inner.read(into);
        }
        while self.given == self.ready.len() {
            let mut chunk = [0; CHUNK];
            let count = self.inner.read(&mut chunk)?;
            if count == 0 {
                return Ok(0);
            }
            self.collapse(&chunk[..count]);
        }
        let count = into.len().min(self.ready.len() - self.given);
        into[..count].copy_from_slice(&self.ready[self.given..self.given + count]);
        self.given += count;
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn read_with_aligned_columns_returns_single_blanks() {
        let text = "  t   v\r\n 0.1  -2 \n\n3 4";
        let read = |is_active| {
            let mut found = String::new();
            SingleBlanks::new(text.as_bytes(), is_active).read_to_string(&mut found).unwrap();
            found
        };
        assert_eq!(read(true), "t v\n0.1 -2\n\n3 4");
        assert_eq!(read(false), text);
    }
}
