//! The lines of a text table: the separator of the cells, and the cells.

use std::ops::Range;

/// Returns the separator that occurs most often in a line, outside quotes: a comma, a semicolon or a tab; without
/// any of them, a blank or a colon.
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
    let end = header.iter().position(|byte| *byte == b'\n').unwrap_or(header.len());
    let line = header[..end].trim_ascii();
    if counts.iter().all(|(_, count)| *count == 0) {
        if is_separated_by_colons(line) {
            return b':';
        }
        // The blanks at the end of the line are not between cells.
        if has_blank && line.contains(&b' ') {
            return b' ';
        }
    }
    // `max_by_key` prefers the last of equal counts, and the comma is to be preferred.
    counts.iter().rev().max_by_key(|(_, count)| *count).map_or(b',', |(separator, _)| *separator)
}

/// Minimum number of cells between colons: time, motion and torque.
const MIN_CELLS: usize = 3;

/// Returns true if colons separate numbers or names, and are not those of a time of day. A blank separates the cells of a line,
/// unless it is before a unit, or there are some beside each colon.
fn is_separated_by_colons(line: &[u8]) -> bool {
    let cells: Vec<&[u8]> = line.split(|byte| *byte == b':').map(<[u8]>::trim_ascii).collect();
    let is_name = |cell: &[u8]| {
        let has_blank =
            cell.windows(2).any(|pair| pair[0] == b' ' && !matches!(pair[1], b'(' | b'['));
        !has_blank && cell.first().is_some_and(|byte| byte.is_ascii_alphabetic() || *byte >= 0x80)
    };
    let is_cell = |cell: &&[u8]| fast_float2::parse::<f64, _>(*cell).is_ok() || is_name(cell);
    let is_minute = |cell: &&[u8]| cell.len() == 2 && cell.iter().all(u8::is_ascii_digit);
    let is_blank = |at: usize| line.get(at) == Some(&b' ');
    let is_padded = |at: &usize| is_blank(at + 1) || at.checked_sub(1).is_some_and(is_blank);
    let colons = (0..line.len()).filter(|at| line[*at] == b':');
    let padded = colons.filter(is_padded).count();
    (padded == 0 || padded + 1 == cells.len())
        && cells.len() >= MIN_CELLS
        && cells.iter().all(is_cell)
        && !cells[1..cells.len() - 1].iter().all(is_minute)
}

/// Splits a line into its cells, outside quotes, without the quotes around a cell.
pub(super) fn cells(line: &[u8], by: u8) -> Vec<&[u8]> {
    let mut is_quoted = false;
    let parts = line.split(move |byte| {
        is_quoted ^= *byte == b'"';
        *byte == by && !is_quoted
    });
    let bare = |cell: &'_ [u8]| -> Range<usize> {
        let trimmed = cell.trim_ascii();
        let start = cell.len() - cell.trim_ascii_start().len();
        let quotes = usize::from(
            trimmed.len() > 1 && trimmed.starts_with(b"\"") && trimmed.ends_with(b"\""),
        );
        start + quotes..start + trimmed.len() - quotes
    };
    let cells = parts.map(|cell| &cell[bare(cell)]);
    cells.filter(|cell| by != b' ' || !cell.is_empty()).collect()
}

/// Returns true if a cell is a number, with a decimal point or comma.
pub(super) fn is_number(cell: &[u8]) -> bool {
    let plain: Vec<u8> = cell.iter().map(|&byte| if byte == b',' { b'.' } else { byte }).collect();
    fast_float2::parse::<f64, _>(&plain).is_ok()
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
        for line in
            ["t:q:dq:tau", "0.001:1.2:-3e-4:5", " t : q : dq\r\n0", "t (s):q (rad):dq [rad/s]"]
        {
            assert_eq!(separator(line.as_bytes()), b':', "{line}");
        }
        for line in
            ["10:11:12.5", "2026-11-30 10:11:12 1.5 2.5", "2026-11-30T10:11:12", "Gear: 1:50"]
        {
            assert_ne!(separator(line.as_bytes()), b':', "{line}");
        }
        assert_eq!(separator(b"a:q b:q a:tau b:tau\n"), b' ', "colons in names");
        assert_eq!(separator(b"10:11:12,5;1,5\n"), b',', "decimal commas");
    }
}
