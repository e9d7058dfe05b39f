//! Collects the texts of refusals: an image sends their numbers, and a PC that reads them needs all texts of this version.
//!
//! A text is the literal of a `text!` or `refusal!`. Texts that macros make of lists of fields are tables of the crates already.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Writes `texts.rs`, the expression of an array of the texts in these folders of sources.
pub fn write(folders: &[PathBuf], out: &Path) {
    let mut literals = BTreeSet::new();
    for folder in folders {
        println!("cargo::rerun-if-changed={}", folder.display());
        let before = literals.len();
        collect(folder, &mut literals);
        assert!(literals.len() > before, "{}: no text! and no refusal!", folder.display());
    }
    let texts: String =
        literals.iter().map(|text| format!("    compensator_core::text!(\"{text}\"),\n")).collect();
    let file = out.join("texts.rs");
    done(&file, fs::write(&file, format!("[\n{texts}]\n")));
}

/// Returns the value of an operation on a file or folder, or ends the build.
fn done<T>(path: &Path, result: io::Result<T>) -> T {
    result.unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Start of the tests at the end of a file. The attribute alone stands before other items too, which have texts behind them.
const TESTS: &str = "#[cfg(test)]\nmod tests {";

/// Adds the literals of all sources of a folder, without those of tests at the end of a file and of documentation.
fn collect(folder: &Path, literals: &mut BTreeSet<String>) {
    for entry in done(folder, fs::read_dir(folder)) {
        let path = done(folder, entry).path();
        if path.is_dir() {
            collect(&path, literals);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            collect_source(&path, literals);
        }
    }
}

fn collect_source(path: &Path, literals: &mut BTreeSet<String>) {
    let source = done(path, fs::read_to_string(path));
    let shipped = source.split(TESTS).next().unwrap_or_default();
    let code: Vec<_> =
        shipped.lines().filter(|line| !line.trim_start().starts_with("//")).collect();
    let code = code.join("\n");
    for name in ["text!(", "refusal!("] {
        for argument in code.split(name).skip(1).map(str::trim_start) {
            // What macros make of their arguments.
            if argument.starts_with('$') || argument.starts_with("stringify!") {
                continue;
            }
            let text = literal(argument).unwrap_or_else(|| {
                let line = argument.lines().next().unwrap_or_default();
                panic!("{}: expected a literal after {name}, found {line}", path.display())
            });
            literals.insert(text.to_owned());
        }
    }
}

/// Returns what stands between the quotes of the literal at the start of a source, with its escapes; `None` without one.
fn literal(source: &str) -> Option<&str> {
    let text = source.strip_prefix('"')?;
    let mut is_escaped = false;
    let end = text.find(|letter| {
        let is_end = letter == '"' && !is_escaped;
        is_escaped = letter == '\\' && !is_escaped;
        is_end
    })?;
    text.get(..end).filter(|text| !text.is_empty())
}
