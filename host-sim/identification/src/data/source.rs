//! The supported log formats, one module each.
//!
//! The first bytes of a file identify its format, not its name: a `.csv` may be compressed, come from a spreadsheet in
//! UTF-16, or be a CAN log. Each [`LogFormat`] tests whether a file is in that format, and passes its rows to a
//! [`Cleaner`](super::clean::Cleaner), which validates them alike for all formats. Known unsupported files get an
//! error that names their type, instead of a hundred bad rows.

mod can_trace;
#[cfg(feature = "mcap")]
mod cdr;
mod csv_file;
mod format;
#[cfg(feature = "mcap")]
mod mcap_file;
mod not_a_log;
#[cfg(feature = "parquet")]
mod parquet_file;
mod preamble;
mod separator;
mod utf16;

use super::clean::FileData;
use super::error::DataError;
use super::options::ReadOptions;
use format::{HEAD_BYTES, Input, LogFormat};
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;

/// The formats, in the order they are tried. Any other text is a table.
const FORMATS: &[LogFormat] = &[
    can_trace::FORMAT,
    #[cfg(feature = "mcap")]
    mcap_file::FORMAT,
    #[cfg(feature = "parquet")]
    parquet_file::FORMAT,
    csv_file::FORMAT,
];

/// Reads a file of `size` bytes in any supported format.
pub(super) fn read_file(
    path: &Path,
    size: u64,
    options: &ReadOptions,
    progress: &dyn Fn(u64),
) -> Result<FileData, DataError> {
    let io = |source| DataError::Io { file: path.into(), source };
    let mut file = File::open(path).map_err(io)?;
    let mut head = Vec::new();
    file.by_ref().take(HEAD_BYTES).read_to_end(&mut head).map_err(io)?;
    file.rewind().map_err(io)?;
    if let Some((found, expected)) = not_a_log::recognise(&head) {
        return Err(DataError::File {
            file: path.into(),
            found: found.into(),
            expected: expected.replace("FILE", &path.display().to_string()),
        });
    }
    let format = FORMATS.iter().find(|format| (format.matches)(&head)).unwrap_or(&csv_file::FORMAT);
    (format.read)(Input { path, file, head: &head, size, options, progress })
}
