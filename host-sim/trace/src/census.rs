//! The census of a log: its identifiers, and the number of frames of each.
//!
//! An error message lists them if a log has no frames of the expected joint. The census reads the file a second time,
//! so normal reading does not pay for it.

use crate::fields::Frames;
use crate::frame::CanFrame;
use crate::text::TextReader;
use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, BufRead, Read};

/// Maximum number of identifiers listed in a message.
const MAX_LISTED_IDENTIFIERS: usize = 12;

/// Maximum length of a line, in bytes. Lines of all formats are shorter.
const MAX_LINE_BYTES: u64 = 4096;

/// Number of frames by identifier.
#[derive(Clone, Debug, Default)]
pub struct Census {
    counts: BTreeMap<u32, u64>,
}

impl Census {
    /// Counts the frames of a log in any of the text formats. Lines without a frame are skipped.
    ///
    /// # Errors
    /// Returns the error of the reader.
    pub fn of(mut log: impl BufRead) -> io::Result<Self> {
        let (mut census, mut line) = (Self::default(), Vec::new());
        let mut reader = TextReader::of(log.fill_buf()?);
        loop {
            line.clear();
            if log.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut line)? == 0 {
                return Ok(census);
            }
            let Frames::Line(found) = reader.read(&line) else { continue };
            let mut count = |identifier| *census.counts.entry(identifier).or_default() += 1;
            match found.frame {
                CanFrame::Data { identifier, .. } => count(identifier),
                frame => frame.joint_frames().for_each(|frame| count(frame.identifier().into())),
            }
        }
    }
}

impl fmt::Display for Census {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.counts.is_empty() {
            return f.write_str("no frames");
        }
        let listed = self.counts.iter().take(MAX_LISTED_IDENTIFIERS);
        let listed: Vec<String> =
            listed.map(|(identifier, count)| format!("{identifier:03X} ({count})")).collect();
        write!(f, "frames {}", listed.join(", "))?;
        let more = self.counts.len().saturating_sub(MAX_LISTED_IDENTIFIERS);
        if more > 0 { write!(f, " and {more} more identifiers") } else { Ok(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn census_with_many_identifiers_lists_twelve_with_their_counts() {
        let of = |log: &str| Census::of(log.as_bytes()).unwrap().to_string();
        assert_eq!(of(""), "no frames");
        assert_eq!(of("rubbish\n(1.0) can0 080#01\n"), "frames 080 (1)");
        let log = "(1.0) can0 201#00\n(1.0) can0 080#01\n(2.0) can0 201#00\n";
        assert_eq!(of(log), "frames 080 (1), 201 (2)");
        let many: String = (0..15).map(|at| format!("(1.0) can0 {at:03X}#\n")).collect();
        let listed = of(&many);
        assert!(listed.ends_with("00B (1) and 3 more identifiers"), "{listed}");
    }
}
