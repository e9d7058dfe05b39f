//! Sentences of the product, compared with a file in git: a rewording changes one file, renewed by `tests/snapshots`.
//!
//! A test program includes this file with `#[path]`. Its tests assert kinds, names, figures and exit codes themselves.

use std::path::Path;
use std::sync::Mutex;
use std::{env, fs};

/// Tests of one program write their sections in turn.
static FILE: Mutex<()> = Mutex::new(());
const HEADING: &str = "== ";

/// Compares `text`, with figures and folders masked, with the section `section` of `tests/snapshots/FILE.txt` of the
/// package. `UPDATE_SNAPSHOTS=1` writes the section instead.
///
/// # Panics
///
/// Panics if the section is missing or differs, and shows the first line that differs.
#[track_caller]
pub fn check(file: &str, section: &str, text: &str) {
    let _guard = FILE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/snapshots")
        .join(file)
        .with_extension("txt");
    let stored = fs::read_to_string(&path).unwrap_or_default();
    let mut sections: Vec<(&str, &str)> =
        stored.split(HEADING).filter_map(|part| part.split_once('\n')).collect();
    let text = format!("{}\n\n", masked(text));
    let old = sections.iter().find(|(name, _)| *name == section).map(|(_, old)| *old);
    if old == Some(&text) {
        return;
    }
    if env::var("UPDATE_SNAPSHOTS").is_ok_and(|value| value == "1") {
        sections.retain(|(name, _)| *name != section);
        sections.push((section, &text));
        sections.sort_unstable();
        let all: String =
            sections.iter().map(|(name, text)| format!("{HEADING}{name}\n{text}")).collect();
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, all).unwrap();
        return;
    }
    let old = old.unwrap_or("");
    let same = old.lines().zip(text.lines()).take_while(|(old, new)| old == new).count();
    let [old, new] = [old, &text].map(|text| text.lines().nth(same).unwrap_or("(end)"));
    panic!(
        "{}, section `{section}`, line {}:\n  stored: {old}\n  now:    {new}\nIf the new words are right: tests/snapshots",
        path.display(),
        same + 1
    );
}

/// `text` with `#` for each figure and without the folders of absolute paths, trimmed at the end of each line.
fn masked(text: &str) -> String {
    let mut lines = Vec::new();
    for line in text.trim().lines() {
        lines.push(without_figures(&without_folders(line)).trim_end().to_owned());
    }
    lines.join("\n")
}

fn without_folders(line: &str) -> String {
    let ends = |c: char| c.is_whitespace() || "\"'`():,;".contains(c);
    let words = line.split_inclusive(ends).map(|word| {
        let is_path = word.starts_with('/');
        let name = word.rfind('/').filter(|_| is_path).map_or(word, |slash| &word[slash + 1..]);
        // A temporary folder has another name in each run.
        if is_path && name.starts_with(".tmp") {
            name.trim_start_matches(|c| !ends(c))
        } else {
            name
        }
    });
    words.collect()
}

/// A figure starts outside a name: `k2` and `f32` stay.
fn without_figures(line: &str) -> String {
    let mut out = String::new();
    let mut rest = line;
    while let Some(c) = rest.chars().next() {
        let is_in_name = out.chars().last().is_some_and(|c| c.is_alphanumeric() || c == '_');
        if c.is_ascii_digit() && !is_in_name {
            let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
            let number = rest[..end].trim_end_matches('.');
            rest = &rest[number.len()..];
            let exponent = rest.strip_prefix('e').map(|e| e.trim_start_matches('-'));
            if let Some(e) = exponent.filter(|e| e.starts_with(|c: char| c.is_ascii_digit())) {
                rest = e.trim_start_matches(|c: char| c.is_ascii_digit());
            }
            // A figure near zero may have either sign.
            let sign = out
                .strip_suffix(['-', '−', '+'])
                .filter(|text| !text.ends_with(|c: char| c.is_alphanumeric() || c == '#'));
            out.truncate(sign.map_or(out.len(), str::len));
            out.push('#');
        } else {
            out.push(c);
            rest = &rest[c.len_utf8()..];
        }
    }
    out
}
