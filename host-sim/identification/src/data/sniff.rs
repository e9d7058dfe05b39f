//! What kind of file this is, from its first bytes.
//!
//! The name says little: a `.csv` may be compressed, come from a spreadsheet in UTF-16, or be
//! separated by semicolons because its author's comma is a decimal point. The first bytes say it
//! all, and where they say "not a table" it is better told here than as a hundred bad rows.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use super::error::DataError;

/// What the first bytes say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    /// Text, with this separator; the table starts at this byte.
    Csv { separator: u8, start: u64 },
    /// Apache Parquet.
    Parquet,
}

/// Looks at the start of the file and goes back to where the table starts.
pub(super) fn sniff(path: &Path, file: &mut File) -> Result<Format, DataError> {
    let io = |source: io::Error| DataError::Io { file: path.into(), source };
    let mut head = Vec::new();
    file.by_ref().take(64 * 1024).read_to_end(&mut head).map_err(io)?;
    let format = recognise(&head).map_err(|(found, expected)| DataError::File {
        file: path.into(),
        found: found.into(),
        expected: expected.into(),
    })?;
    let start = if let Format::Csv { start, .. } = format { start } else { 0 };
    file.seek(SeekFrom::Start(start)).map_err(io)?;
    Ok(format)
}

fn recognise(head: &[u8]) -> Result<Format, (&'static str, &'static str)> {
    const TABLE: &str = "a CSV or Parquet file";
    const UNPACKED: &str = "a CSV or Parquet file; unpack it first";
    const UTF8: &str = "CSV in UTF-8";
    match head {
        [b'P', b'A', b'R', b'1', ..] => return Ok(Format::Parquet),
        [0x1f, 0x8b, ..] => return Err(("a gzip archive", UNPACKED)),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => return Err(("a zstd archive", UNPACKED)),
        [b'P', b'K', 3, 4, ..] => return Err(("a zip archive or a spreadsheet", TABLE)),
        [0x89, b'H', b'D', b'F', ..] => return Err(("an HDF5 file", TABLE)),
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => return Err(("text in UTF-16", UTF8)),
        _ => {}
    }
    let start = if head.starts_with(&[0xef, 0xbb, 0xbf]) { 3 } else { 0 };
    let text = &head[start..];
    if text.trim_ascii().is_empty() {
        return Err(("an empty file", "a header and a row per sample"));
    }
    if !text.contains(&b'\n') && text.contains(&b'\r') {
        return Err(("lines that end in CR alone", "lines that end in LF or CRLF"));
    }
    Ok(Format::Csv { separator: separator(text), start: start as u64 })
}

/// The separator that occurs most often in the first line, outside quotes.
fn separator(text: &[u8]) -> u8 {
    let header = text.trim_ascii_start();
    // A leading tab may be an empty first name, but then others follow it.
    let mut counts = [(b',', 0), (b';', 0), (b'\t', 0)];
    let mut is_quoted = false;
    for &byte in header.iter().take_while(|&&byte| byte != b'\n') {
        is_quoted ^= byte == b'"';
        if let Some((_, count)) = counts.iter_mut().find(|(s, _)| *s == byte && !is_quoted) {
            *count += 1;
        }
    }
    // `max_by_key` prefers the last of equals, and the comma is to be preferred.
    counts.iter().rev().max_by_key(|(_, count)| *count).map_or(b',', |(separator, _)| *separator)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn csv(separator: u8, start: u64) -> Result<Format, (&'static str, &'static str)> {
        Ok(Format::Csv { separator, start })
    }

    #[test]
    fn separators_and_byte_order_mark_are_seen() {
        assert_eq!(recognise(b"a,b,c\n1,2,3\n"), csv(b',', 0));
        assert_eq!(recognise(b"a;b;c\n1,0;2,0;3,0\n"), csv(b';', 0));
        assert_eq!(recognise(b"\r\n\na\tb\r\n"), csv(b'\t', 0));
        assert_eq!(recognise(b"\xef\xbb\xbfa;b\n"), csv(b';', 3));
        assert_eq!(recognise(b"\"a;x;y\",b\n"), csv(b',', 0), "quoted ones do not count");
        assert_eq!(recognise(b"alone\n"), csv(b',', 0));
    }

    #[test]
    fn what_is_no_table_is_told_by_its_name() {
        assert_eq!(recognise(b"PAR1...."), Ok(Format::Parquet));
        for (head, name) in [
            (&b""[..], "an empty file"),
            (b"\xef\xbb\xbf \r\n", "an empty file"),
            (b"\xff\xfea\0", "text in UTF-16"),
            (b"\x1f\x8b\x08", "a gzip archive"),
            (b"PK\x03\x04", "a zip archive or a spreadsheet"),
            (b"a,b\r1,2\r", "lines that end in CR alone"),
        ] {
            assert_eq!(recognise(head).unwrap_err().0, name);
        }
    }
}
