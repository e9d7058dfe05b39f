//! The cell separator of a text table.

/// Returns the separator that occurs most often in a line, outside quotes: a comma, a semicolon or a tab; without
/// any of them, a blank.
pub(super) fn separator(line: &[u8]) -> u8 {
    let header = line.trim_ascii_start();
    // A leading tab may be an empty first name, but then others follow it.
    let mut counts = [(b',', 0), (b';', 0), (b'\t', 0)];
    let (mut is_quoted, mut has_blank) = (false, false);
    for &byte in header.iter().take_while(|&&byte| byte != b'\n') {
        is_quoted ^= byte == b'"';
        has_blank |= byte == b' ' && !is_quoted;
        if let Some((_, count)) = counts.iter_mut().find(|(s, _)| *s == byte && !is_quoted) {
            *count += 1;
        }
    }
    // The blanks at the end of the line are not between cells.
    let end = header.iter().position(|byte| *byte == b'\n').unwrap_or(header.len());
    let is_in_line = header[..end].trim_ascii().contains(&b' ');
    if has_blank && is_in_line && counts.iter().all(|(_, count)| *count == 0) {
        return b' ';
    }
    // `max_by_key` prefers the last of equal counts, and the comma is to be preferred.
    counts.iter().rev().max_by_key(|(_, count)| *count).map_or(b',', |(separator, _)| *separator)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn separator_with_several_candidates_returns_most_frequent() {
        assert_eq!(separator(b"a,b,c\n1,2,3\n"), b',');
        assert_eq!(separator(b"a;b;c\n1,0;2,0;3,0\n"), b';');
        assert_eq!(separator(b"\r\n\na\tb\r\n"), b'\t');
        assert_eq!(separator(b"\"a;x;y\",b\n"), b',', "quoted ones do not count");
        assert_eq!(separator(b"alone \n"), b',');
        assert_eq!(separator(b"  t  dq tau\n"), b' ');
        assert_eq!(separator(b"t (s),dq\n"), b',', "blanks in names");
    }
}
