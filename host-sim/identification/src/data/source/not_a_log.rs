//! Detection of files that are often given as logs but are not supported.

/// Returns what a file that begins with `head` is, and what is expected; `None` if it may be a log.
pub(super) fn recognise(head: &[u8]) -> Option<(&'static str, &'static str)> {
    const TABLE: &str = "a CSV or Parquet file";
    const UNPACKED: &str = "a CSV or Parquet file; unpack it first";
    let known = match head {
        [0x1f, 0x8b, ..] => ("a gzip archive", UNPACKED),
        [0x28, 0xb5, 0x2f, 0xfd, ..] => ("a zstd archive", UNPACKED),
        [b'P', b'K', 3, 4, ..] => ("a zip archive or a spreadsheet", TABLE),
        [0x89, b'H', b'D', b'F', ..] => ("an HDF5 file", TABLE),
        _ => {
            let text = head.strip_prefix(&[0xef, 0xbb, 0xbf]).unwrap_or(head);
            if text.trim_ascii().is_empty() {
                ("an empty file", "a header and a row per sample")
            } else if !text.contains(&b'\n') && text.contains(&b'\r') {
                ("lines that end in CR alone", "lines that end in LF or CRLF")
            } else {
                return None;
            }
        }
    };
    Some(known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recognise_with_unsupported_file_returns_its_type() {
        assert_eq!(recognise(b"PAR1...."), None);
        assert_eq!(recognise(b"a,b\n"), None);
        for (head, name) in [
            (&b""[..], "an empty file"),
            (b"\xef\xbb\xbf \r\n", "an empty file"),
            (b"\x1f\x8b\x08", "a gzip archive"),
            (b"PK\x03\x04", "a zip archive or a spreadsheet"),
            (b"a,b\r1,2\r", "lines that end in CR alone"),
        ] {
            assert_eq!(recognise(head).unwrap().0, name);
        }
    }
}
