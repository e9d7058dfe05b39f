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

/// Requires that `message` contains each of the names and figures `parts`, in this order. A number at an end of a part is a whole
/// number of the message: `12` is not in `112` or `12.5`.
///
/// # Panics
///
/// Panics if a part is missing.
#[track_caller]
pub fn require(message: &str, parts: &[&str]) {
    let mut from = 0;
    for part in parts {
        let mut places = message[from..].match_indices(part).map(|(at, _)| from + at);
        let Some(at) = places.find(|at| is_whole(message, *at, part)) else {
            panic!("`{part}` is not in `{}`, the end of `{message}`", &message[from..])
        };
        from = at + part.len();
    }
}

/// Returns true if no number of the message goes on beyond the part at this place.
fn is_whole(message: &str, at: usize, part: &str) -> bool {
    let is_digit = |byte: Option<&u8>| byte.is_some_and(u8::is_ascii_digit);
    let (before, rest) = message.as_bytes().split_at(at);
    let after = &rest[part.len()..];
    let begins_within = match before {
        [.., b'.'] => is_digit(before.iter().rev().nth(1)),
        _ => is_digit(before.last()),
    };
    let ends_within = match after {
        [b'.', rest @ ..] => is_digit(rest.first()),
        _ => is_digit(after.first()),
    };
    let part = part.as_bytes();
    !(is_digit(part.first()) && begins_within || is_digit(part.last()) && ends_within)
}

#[test]
fn is_whole_of_a_part_of_a_number_returns_false() {
    for (message, part) in
        [("112 Nm", "12 Nm"), ("1.12 Nm", "12 Nm"), ("of 12.5", "of 12"), ("of 125", "of 12")]
    {
        assert!(!is_whole(message, message.find(part).unwrap_or(0), part), "{message}");
    }
    for (message, part) in
        [("by 12 Nm", "12 Nm"), ("by 12.", "by 12"), ("-12 Nm", "12 Nm"), ("rows", "ow")]
    {
        assert!(is_whole(message, message.find(part).unwrap_or(0), part), "{message}");
    }
}
