//! Opens a page in Chromium, if it is installed.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Returns the Chromium on the search path; prints a message and returns `None` if there is none.
pub fn chromium() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let folders: Vec<PathBuf> =
        std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).collect();
    let found = names
        .iter()
        .flat_map(|name| folders.iter().map(move |folder| folder.join(name)))
        .find(|file| file.is_file());
    if found.is_none() {
        eprintln!("skipped: none of {} is installed", names.join(", "));
    }
    found
}

/// Opens the page with a new profile and waits until its script has run.
pub fn open(chromium: &Path, page: &Path, task: &str) -> Output {
    let profile = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(chromium);
    command.args([
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-dev-shm-usage",
        "--disable-background-networking",
        "--disable-component-update",
        "--disable-sync",
        "--disable-quic",
        "--no-first-run",
        "--enable-logging=stderr",
        "--v=0",
        "--window-size=1200,2400",
        "--virtual-time-budget=10000",
    ]);
    command.arg(format!("--user-data-dir={}", profile.path().display())).arg(task);
    command.arg(format!("file://{}", page.display())).output().expect("Chromium starts")
}
