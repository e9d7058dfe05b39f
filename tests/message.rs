//! A message of the product: the test states its names and figures, and `snapshots` holds its words.
//!
//! A test program includes this file with `#[path]`, next to `snapshot.rs`.

use crate::snapshot;

/// Requires that `message` contains each of the names and figures `parts`, in this order, and the words of section `section`
/// of `tests/snapshots/FILE.txt`.
///
/// # Panics
///
/// Panics if a part is missing or the words differ.
#[track_caller]
pub fn check(file: &str, section: &str, message: &str, parts: &[&str]) {
    require(message, parts);
    snapshot::check(file, section, message);
}

/// Requires that `message` contains each of the names and figures `parts`, in this order.
///
/// # Panics
///
/// Panics if a part is missing.
#[track_caller]
pub fn require(message: &str, parts: &[&str]) {
    let mut rest = message;
    for part in parts {
        let Some(at) = rest.find(part) else {
            panic!("`{part}` is not in `{rest}`, the end of `{message}`")
        };
        rest = &rest[at + part.len()..];
    }
}
