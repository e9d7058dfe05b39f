//! Atomic writing of files.
//!
//! A full disk or Ctrl-C must not leave a truncated report. The bytes are written to a temporary file in the same
//! folder and flushed to disk. The temporary file is then renamed, which the operating system does in one step. If an
//! earlier step fails, the old file is unchanged and the temporary file is removed.

use std::io::{self, Write};
use std::path::Path;

/// Writes `bytes` to `file` atomically. The folder must exist.
///
/// # Errors
/// Returns an error if the folder is missing or not writable, the disk is full, or `file` is a folder. The error does not
/// name the file. An existing file is unchanged.
pub fn write_atomically(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut temporary = temporary_file_builder().tempfile_in(folder)?;
    temporary.write_all(bytes)?;
    temporary.as_file().sync_all()?;
    temporary.persist(file).map_err(|failed| failed.error)?;
    Ok(())
}

/// Temporary files are readable by their owner only; this builder gives them the permissions of a new file.
fn temporary_file_builder() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".unfinished-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder
}
