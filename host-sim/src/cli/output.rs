//! Where results go.

use clap::Args;
use std::path::{Path, PathBuf};

/// Where results go.
#[derive(Args, Clone, Debug)]
pub struct OutputArguments {
    /// Folder for the result files; made if it is not there
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,
    /// Print the result as JSON instead of tables
    #[arg(long)]
    pub json: bool,
}

impl OutputArguments {
    /// Writes all files, each whole or not at all.
    ///
    /// # Errors
    /// One line that names the file.
    pub fn write(&self, files: &[(&str, &str)]) -> Result<(), String> {
        let failed = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
        std::fs::create_dir_all(&self.out).map_err(|error| failed(&self.out, error))?;
        for (name, content) in files {
            let path = self.out.join(name);
            crate::report::write_atomically(&path, content.as_bytes())
                .map_err(|error| failed(&path, error))?;
        }
        Ok(())
    }
}
