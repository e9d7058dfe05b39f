//! The formats a log may be in: one file each, and this list.
//!
//! A file is known by its first bytes, never by its name: a `.csv` may be compressed, come from a
//! spreadsheet in UTF-16, or be a CAN log. Each [`Source`] says whether a beginning is its own, and hands
//! the rows of such a file to a [`Cleaner`](super::clean::Cleaner), which judges them alike whatever they
//! came from. What is known to be no log is told by its name instead of as a hundred bad rows.

mod can_trace;
#[cfg(feature = "mcap")]
mod cdr;
mod csv_file;
#[cfg(feature = "mcap")]
mod mcap_file;
mod not_a_log;
#[cfg(feature = "parquet")]
mod parquet_file;
mod preamble;
mod utf16;

use super::clean::FileData;
use super::error::DataError;
use super::read::ReadOptions;
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

/// A format of logs.
struct Source {
    /// Whether a file that begins so is in it.
    is_it: fn(head: &[u8]) -> bool,
    /// Reads such a file.
    read: fn(input: Input) -> Result<FileData, DataError>,
}

/// In the order they are asked. Text that is nothing else is a table.
const SOURCES: &[Source] = &[
    can_trace::SOURCE,
    #[cfg(feature = "mcap")]
    mcap_file::SOURCE,
    #[cfg(feature = "parquet")]
    parquet_file::SOURCE,
    csv_file::SOURCE,
];

/// Bytes of a file it is known by.
const HEAD: u64 = 64 * 1024;

/// A file to be read.
struct Input<'a> {
    path: &'a Path,
    /// It stands at its beginning.
    file: File,
    /// Its first bytes.
    head: &'a [u8],
    /// Its length in bytes.
    size: u64,
    /// How it is to be read.
    options: &'a ReadOptions,
    /// Is told the bytes done so far.
    progress: &'a dyn Fn(u64),
}

/// Reads a file of `size` bytes, whatever its format.
pub(super) fn read_file(
    path: &Path,
    size: u64,
    options: &ReadOptions,
    progress: &dyn Fn(u64),
) -> Result<FileData, DataError> {
    let io = |source| DataError::Io { file: path.into(), source };
    let mut file = File::open(path).map_err(io)?;
    let mut head = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut head).map_err(io)?;
    file.rewind().map_err(io)?;
    if let Some((found, expected)) = not_a_log::recognise(&head) {
        return Err(DataError::File {
            file: path.into(),
            found: found.into(),
            expected: expected.into(),
        });
    }
    let source = SOURCES.iter().find(|source| (source.is_it)(&head)).unwrap_or(&csv_file::SOURCE);
    (source.read)(Input { path, file, head: &head, size, options, progress })
}
