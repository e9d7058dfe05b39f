//! The interface of a log format.

use crate::clean::FileData;
use crate::error::DataError;
use crate::options::ReadOptions;
use std::fs::File;
use std::path::Path;

/// A log format.
pub(super) struct LogFormat {
    /// Returns true if a file that begins with `head` is in this format.
    pub matches: fn(head: &[u8]) -> bool,
    /// Reads such a file.
    pub read: fn(input: Input) -> Result<FileData, DataError>,
}

/// Number of bytes at the start of a file that identify its format.
pub(super) const HEAD_BYTES: u64 = 64 * 1024;

/// A file to be read.
pub(super) struct Input<'a> {
    pub path: &'a Path,
    /// The file, at its start.
    pub file: File,
    /// Its first [`HEAD_BYTES`] bytes.
    pub head: &'a [u8],
    /// Its length, bytes.
    pub size: u64,
    /// How it is to be read.
    pub options: &'a ReadOptions,
    /// Called with the number of bytes read so far.
    pub progress: &'a dyn Fn(u64),
}
