//! Where the tests find the logs of real machines.
//!
//! `tests/data/measured` holds excerpts, which every run reads. With `LONG_TESTS` the full files are read: those of the folder
//! in `MEASURED_DATA`, by default `../shared/data` beside the workspace. `tests/measured.py` does the same for scripts.

use std::path::{Path, PathBuf};

/// A set of measured logs: the excerpts or the full files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeasuredLogs {
    folder: PathBuf,
    is_full: bool,
}

fn data_folder() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Returns the folder of the full files, whether it exists or not.
fn full_folder() -> PathBuf {
    let default_folder = || data_folder().join("../../../shared/data");
    std::env::var_os("MEASURED_DATA").map_or_else(default_folder, PathBuf::from)
}

impl MeasuredLogs {
    /// Returns the excerpts of the repository.
    pub fn excerpts() -> Self {
        Self { folder: data_folder().join("measured"), is_full: false }
    }

    /// Returns the full files, or `None` if they do not exist.
    pub fn full() -> Option<Self> {
        let folder = full_folder();
        folder.join("worm-drive.csv").is_file().then_some(Self { folder, is_full: true })
    }

    /// Returns the full files if `LONG_TESTS` is set and they exist, else the excerpts.
    ///
    /// Prints that the full files are skipped if `LONG_TESTS` is set and they do not exist.
    pub fn of_this_run() -> Self {
        if std::env::var_os("LONG_TESTS").is_none() {
            return Self::excerpts();
        }
        Self::full().unwrap_or_else(|| {
            println!("skipped: the full measured logs (MEASURED_DATA); excerpts are read");
            Self::excerpts()
        })
    }

    /// Returns true for the full files.
    pub fn is_full(&self) -> bool {
        self.is_full
    }

    /// Returns the folder of these logs.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns the path of a log. `name` is the name of the full file, such as `worm-drive.csv`.
    pub fn file(&self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        if self.is_full { path } else { path.with_extension("parquet") }
    }
}

/// Returns the path of a packed made-up log of `tests/data/cases`, such as that of `clock-stands-still.csv`.
pub fn case_log(name: &str) -> PathBuf {
    data_folder().join("cases").join(format!("{name}.gz"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn excerpts_stay_below_their_size_limit() {
        let folder = MeasuredLogs::excerpts();
        let entries = std::fs::read_dir(folder.folder()).expect("the folder");
        let bytes: u64 =
            entries.map(|entry| entry.expect("an entry").metadata().expect("a size").len()).sum();
        assert!((1_000_000..3_000_000).contains(&bytes), "{bytes} bytes");
    }

    #[test]
    fn notice_names_every_excerpt() {
        let notice = std::fs::read_to_string(data_folder().join("NOTICE")).expect("the notice");
        for entry in std::fs::read_dir(MeasuredLogs::excerpts().folder()).expect("the folder") {
            let name = entry.expect("an entry").file_name().into_string().expect("UTF-8");
            assert!(notice.contains(&format!("`{name}`")), "NOTICE lacks {name}");
        }
    }
}
