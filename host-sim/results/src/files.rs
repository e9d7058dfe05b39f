//! The result files of a command for one joint.

use crate::ResultError;
use serde::Serialize;
use std::io;
use std::path::Path;

/// Result files by name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Files {
    /// Name and text of the JSON document.
    pub document: (&'static str, String),
    /// Names and contents of the other files.
    pub others: Vec<(&'static str, Vec<u8>)>,
}

impl Files {
    /// Returns names and contents of all files, the document last.
    pub fn all(&self) -> impl Iterator<Item = (&'static str, &[u8])> {
        let document = (self.document.0, self.document.1.as_bytes());
        self.others.iter().map(|(name, content)| (*name, &**content)).chain([document])
    }

    /// Writes all files into a folder, which is created if missing. Each is written completely or not at all.
    ///
    /// # Errors
    /// If the folder cannot be created, or a file cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        std::fs::create_dir_all(folder)?;
        self.all()
            .try_for_each(|(name, content)| crate::write_atomically(&folder.join(name), content))
    }
}

/// Formats a document for a file: indented, with a line end.
///
/// # Errors
/// One line, if a value cannot be represented in JSON.
pub fn pretty(document: &impl Serialize) -> Result<String, ResultError> {
    Ok(serde_json::to_string_pretty(document)? + "\n")
}
