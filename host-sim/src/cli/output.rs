//! Output of the commands: result files and standard output.

use super::error::{Refusal, Result, found, in_file};
use super::terminal;
use clap::Args;
use rustix::termios::tcgetwinsize;
use std::io::ErrorKind::{self, NotADirectory, NotFound};
use std::io::{IsTerminal, Write};
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Output folder and output format.
#[derive(Args, Clone, Debug, Default)]
pub struct OutputArguments {
    /// Folder for the result files; by default `out`, or one named after the log, such as `out/diagnose-my-log`
    ///
    /// It is created if missing, and files of the same names are replaced. Commands that read logs name their folder after
    /// command and path of the log: `out/diagnose-monday-my-log` for `monday/my-log.csv`.
    #[arg(long, value_name = "DIR", help_heading = "Output")]
    out: Option<PathBuf>,
    /// Print the result as JSON instead of tables
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// True if the folder belongs to one command and its logs. Only there, earlier results are removed.
    #[arg(skip)]
    is_run_folder: bool,
}

/// Default output folder.
const DEFAULT_FOLDER: &str = "out";

impl OutputArguments {
    /// Returns the output folder.
    pub fn folder(&self) -> &Path {
        self.out.as_deref().unwrap_or(Path::new(DEFAULT_FOLDER))
    }

    /// Returns the output arguments of a command with a folder of its own below the default one.
    #[must_use]
    pub fn of_command(&self, command: &str) -> Self {
        let default = || Path::new(DEFAULT_FOLDER).join(command);
        Self { out: Some(self.out.clone().unwrap_or_else(default)), ..self.clone() }
    }

    /// Returns the output arguments of a command that reads logs. Without `--out`, the folder is named after the command
    /// and the paths of the logs, so that results do not overwrite each other. Results that an earlier run of the command
    /// left there are removed, so that none stands beside new ones.
    #[must_use]
    pub fn of_run(&self, command: &str, logs: &[PathBuf]) -> Self {
        let default = || Path::new(DEFAULT_FOLDER).join(run_name(command, logs));
        let is_run_folder = self.out.is_none();
        Self { out: Some(self.out.clone().unwrap_or_else(default)), json: self.json, is_run_folder }
    }

    /// Writes the result files, and prints `document` with `--json`, otherwise `text` with the names of the files.
    ///
    /// # Errors
    /// See [`OutputArguments::write`].
    pub fn finish(&self, files: &[(&str, &[u8])], document: &str, text: &str) -> Result {
        let names: Vec<&str> = files.iter().map(|(name, _)| *name).collect();
        self.finish_as(files, &names, document, text)
    }

    /// As [`OutputArguments::finish`], with these names in place of those of the files.
    ///
    /// # Errors
    /// See [`OutputArguments::write`].
    pub fn finish_as(
        &self,
        files: &[(&str, &[u8])],
        names: &[&str],
        document: &str,
        text: &str,
    ) -> Result {
        self.write(files)?;
        if self.json {
            return print_text(document);
        }
        let out = self.folder().display();
        let written: Vec<String> = names.iter().map(|name| format!("{out}/{name}")).collect();
        print_formatted(&format!("{text}written: {}\n", written.join(", ")))
    }

    /// Returns an error if one of the files exists with other contents: that of another run, or one that the user changed.
    ///
    /// # Errors
    /// Returns one line that names the file, and the options that help or why it cannot be read.
    pub fn refuse_other_contents(&self, files: &[(&str, &[u8])]) -> Result {
        for (name, content) in files {
            let path = self.folder().join(name);
            let written = match std::fs::read(&path) {
                Err(error) if [NotFound, NotADirectory].contains(&error.kind()) => continue,
                written => written.map_err(in_file(&path))?,
            };
            if written != *content {
                let remedy = "none: write to another folder with --out, or replace it with --force";
                return Err(found(path.display().to_string(), "the file of another run", remedy));
            }
        }
        Ok(())
    }

    /// Writes files, each of them atomically. Writes none if one of the names is an existing folder.
    ///
    /// # Errors
    /// Returns one line that names the file.
    pub fn write(&self, files: &[(&str, &[u8])]) -> Result {
        let out = self.folder();
        std::fs::create_dir_all(out).map_err(in_file(out))?;
        if self.is_run_folder {
            remember_files(out, files.iter().map(|(name, _)| *name)).map_err(in_file(out))?;
        }
        let taken = files.iter().map(|(name, _)| out.join(name)).find(|path| path.is_dir());
        if let Some(path) = taken {
            return Err(in_file(&path)(ErrorKind::IsADirectory.into()));
        }
        for (name, content) in files {
            write_file(&out.join(name), content)?;
        }
        Ok(())
    }
}

/// File with the names of the results in the folder of a run, one per line.
const WRITTEN: &str = ".written";

/// Writes a file that the user names, and the folders above it.
///
/// # Errors
/// One line with the path and the reason.
pub fn write_file(file: &Path, content: &[u8]) -> Result {
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(in_file(folder))?;
    }
    friction_results::write_atomically(file, content).map_err(in_file(file))
}

/// Removes the results of an earlier process from the folder of a run, and notes the names of those to be written.
fn remember_files<'a>(
    folder: &Path,
    names: impl Iterator<Item = &'a str>,
) -> Result<(), std::io::Error> {
    static WRITTEN_TO: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
    let mut written_to = WRITTEN_TO.lock().unwrap_or_else(PoisonError::into_inner);
    let list = folder.join(WRITTEN);
    let mut known = std::fs::read_to_string(&list).unwrap_or_default();
    if !written_to.iter().any(|known| known == folder) {
        written_to.push(folder.to_owned());
        let is_inside = |name: &&str| {
            Path::new(name).components().all(|part| matches!(part, Component::Normal(_)))
        };
        for name in known.lines().filter(is_inside) {
            // A file that the user removed is no error.
            let _ = std::fs::remove_file(folder.join(name));
        }
        known.clear();
    }
    names.for_each(|name| known += &format!("{name}\n"));
    friction_results::write_atomically(&list, known.as_bytes())
}

/// Maximum length of the name of a path, characters.
const MAX_PATH_NAME: usize = 60;

/// Returns the folder name of a command and its logs: `diagnose-my-log`, `diagnose-monday-my-log` for a log in another
/// folder, or `diagnose-my-log-and-2-more`.
fn run_name(command: &str, logs: &[PathBuf]) -> String {
    let first = logs.first().map_or(Path::new(""), PathBuf::as_path);
    let mut name = format!("{command}-{}", path_name(first));
    if logs.len() > 1 {
        name += &format!("-and-{}-more", logs.len() - 1);
    }
    name
}

/// Returns a path as one name. The default output folder is left out of it, and the start of a long path.
fn path_name(path: &Path) -> String {
    let folder = path.parent().unwrap_or(Path::new(""));
    let folder = folder.strip_prefix(DEFAULT_FOLDER).unwrap_or(folder);
    let folders = folder.components().filter_map(|part| match part {
        Component::Normal(name) => Some(name),
        _ => None,
    });
    let parts: Vec<String> =
        folders.chain(path.file_stem()).map(|part| file_name(&part.to_string_lossy())).collect();
    let name = parts.join("-");
    let surplus = name.chars().count().saturating_sub(MAX_PATH_NAME);
    name.chars().skip(surplus).collect::<String>().trim_start_matches('-').to_owned()
}

/// Returns at most 40 characters of a name, with every character that a file system may reject replaced by `-`.
pub fn file_name(name: &str) -> String {
    let kept = |letter: char| {
        if letter.is_ascii_alphanumeric() || letter == '_' { letter } else { '-' }
    };
    name.chars().take(40).map(kept).collect()
}

/// Returns a result as indented JSON with a line end.
///
/// # Errors
/// Returns one line if the result has no JSON form.
pub fn pretty(result: &impl serde::Serialize) -> Result<String> {
    Ok(serde_json::to_string_pretty(result)? + "\n")
}

/// Prints a result as JSON, or as the text for a reader.
///
/// # Errors
/// See [`pretty`] and [`print_text`].
pub fn print_result(json: bool, result: &impl serde::Serialize, text: &str) -> Result {
    if json { print_text(&pretty(result)?) } else { print_text(text) }
}

/// Prints a text for the user. On a terminal, the text is wrapped to its width and coloured unless `NO_COLOR` is set.
///
/// # Errors
/// See [`print_text`].
pub fn print_formatted(text: &str) -> Result {
    let out = std::io::stdout();
    if !out.is_terminal() {
        return print_text(text);
    }
    let width = tcgetwinsize(&out).map_or(80, |size| usize::from(size.ws_col));
    let colour = std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    print_text(&terminal::format_for_terminal(text, width.clamp(40, 120), colour))
}

/// Prints a message on standard error. On a terminal it is wrapped to its width.
pub fn print_message(line: &str) {
    let err = std::io::stderr();
    if !err.is_terminal() {
        eprintln!("{line}");
        return;
    }
    let width = tcgetwinsize(&err).map_or(80, |size| usize::from(size.ws_col));
    eprint!("{}", terminal::format_for_terminal(line, width.clamp(40, 120), false));
}

/// Asks the user a question on the terminal. Returns true for yes.
///
/// # Errors
/// Standard input cannot be read.
pub fn is_answered_yes(question: &str) -> std::io::Result<bool> {
    eprint!("{question} [y/N] ");
    let _ = std::io::stderr().flush();
    let mut answer = String::new();
    std::io::stdin().read_line(&mut answer)?;
    Ok(matches!(answer.trim(), "y" | "Y" | "yes"))
}

/// Prints a text unchanged on standard output. A closed pipe (`| head`) is not an error, because the result files are
/// already written.
///
/// # Errors
/// Returns one line if writing to standard output fails, for example on a full disk.
pub fn print_text(text: &str) -> Result {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Refusal::Output(error).into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_run_without_out_option_names_folder_after_command_and_logs() {
        let logs = ["my log.v2.csv", "b.csv", "c.csv"].map(PathBuf::from);
        let with_folder =
            OutputArguments { out: Some("there".into()), json: true, is_run_folder: false };
        let without_folder = OutputArguments { out: None, json: false, is_run_folder: false };
        assert_eq!(without_folder.folder(), Path::new("out"));
        for (output, logs, folder) in [
            (&with_folder, &logs[..], "there"),
            (&without_folder, &logs[..1], "out/diagnose-my-log-v2"),
            (&without_folder, &logs[..], "out/diagnose-my-log-v2-and-2-more"),
        ] {
            let of_run = output.of_run("diagnose", logs);
            assert_eq!(of_run.folder(), Path::new(folder));
            assert_eq!(of_run.json, output.json);
            assert_eq!(
                of_run.is_run_folder,
                output.out.is_none(),
                "a given folder keeps its files"
            );
        }
    }

    #[test]
    fn refuse_other_contents_accepts_only_the_same_file_or_none() {
        let folder = tempfile::tempdir().expect("a folder");
        let output = OutputArguments { out: Some(folder.path().into()), ..Default::default() };
        let refused = |name| output.refuse_other_contents(&[(name, b"new")]).err();
        std::fs::write(folder.path().join("same"), "new").expect("written");
        std::fs::write(folder.path().join("other"), "old").expect("written");
        // As a file without the right to read it, a folder cannot be compared.
        std::fs::create_dir(folder.path().join("folder")).expect("made");
        assert!(refused("same").is_none() && refused("none").is_none());
        for name in ["other", "folder"] {
            let error = refused(name).expect("refused").to_string();
            assert!(error.contains(name), "{error}");
        }
    }

    #[test]
    fn path_name_with_same_file_in_two_folders_differs() {
        for (path, name) in [
            ("log.csv", "log"),
            ("./log.csv", "log"),
            ("out/data.csv", "data"),
            ("a/log.csv", "a-log"),
            ("b/log.csv", "b-log"),
            ("/data/b/log.csv", "data-b-log"),
            ("../b/log.csv", "b-log"),
        ] {
            assert_eq!(path_name(Path::new(path)), name, "{path}");
        }
        let long = format!("{}/log.csv", "folder/".repeat(20));
        assert!(path_name(Path::new(&long)).ends_with("folder-log"));
    }
}
