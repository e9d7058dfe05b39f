//! Where results go.

use super::terminal;
use clap::Args;
use rustix::termios::tcgetwinsize;
use std::io::{ErrorKind, IsTerminal, Write};
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
    /// Writes all files, each whole or not at all, and none where one of the names is taken by a
    /// folder.
    ///
    /// # Errors
    /// One line that names the file.
    pub fn write(&self, files: &[(&str, &str)]) -> Result<(), String> {
        let bytes: Vec<(&str, &[u8])> =
            files.iter().map(|(name, text)| (*name, text.as_bytes())).collect();
        self.write_bytes(&bytes)
    }

    /// The same for files that are no text.
    ///
    /// # Errors
    /// As [`OutputArguments::write`].
    pub fn write_bytes(&self, files: &[(&str, &[u8])]) -> Result<(), String> {
        let failed = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
        std::fs::create_dir_all(&self.out).map_err(|error| failed(&self.out, error))?;
        let taken = files.iter().map(|(name, _)| self.out.join(name)).find(|path| path.is_dir());
        if let Some(path) = taken {
            return Err(failed(&path, ErrorKind::IsADirectory.into()));
        }
        for (name, content) in files {
            let path = self.out.join(name);
            let folder = path.parent().unwrap_or(&self.out);
            std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
            crate::report::write_atomically(&path, content)
                .map_err(|error| failed(&path, error))?;
        }
        Ok(())
    }
}

/// Prints what a person reads: on a terminal in its width and with colour (unless `NO_COLOR` is set), else as it is.
///
/// # Errors
/// As [`say`].
pub fn tell(text: &str) -> Result<(), String> {
    let out = std::io::stdout();
    if !out.is_terminal() {
        return say(text);
    }
    let width = tcgetwinsize(&out).map_or(80, |size| usize::from(size.ws_col));
    let colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    say(&terminal::laid_out(text, width.clamp(40, 120), colour))
}

/// Prints on standard output. A reader that has seen enough (`| head`) is no error: the files are
/// written by then.
///
/// # Errors
/// One line where standard output cannot be written to, as on a full disk.
pub fn say(text: &str) -> Result<(), String> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(format!("standard output: {error}"))
        }
        _ => Ok(()),
    }
}
