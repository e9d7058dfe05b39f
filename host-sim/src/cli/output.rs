//! Where results go.

use super::terminal;
use clap::Args;
use rustix::termios::tcgetwinsize;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::{Path, PathBuf};

/// Where results go.
#[derive(Args, Clone, Debug)]
pub struct OutputArguments {
    /// Folder for the result files, made if it is not there; without it `out`, and of a command on logs one for each
    /// command and log in there, as `out/diagnose-my-log`
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the result as JSON instead of tables
    #[arg(long)]
    pub json: bool,
}

/// The folder where none is asked for.
const OUT: &str = "out";

impl OutputArguments {
    /// Where the files go.
    pub fn folder(&self) -> &Path {
        self.out.as_deref().unwrap_or(Path::new(OUT))
    }

    /// The same for a command on logs: unless a folder was asked for, it is one of this command and these logs, so that
    /// no result takes the place of another's.
    #[must_use]
    pub fn of_run(&self, command: &str, logs: &[PathBuf]) -> Self {
        let own = || Path::new(OUT).join(run_name(command, logs));
        Self { out: Some(self.out.clone().unwrap_or_else(own)), json: self.json }
    }

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
        let out = self.folder();
        std::fs::create_dir_all(out).map_err(|error| failed(out, error))?;
        let taken = files.iter().map(|(name, _)| out.join(name)).find(|path| path.is_dir());
        if let Some(path) = taken {
            return Err(failed(&path, ErrorKind::IsADirectory.into()));
        }
        for (name, content) in files {
            let path = out.join(name);
            let folder = path.parent().unwrap_or(out);
            std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
            crate::report::write_atomically(&path, content)
                .map_err(|error| failed(&path, error))?;
        }
        Ok(())
    }
}

/// `diagnose-my-log`: the first log's name as every file system takes it, and how many more there are.
fn run_name(command: &str, logs: &[PathBuf]) -> String {
    let first = logs.first().map_or(Path::new(""), PathBuf::as_path);
    let stem = |path: &Path| path.file_stem().map(|stem| file_name(&stem.to_string_lossy()));
    let mut name = format!("{command}-{}", stem(first).unwrap_or_default());
    if logs.len() > 1 {
        name += &format!("-and-{}-more", logs.len() - 1);
    }
    name
}

/// What of a name every file system takes, at most 40 characters of it.
pub fn file_name(name: &str) -> String {
    let kept = |letter: char| {
        if letter.is_ascii_alphanumeric() || letter == '_' { letter } else { '-' }
    };
    name.chars().take(40).map(kept).collect()
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_has_a_folder_of_its_own_unless_one_is_asked_for() {
        let logs = ["logs/my log.v2.csv", "b.csv", "c.csv"].map(PathBuf::from);
        let asked = OutputArguments { out: Some("there".into()), json: true };
        let not_asked = OutputArguments { out: None, json: false };
        assert_eq!(not_asked.folder(), Path::new("out"));
        for (output, logs, folder) in [
            (&asked, &logs[..], "there"),
            (&not_asked, &logs[..1], "out/diagnose-my-log-v2"),
            (&not_asked, &logs[..], "out/diagnose-my-log-v2-and-2-more"),
        ] {
            let of_run = output.of_run("diagnose", logs);
            assert_eq!(of_run.folder(), Path::new(folder));
            assert_eq!(of_run.json, output.json);
        }
    }
}
