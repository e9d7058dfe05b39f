//! Text in UTF-16, as spreadsheets and some drives' programs save it: told by its byte order mark, or by every other
//! byte of its beginning being 0.

/// Which byte of a pair comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    LittleFirst,
    BigFirst,
}

/// The order, if the text that begins so is in UTF-16.
pub(super) fn order(head: &[u8]) -> Option<Order> {
    match head {
        [0xff, 0xfe, ..] => Some(Order::LittleFirst),
        [0xfe, 0xff, ..] => Some(Order::BigFirst),
        [a, 0, b, 0, c, 0, ..] if ![a, b, c].contains(&&0) => Some(Order::LittleFirst),
        [0, a, 0, b, 0, c, ..] if ![a, b, c].contains(&&0) => Some(Order::BigFirst),
        _ => None,
    }
}

/// The text, without its mark; what is no text becomes the sign for that.
pub(super) fn decode(bytes: &[u8], order: Order) -> String {
    let unit = |pair: &[u8; 2]| match order {
        Order::LittleFirst => u16::from_le_bytes(*pair),
        Order::BigFirst => u16::from_be_bytes(*pair),
    };
    let units = bytes.as_chunks::<2>().0.iter().map(unit);
    let text = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER));
    text.skip_while(|c| *c == '\u{feff}').collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_decoded_in_either_order_with_a_mark_or_without() {
        let bytes = |order: fn(u16) -> [u8; 2], text: &str| -> Vec<u8> {
            text.encode_utf16().flat_map(order).collect()
        };
        for text in ["\u{feff}t,v\n", "t,v °\n"] {
            let bare = text.trim_start_matches('\u{feff}');
            let little = bytes(u16::to_le_bytes, text);
            assert_eq!(order(&little), Some(Order::LittleFirst));
            assert_eq!(decode(&little, Order::LittleFirst), bare);
            let big = bytes(u16::to_be_bytes, text);
            assert_eq!(order(&big), Some(Order::BigFirst));
            assert_eq!(decode(&big, Order::BigFirst), bare);
        }
        assert_eq!(order(b"time_s,v"), None);
        assert_eq!(order(b"\0\0\0\0\0\0"), None);
    }
}
