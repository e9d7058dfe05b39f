//! The file of a CAN log. Only its data show what it holds, so its frames are read from the start more than once.

use crate::error::{BadCell, BadRows, DataError, quoted};
use crate::source::lines::LineFile;
use joint_trace::{Assembler, Census, Frames, Line, Summary, TextFormat, TextReader, TraceSample};
use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::Path;

/// Maximum length of a line, bytes. No line of a CAN log is longer.
const MAX_LINE_BYTES: u64 = 4096;

/// The file of a CAN log.
pub(super) struct CanFile<'a> {
    /// Its name in messages.
    pub path: &'a Path,
    /// The reader of its lines, at the start.
    pub lines: TextReader,
    file: File,
    format: TextFormat,
}

/// The lines without a frame.
#[derive(Default)]
pub(super) struct OtherLines {
    /// Lines that begin like a frame but are malformed, the first few in detail.
    pub malformed: BadRows,
    /// Number of other lines: comments, and messages of candump about dropped frames.
    pub count: u64,
}

impl<'a> CanFile<'a> {
    /// Returns a file that begins with `head`.
    pub fn new(path: &'a Path, file: File, head: &[u8]) -> Self {
        let format = TextFormat::of(head).unwrap_or_default();
        Self { path, lines: TextReader::of(head), file, format }
    }

    /// Calls `sink` for each sample.
    pub fn each_sample(
        &mut self,
        progress: &dyn Fn(u64),
        mut sink: impl FnMut(&TraceSample),
    ) -> Result<(Summary, OtherLines), DataError> {
        let mut assembler = Assembler::default();
        let others = self.each_frame(progress, |row, frame| {
            if let Some(sample) = assembler.push(row, frame) {
                sink(&sample);
            }
        })?;
        let (last, summary) = assembler.finish();
        last.iter().for_each(sink);
        Ok((summary, others))
    }

    /// Calls `sink` for each frame with the number of its line.
    pub fn each_frame(
        &mut self,
        progress: &dyn Fn(u64),
        mut sink: impl FnMut(u64, &Line),
    ) -> Result<OtherLines, DataError> {
        let (path, format, mut lines) = (self.path, self.format, self.lines);
        let file = LineFile { path, file: &self.file, max_bytes: MAX_LINE_BYTES };
        let mut others = OtherLines::default();
        file.each_line(progress, |row, line| {
            match lines.read(line) {
                Frames::Line(frame) => sink(row, &frame),
                Frames::Bad(error) => others.malformed.add(|| {
                    let (column, found) = ("(all)".into(), quoted(line));
                    let expected = error.expected(format).into();
                    BadCell { file: path.into(), row, column, found, expected }
                }),
                // The tools of Vector and PEAK write a header and many lines without frames.
                Frames::None if format == TextFormat::Candump && !line.trim_ascii().is_empty() => {
                    others.count += 1;
                }
                Frames::None => {}
            }
            Ok(())
        })?;
        Ok(others)
    }

    /// Returns the identifiers of the frames, for an error.
    pub fn census(&mut self) -> Result<Census, DataError> {
        let io = |source| DataError::Io { file: self.path.into(), source };
        self.file.rewind().map_err(io)?;
        Census::of(BufReader::new(&self.file)).map_err(io)
    }
}
