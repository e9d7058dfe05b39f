//! Writes worlds of a family as CSV files with their truth, for programs that grade an engine on files.
//!
//! ```text
//! cargo run --release -p unkind-worlds --example write_worlds -- FAMILY BASE COUNT DIR
//! ```
//!
//! FAMILY is `training`, `lubricated-seal` or `mixed`. Worlds that the folder already holds are kept.

use rayon::prelude::*;
use std::path::{Path, PathBuf};
use unkind_worlds::{Family, draw_family, seeds};

/// Why the worlds are not written.
#[derive(Debug, thiserror::Error)]
enum WriteError {
    #[error("expected FAMILY BASE COUNT DIR")]
    Usage,
    #[error("FAMILY: unknown name")]
    Family,
    #[error("{argument}: {error}")]
    Number { argument: &'static str, error: std::num::ParseIntError },
    #[error("{}: {error}", path.display())]
    File { path: PathBuf, error: std::io::Error },
}

fn main() -> Result<(), WriteError> {
    let given: Vec<String> = std::env::args().skip(1).collect();
    let [family, base, count, folder] = given.as_slice() else { return Err(WriteError::Usage) };
    let family = Family::parse(family).ok_or(WriteError::Family)?;
    let number = |argument| move |error| WriteError::Number { argument, error };
    let base: u64 = base.parse().map_err(number("BASE"))?;
    let count: usize = count.parse().map_err(number("COUNT"))?;
    std::fs::create_dir_all(folder)
        .map_err(|error| WriteError::File { path: folder.into(), error })?;
    // A bridge, so that the worlds are written in the order of their seeds.
    seeds(base).take(count).par_bridge().try_for_each(|seed| write(Path::new(folder), family, seed))
}

fn write(folder: &Path, family: Family, seed: u64) -> Result<(), WriteError> {
    let path = |end: &str| folder.join(format!("{}-{seed}{end}", family.name()));
    // The truth is written last: where it exists, the log is complete.
    if path(".json").exists() {
        return Ok(());
    }
    let world = draw_family(seed, family);
    for (end, text) in [(".csv", world.log.csv()), (".json", world.truth.json().to_string())] {
        std::fs::write(path(end), text)
            .map_err(|error| WriteError::File { path: path(end), error })?;
    }
    Ok(())
}
