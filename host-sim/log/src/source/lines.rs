//! The lines of a file, one at a time.

use crate::error::DataError;
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek};
use std::path::Path;

/// Lines between two calls of the progress function.
const PROGRESS_LINES: u64 = 16 * 1024;

/// A file that is read line by line, from its start as often as needed.
#[derive(Clone, Copy)]
pub(super) struct LineFile<'a> {
    /// Its name in messages.
    pub path: &'a Path,
    pub file: &'a File,
    /// Maximum length of a line, bytes. A line of any length must not be held in memory: the rest of a longer one is skipped.
    pub max_bytes: u64,
}

impl LineFile<'_> {
    /// Calls `add` with the number, from 1, and the text of each line, and `progress` with the bytes read so far.
    pub fn each_line(
        self,
        progress: &dyn Fn(u64),
        mut add: impl FnMut(u64, &[u8]) -> Result<(), DataError>,
    ) -> Result<(), DataError> {
        let io = |source| DataError::Io { file: self.path.into(), source };
        let mut file = self.file;
        file.rewind().map_err(io)?;
        let mut reader = BufReader::with_capacity(1 << 20, file);
        let mut line = Vec::with_capacity(256);
        let (mut number, mut bytes) = (0, 0);
        loop {
            let is_rest = line.len() as u64 == self.max_bytes && !line.ends_with(b"\n");
            line.clear();
            let mut part = reader.by_ref().take(self.max_bytes);
            let length = part.read_until(b'\n', &mut line).map_err(io)?;
            if length == 0 {
                return Ok(());
            }
            bytes += length as u64;
            if is_rest {
                continue;
            }
            number += 1;
            if number % PROGRESS_LINES == 0 {
                progress(bytes);
            }
            add(number, &line)?;
        }
    }
}
