//! Encodings of text other than UTF-8: UTF-16, as spreadsheets and some drive tools save it, and Windows-1252, as spreadsheets
//! in Western Europe do.

use encoding_rs::{Encoding, UTF_16BE, UTF_16LE, WINDOWS_1252};

/// Bytes that are no characters of Windows-1252, and 0 of binary files.
const NO_CHARACTERS: [u8; 6] = [0, 0x81, 0x8d, 0x8f, 0x90, 0x9d];

/// The byte order mark of UTF-8, which some programs write first.
const BYTE_ORDER_MARK: &[u8] = &[0xef, 0xbb, 0xbf];

/// Returns a text without the byte order mark of UTF-8.
pub(super) fn without_mark(text: &[u8]) -> &[u8] {
    text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text)
}

/// Returns the encoding of a text that begins with `head`; `None` if it is UTF-8 or no text. A byte order mark identifies UTF-16,
/// or a 0 in every other of the first bytes.
pub(super) fn encoding(head: &[u8]) -> Option<&'static Encoding> {
    // The head may end inside a character.
    let is_utf8 =
        || std::str::from_utf8(head).err().is_none_or(|error| error.error_len().is_none());
    let are_none = |bytes: [u8; 3]| bytes.contains(&0);
    match *head {
        [0xff, 0xfe, ..] => Some(UTF_16LE),
        [0xfe, 0xff, ..] => Some(UTF_16BE),
        [a, 0, b, 0, c, 0, ..] if !are_none([a, b, c]) => Some(UTF_16LE),
        [0, a, 0, b, 0, c, ..] if !are_none([a, b, c]) => Some(UTF_16BE),
        _ if is_utf8() || head.iter().any(|byte| NO_CHARACTERS.contains(byte)) => None,
        _ => Some(WINDOWS_1252),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> Option<(&'static Encoding, String)> {
        let encoding = encoding(bytes)?;
        Some((encoding, encoding.decode(bytes).0.into_owned()))
    }

    #[test]
    fn encoding_of_either_byte_order_decodes_text() {
        let bytes = |order: fn(u16) -> [u8; 2], text: &str| -> Vec<u8> {
            text.encode_utf16().flat_map(order).collect()
        };
        for text in ["\u{feff}t,v\n", "t,v °\n"] {
            let bare = text.trim_start_matches('\u{feff}').to_owned();
            let little = bytes(u16::to_le_bytes, text);
            assert_eq!(decoded(&little), Some((UTF_16LE, bare.clone())));
            assert_eq!(decoded(&bytes(u16::to_be_bytes, text)), Some((UTF_16BE, bare)));
        }
        assert_eq!(encoding(b"time_s,v"), None);
        assert_eq!(encoding(b"\0\0\0\0\0\0"), None);
    }

    #[test]
    fn encoding_of_western_text_decodes_it() {
        let text = "Couple (N·m);Température (°C);€".to_owned();
        let bytes = b"Couple (N\xb7m);Temp\xe9rature (\xb0C);\x80";
        assert_eq!(decoded(bytes), Some((WINDOWS_1252, text)));
        assert_eq!(encoding("N·m".as_bytes()), None, "UTF-8");
        assert_eq!(encoding(&"N·m".as_bytes()[..2]), None, "a character that is cut");
        assert_eq!(encoding(b"a\0\xff"), None, "binary");
    }
}
