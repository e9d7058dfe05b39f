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

/// First bytes of an Arrow file.
pub(super) const ARROW_FILE_MARK: &[u8] = b"ARROW1";

/// First bytes of a message of an Arrow stream.
const ARROW_STREAM_MARK: &[u8] = &[0xff, 0xff, 0xff, 0xff];

/// Returns true if a file that begins with `head` is an Arrow file or stream.
pub(super) fn is_arrow(head: &[u8]) -> bool {
    head.starts_with(ARROW_FILE_MARK) || head.starts_with(ARROW_STREAM_MARK)
}

/// Returns true if a file that begins with `head` is an MCAP recording.
pub(super) fn is_mcap(head: &[u8]) -> bool {
    head.starts_with(&[0x89, b'M', b'C', b'A', b'P', b'0'])
}

/// Returns true if a file that begins with `head` is a Parquet file.
pub(super) fn is_parquet(head: &[u8]) -> bool {
    head.starts_with(b"PAR1")
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
