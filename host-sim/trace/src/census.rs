//! What frames are in a log: their identifiers, and how many of each.
//!
//! For the one question a reader has where a log lacks what was looked for: what is in it, then? Nothing is counted
//! while a log is read as it should be; this walks the file again.

use super::candump::CanFrame;
use super::text::{Frames, TextFormat, TextReader};
use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, BufRead, Read};

/// Identifiers told by name.
const MOST_TOLD: usize = 12;

/// Longer than any line of a log.
const LONGEST_LINE: u64 = 4096;

/// Frames by their identifier.
#[derive(Clone, Debug, Default)]
pub struct Census {
    counts: BTreeMap<u32, u64>,
}

impl Census {
    /// Counts the frames of a log in any of the text formats; what is no frame is passed over.
    ///
    /// # Errors
    /// As the reader.
    pub fn of(mut log: impl BufRead) -> io::Result<Self> {
        let (mut census, mut line) = (Self::default(), Vec::new());
        let format = TextFormat::of(log.fill_buf()?).unwrap_or_default();
        let mut reader = TextReader::new(format);
        loop {
            line.clear();
            if log.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line)? == 0 {
                return Ok(census);
            }
            if let Frames::Line(found) = reader.read(&line)
                && let CanFrame::Data { identifier, .. } = found.frame
            {
                *census.counts.entry(identifier).or_default() += 1;
            }
        }
    }
}

impl fmt::Display for Census {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.counts.is_empty() {
            return f.write_str("no frames");
        }
        f.write_str("frames ")?;
        for (place, (identifier, count)) in self.counts.iter().take(MOST_TOLD).enumerate() {
            let comma = if place > 0 { ", " } else { "" };
            write!(f, "{comma}{identifier:03X} ({count})")?;
        }
        let more = self.counts.len().saturating_sub(MOST_TOLD);
        if more > 0 { write!(f, " and {more} more identifiers") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_identifier_is_told_with_its_number_of_frames_up_to_a_dozen() {
        let of = |log: &str| Census::of(log.as_bytes()).unwrap().to_string();
        assert_eq!(of(""), "no frames");
        assert_eq!(of("rubbish\n(1.0) can0 080#01\n"), "frames 080 (1)");
        let log = "(1.0) can0 201#00\n(1.0) can0 080#01\n(2.0) can0 201#00\n";
        assert_eq!(of(log), "frames 080 (1), 201 (2)");
        let many: String = (0..15).map(|at| format!("(1.0) can0 {at:03X}#\n")).collect();
        let told = of(&many);
        assert!(told.ends_with("00B (1) and 3 more identifiers"), "{told}");
    }
}
