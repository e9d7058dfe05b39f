//! All of a file, or the file as it was.
//!
//! A report that a full disk or a pressed Ctrl-C cut in half looks like a report. So the bytes
//! go to a nameless neighbour first, are handed to the disk, and only then take the file's name,
//! which the operating system does in one step. Whatever fails before that leaves the old file
//! alone, and the neighbour is removed.

use std::io::{self, Write};
use std::path::Path;

/// Makes `bytes` the whole content of `file`, whose folder must be there.
///
/// # Errors
/// When the folder is missing or closed to us, the disk is full, or `file` is a folder. The error
/// does not name the file; what was there before still is.
pub fn write_atomically(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut neighbour = neighbour().tempfile_in(folder)?;
    neighbour.write_all(bytes)?;
    neighbour.as_file().sync_all()?;
    neighbour.persist(file).map_err(|failed| failed.error)?;
    Ok(())
}

/// Temporary files are for their owner alone; a report gets the rights any new file gets.
fn neighbour() -> tempfile::Builder<'static, 'static> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".unfinished-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder
}
