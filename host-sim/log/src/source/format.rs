//! The interface of a log format.

use crate::error::DataError;
use crate::log_table::LogTable;
use crate::plan::Request;
#[cfg(any(feature = "arrow", feature = "parquet"))]
use crate::work::Cancelled;
use std::fs::File;
#[cfg(any(feature = "arrow", feature = "parquet"))]
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
#[cfg(any(feature = "arrow", feature = "parquet"))]
use std::path::Path;

/// Nanoseconds of a second.
#[cfg(any(feature = "arrow", feature = "parquet"))]
pub(super) const SECOND_NS: i64 = 1_000_000_000;

/// Nanoseconds of a day.
#[cfg(any(feature = "arrow", feature = "parquet"))]
pub(super) const DAY_NS: i64 = 86_400 * SECOND_NS;

/// A log format.
pub(super) struct LogFormat {
    /// Returns true if a file that begins with `head` is in this format.
    pub matches: fn(head: &[u8]) -> bool,
    /// Reads such a file.
    pub read: fn(input: Input) -> Result<LogTable<'static>, DataError>,
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
    pub request: Request<'a>,
    /// The file, at its start.
    pub file: File,
    /// Its first [`HEAD_BYTES`] bytes.
    pub head: &'a [u8],
    /// Its length, bytes.
    pub size: u64,
}

/// Calls `read`, which uses a library that reports a few damaged files with a panic, for example a page that refers to a missing
/// dictionary. A damaged file must not look like a defect of this program, so a panic becomes an error.
#[cfg(any(feature = "arrow", feature = "parquet"))]
pub(super) fn read_damaged<T>(
    path: &Path,
    expected: &str,
    read: impl FnOnce() -> Result<T, DataError>,
) -> Result<T, DataError> {
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(|panic| {
        if panic.is::<Cancelled>() {
            resume_unwind(panic);
        }
        Err(DataError::file(path, "damaged data", expected))
    })
}
