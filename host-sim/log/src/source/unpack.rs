//! Logs packed with gzip or zip.
//!
//! The content is written to a temporary file, not to memory: a log may be larger than memory, and formats with their
//! index at the end need a file. A small archive may unpack to more than a disk holds, so the size is limited.

use super::not_a_log;
use crate::error::{DataError, listed, one_line};
use crate::setting::shell_word;
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufReader, Read, Seek, Write};
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// Maximum size of the content: this many bytes, plus [`MAX_RATIO`] times the size of the archive. Measured logs pack
/// to a third or a twentieth, and constant columns to a hundredth.
const MAX_SMALL_BYTES: u64 = 1 << 30;

/// See [`MAX_SMALL_BYTES`].
const MAX_RATIO: u64 = 200;

/// First bytes of a gzip archive with deflate, its only method.
const GZIP: &[u8] = &[0x1f, 0x8b, 0x08];

/// First bytes of a zip archive.
const ZIP: &[u8] = b"PK\x03\x04";

/// The content of an archive.
pub(super) struct Unpacked {
    /// At its start.
    pub file: File,
    /// Length, bytes.
    pub size: u64,
    /// Name of the file in the archive.
    pub name: PathBuf,
}

/// Returns true if a file that begins with `head` is an archive.
pub(super) fn is_packed(head: &[u8]) -> bool {
    head.starts_with(GZIP) || head.starts_with(ZIP)
}

/// Unpacks an archive that begins with `head`. Returns `None` for any other file.
///
/// # Errors
/// If the archive is damaged, does not hold one file, or is too large.
pub(super) fn unpack(path: &Path, file: &File, head: &[u8]) -> Result<Option<Unpacked>, DataError> {
    let io = |source| DataError::Io { file: path.into(), source };
    let packed_bytes = file.metadata().map_err(io)?.len();
    let limit = MAX_SMALL_BYTES.saturating_add(packed_bytes.saturating_mul(MAX_RATIO));
    let mut reader = BufReader::new(file);
    reader.rewind().map_err(io)?;
    if head.starts_with(GZIP) {
        let name = path.file_stem().map_or_else(|| path.into(), PathBuf::from);
        return copy(path, "gzip", MultiGzDecoder::new(reader), limit, name).map(Some);
    }
    if !head.starts_with(ZIP) {
        return Ok(None);
    }
    let damaged = |error: &dyn std::fmt::Display| {
        DataError::file(
            path,
            format!("a zip archive that cannot be read ({})", one_line(&error.to_string())),
            "an intact zip archive without a password",
        )
    };
    let mut archive = match ZipArchive::new(reader) {
        Ok(archive) => archive,
        Err(error) => {
            return Err(match not_a_log::in_zip(&|name| contains(head, name.as_bytes())) {
                Some((found, expected)) => DataError::file(path, found, with_path(expected, path)),
                None => damaged(&error),
            });
        }
    };
    let (index, name) = only_member(path, &archive)?;
    let member = archive.by_index(index).map_err(|error| damaged(&error))?;
    copy(path, "zip", member, limit, PathBuf::from(&name)).map(Some)
}

fn contains(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

/// Inserts the path into a command.
fn with_path(expected: &str, path: &Path) -> String {
    expected.replace("FILE", &path.display().to_string())
}

/// Returns the place and name of the only file in an archive.
fn only_member<R: Read + Seek>(
    path: &Path,
    archive: &ZipArchive<R>,
) -> Result<(usize, String), DataError> {
    let names = archive.file_names_raw().map(String::from_utf8_lossy);
    let all: Vec<String> = names.map(|name| name.into_owned()).collect();
    if let Some((found, expected)) =
        not_a_log::in_zip(&|name| all.iter().any(|of| of.contains(name)))
    {
        return Err(DataError::file(path, found, with_path(expected, path)));
    }
    // macOS adds its own files.
    let is_file = |(_, name): &(usize, String)| {
        !name.ends_with('/') && !name.starts_with("__MACOSX/") && !name.ends_with(".DS_Store")
    };
    let files: Vec<(usize, String)> = all.into_iter().enumerate().filter(is_file).collect();
    match &files[..] {
        [(index, name)] => Ok((*index, name.clone())),
        [] => Err(DataError::file(path, "a zip archive without a file", "one log in it")),
        [(_, first), ..] => {
            let (count, archive) = (files.len(), path.display());
            let files: Vec<&str> = files.iter().map(|(_, name)| &**name).collect();
            Err(DataError::file(
                path,
                format!("a zip archive of {count} files ({})", listed(&files)),
                format!(
                    "one file in it: unzip -p {} {1} > {1}",
                    shell_word(&archive.to_string()),
                    shell_word(&one_line(first))
                ),
            ))
        }
    }
}

/// Copies the content to a temporary file.
fn copy(
    path: &Path,
    kind: &str,
    mut content: impl Read,
    limit: u64,
    name: PathBuf,
) -> Result<Unpacked, DataError> {
    let io = |source| DataError::Io { file: path.into(), source };
    let mut file = tempfile::tempfile().map_err(io)?;
    let mut buffer = vec![0; 256 * 1024];
    let mut size = 0;
    loop {
        let count = content.read(&mut buffer).map_err(|error| {
            let error = one_line(&error.to_string());
            DataError::file(
                path,
                format!("a damaged {kind} archive ({error})"),
                format!("an intact {kind} archive"),
            )
        })?;
        if count == 0 {
            break;
        }
        size += count as u64;
        if size > limit {
            let found = format!("a {kind} archive of more than {} MB", limit >> 20);
            return Err(DataError::file(path, found, "a log: unpack it, and give the file itself"));
        }
        file.write_all(&buffer[..count]).map_err(io)?;
    }
    file.rewind().map_err(io)?;
    Ok(Unpacked { file, size, name })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copy_with_content_above_the_limit_returns_error() {
        let content = std::io::repeat(b'0').take(3 << 20);
        let error = copy(Path::new("a.gz"), "gzip", content, 2 << 20, "a".into()).err().unwrap();
        let parts = ["a.gz", "gzip", "2 MB"];
        crate::message::check("errors", "large archive", &error.to_string(), &parts);
        let whole = copy(Path::new("a.gz"), "gzip", &b"t,v"[..], 2 << 20, "a".into()).unwrap();
        assert_eq!(whole.size, 3);
    }
}
