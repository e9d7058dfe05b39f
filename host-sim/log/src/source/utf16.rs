//! Text in UTF-16, as spreadsheets and some drive tools save it. A byte order mark identifies it, or a 0 in every
//! other of the first bytes.

/// The order of the two bytes of a code unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ByteOrder {
    LittleFirst,
    BigFirst,
}

/// Returns the byte order if a text that begins with `head` is in UTF-16.
pub(super) fn byte_order(head: &[u8]) -> Option<ByteOrder> {
    match head {
        [0xff, 0xfe, ..] => Some(ByteOrder::LittleFirst),
        [0xfe, 0xff, ..] => Some(ByteOrder::BigFirst),
        [a, 0, b, 0, c, 0, ..] if ![a, b, c].contains(&&0) => Some(ByteOrder::LittleFirst),
        [0, a, 0, b, 0, c, ..] if ![a, b, c].contains(&&0) => Some(ByteOrder::BigFirst),
        _ => None,
    }
}

/// Decodes the text without its byte order mark. Invalid code units become U+FFFD.
pub(super) fn decode(bytes: &[u8], order: ByteOrder) -> String {
    let unit = |pair: &[u8; 2]| match order {
        ByteOrder::LittleFirst => u16::from_le_bytes(*pair),
        ByteOrder::BigFirst => u16::from_be_bytes(*pair),
    };
    let units = bytes.as_chunks::<2>().0.iter().map(unit);
    let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
    text.skip_while(|c| *c == '\u{feff}').collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decode_with_either_byte_order_returns_text() {
        let bytes = |order: fn(u16) -> [u8; 2], text: &str| -> Vec<u8> {
            text.encode_utf16().flat_map(order).collect()
        };
        for text in ["\u{feff}t,v\n", "t,v °\n"] {
            let bare = text.trim_start_matches('\u{feff}');
            let little = bytes(u16::to_le_bytes, text);
            assert_eq!(byte_order(&little), Some(ByteOrder::LittleFirst));
            assert_eq!(decode(&little, ByteOrder::LittleFirst), bare);
            let big = bytes(u16::to_be_bytes, text);
            assert_eq!(byte_order(&big), Some(ByteOrder::BigFirst));
            assert_eq!(decode(&big, ByteOrder::BigFirst), bare);
        }
        assert_eq!(byte_order(b"time_s,v"), None);
        assert_eq!(byte_order(b"\0\0\0\0\0\0"), None);
    }
}
