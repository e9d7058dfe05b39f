//! Text in Windows-1252, as spreadsheets in Western Europe save it: one byte for each character.

/// The characters of the bytes 0x80 to 0x9f; `\0` for a byte without a character.
const HIGH: [char; 32] = [
    '€', '\0', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\0', 'Ž', '\0', '\0', '‘',
    '’', '“', '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\0', 'ž', 'Ÿ',
];

fn character(byte: u8) -> char {
    match byte {
        0x80..=0x9f => HIGH[usize::from(byte) - 0x80],
        other => char::from(other),
    }
}

/// Returns true if a text that begins with `head` is not UTF-8 and all its bytes are characters of Windows-1252.
pub(super) fn is_windows_1252(head: &[u8]) -> bool {
    let is_utf8 = match std::str::from_utf8(head) {
        Ok(_) => true,
        // The head may end inside a character.
        Err(error) => error.error_len().is_none(),
    };
    !is_utf8 && head.iter().all(|byte| character(*byte) != '\0')
}

/// Decodes a text. Bytes without a character become U+FFFD.
pub(super) fn decode(bytes: &[u8]) -> String {
    let known = |byte: &u8| match character(*byte) {
        '\0' => char::REPLACEMENT_CHARACTER,
        known => known,
    };
    bytes.iter().map(known).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decode_with_western_text_returns_characters() {
        let bytes = b"Couple (N\xb7m);Temp\xe9rature (\xb0C);\x80";
        assert!(is_windows_1252(bytes));
        assert_eq!(decode(bytes), "Couple (N·m);Température (°C);€");
        assert!(!is_windows_1252("N·m".as_bytes()), "UTF-8");
        assert!(!is_windows_1252(&"N·m".as_bytes()[..2]), "a character that is cut");
        assert!(!is_windows_1252(b"a\0\xff"), "binary");
    }
}
