//! The supported log formats, one module each.
//!
//! The first bytes of a file identify its format, not its name: a `.csv` may be packed, come from a spreadsheet in
//! UTF-16, or be a CAN log. Each [`LogFormat`] tests whether a file is in that format, and reads it to a [`LogTable`]. Known
//! unsupported files get an error that names their type, instead of a hundred bad rows.

#[cfg(feature = "arrow")]
mod arrow_file;
#[cfg(feature = "arrow")]
mod arrow_messages;
mod can_trace;
#[cfg(feature = "mcap")]
mod cdr;
mod channel_clocks;
mod codesys_trace;
mod csv_file;
mod encoding;
mod format;
mod json_document;
mod json_lines;
#[cfg(any(test, not(all(feature = "arrow", feature = "mcap", feature = "parquet"))))]
mod left_out;
mod line;
mod lines;
#[cfg(feature = "mcap")]
mod mcap_file;
mod not_a_log;
mod number_style;
#[cfg(feature = "parquet")]
mod parquet_file;
#[cfg(feature = "parquet")]
mod parquet_zstd;
mod preamble;
mod records;
mod sysid;
mod unpack;

#[cfg(feature = "parquet")]
pub use parquet_file::parquet_table;

use super::error::DataError;
use super::log_table::LogTable;
use super::plan::Request;
use crate::setting::Setting;
use encoding::encoding;
use format::{HEAD_BYTES, Input, LogFormat};
use std::fs::File;
use std::io::{Read, Seek};
use std::path::Path;
use unpack::{Unpacked, is_packed, unpack};

/// The formats, in the order they are tried. Any other text is a table.
const FORMATS: &[LogFormat] = &[
    can_trace::FORMAT,
    #[cfg(feature = "mcap")]
    mcap_file::FORMAT,
    #[cfg(not(feature = "mcap"))]
    left_out::MCAP,
    #[cfg(feature = "parquet")]
    parquet_file::FORMAT,
    #[cfg(not(feature = "parquet"))]
    left_out::PARQUET,
    #[cfg(feature = "arrow")]
    arrow_file::FORMAT,
    #[cfg(not(feature = "arrow"))]
    left_out::ARROW,
    codesys_trace::FORMAT,
    sysid::FORMAT,
    json_lines::FORMAT,
    csv_file::FORMAT,
];

/// Returns the size of a file, bytes.
pub(super) fn file_size(path: &Path) -> Result<u64, DataError> {
    let about =
        std::fs::metadata(path).map_err(|source| DataError::Io { file: path.into(), source })?;
    if about.is_dir() {
        return Err(DataError::file(path, "a directory", "a CSV or Parquet file"));
    }
    Ok(about.len())
}

/// Reads a file of `size` bytes in any supported format, which may be packed with gzip or zip.
pub(super) fn read_file(request: Request, size: u64) -> Result<LogTable<'static>, DataError> {
    let path = request.path;
    let io = |source| DataError::Io { file: path.into(), source };
    let mut file = File::open(path).map_err(io)?;
    let head = read_head(&mut file).map_err(io)?;
    let Some(unpacked) = unpack(path, &file, &head)? else {
        return read_unpacked(request, path, file, size);
    };
    let Unpacked { file, size: unpacked_size, name } = unpacked;
    let scale = size as f64 / unpacked_size.max(1) as f64;
    let of_archive = |bytes: u64| (request.progress)((bytes as f64 * scale) as u64);
    let inside = Request { progress: &of_archive, ..request };
    let mut table = read_unpacked(inside, &name, file, unpacked_size)?;
    table.notes.push(format!("{}: the log is {} in the archive", path.display(), name.display()));
    Ok(table)
}

/// Returns the first bytes of a file, and goes back to its start.
fn read_head(file: &mut File) -> std::io::Result<Vec<u8>> {
    let mut head = Vec::new();
    file.rewind()?;
    file.by_ref().take(HEAD_BYTES).read_to_end(&mut head)?;
    file.rewind()?;
    Ok(head)
}

/// Reads a file that is not packed. `name` is its own name; the request has that of the archive that it is in.
fn read_unpacked(
    request: Request,
    name: &Path,
    mut file: File,
    size: u64,
) -> Result<LogTable<'static>, DataError> {
    let path = request.path;
    let head =
        read_head(&mut file).map_err(|source| DataError::Io { file: path.into(), source })?;
    refuse_other_files(path, name, &head)?;
    let skip = request.options.skip_lines;
    let format = if skip > 0 {
        refuse_without_lines(path, &head, skip)?;
        &csv_file::FORMAT
    } else {
        FORMATS.iter().find(|format| (format.matches)(&head)).unwrap_or(&csv_file::FORMAT)
    };
    (format.read)(Input { request, file, head: &head, size })?.widen(request)
}

/// Reads a table as text that is in memory. `path` is its name in messages.
///
/// # Errors
/// As a file, and for every other format: archives and binary formats need a file.
pub(super) fn read_content(request: Request, bytes: &[u8]) -> Result<LogTable<'static>, DataError> {
    let (path, skip) = (request.path, request.options.skip_lines);
    let head = &bytes[..bytes.len().min(HEAD_BYTES as usize)];
    let wrong = |found: &str, expected: &str| DataError::file(path, found, expected);
    if is_packed(head) {
        return Err(wrong("an archive", "the table in it: unpack it"));
    }
    refuse_other_files(path, path, head)?;
    if skip > 0 {
        refuse_without_lines(path, head, skip)?;
        return csv_file::read_bytes(request, bytes)?.widen(request);
    }
    let is_binary = head.contains(&0) && encoding(head).is_none();
    // The last format matches every text.
    let is_other = FORMATS[..FORMATS.len() - 1].iter().any(|format| (format.matches)(head));
    if is_binary || is_other {
        return Err(wrong("a log of another format", "a table as text (CSV)"));
    }
    csv_file::read_bytes(request, bytes)?.widen(request)
}

/// Refuses files that are known to be no log.
fn refuse_other_files(path: &Path, name: &Path, head: &[u8]) -> Result<(), DataError> {
    let Some((found, expected)) = not_a_log::recognise(head) else { return Ok(()) };
    let place = if name == path { String::new() } else { " in the archive".to_owned() };
    // tar unpacks gzip itself.
    let expected = expected.replace("tar -xf FILE", &format!("tar -xf {}", path.display()));
    Err(DataError::file(
        path,
        format!("{found}{place}"),
        expected.replace("FILE", &name.display().to_string()),
    ))
}

/// Refuses a file that has no table below the lines that the user skips.
fn refuse_without_lines(path: &Path, head: &[u8], skip: usize) -> Result<(), DataError> {
    let is_utf16 = encoding(head).is_some();
    let lines = head.iter().filter(|byte| **byte == b'\n').count();
    let found = if head.contains(&0) && !is_utf16 {
        "a binary file".to_owned()
    } else if lines <= skip {
        format!("{lines} lines in the first {} KiB", HEAD_BYTES / 1024)
    } else {
        return Ok(());
    };
    Err(DataError::request(
        format!("{}: {}", path.display(), Setting::SkipLines.given(skip)),
        found,
        "a table as text below the lines",
    ))
}
