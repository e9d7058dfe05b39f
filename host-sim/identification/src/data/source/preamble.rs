//! The lines above a table: comments, and sometimes the header as the last comment.
//!
//! Loggers write the date and their settings above the header, each line with a `#`, `%` or `//` before it. Some tools
//! (numpy's `savetxt`) write the header as a comment too. Then the first line that is not a comment is a row of
//! numbers, and the last comment has the same number of cells.

use super::separator::separator;
use std::ops::Range;

/// The lines above a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Preamble {
    /// Start of the table, bytes: its header, or its first row if the header is a comment.
    pub start: usize,
    /// Number of lines above the table.
    pub lines: u64,
    /// The header in the last comment, if there is one.
    pub header: Option<Range<usize>>,
}

/// Finds the preamble of a file, given its first bytes without the byte order mark.
pub(super) fn find_preamble(head: &[u8]) -> Preamble {
    let (mut start, mut lines, mut last) = (0, 0, None);
    for line in head.split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii();
        match comment_text(text) {
            Some(inside) => {
                let at = line.len() - line.trim_ascii_start().len() + text.len() - inside.len();
                last = Some(start + at..start + at + inside.len());
            }
            None if text.is_empty() => {}
            None => {
                let header = last.filter(|at: &Range<usize>| is_header(&head[at.clone()], text));
                let is_above = header.is_some() || lines > 0;
                return if is_above {
                    Preamble { start, lines, header }
                } else {
                    Preamble::default()
                };
            }
        }
        start += line.len();
        lines += 1;
    }
    Preamble::default()
}

/// Returns the text of a comment, or `None` if the line is not one. `%time` is a column name.
fn comment_text(line: &[u8]) -> Option<&[u8]> {
    let inside = match line {
        [b'#', inside @ ..] | [b'/', b'/', inside @ ..] => inside,
        [b'%', inside @ ..] if !inside.first().is_some_and(u8::is_ascii_alphabetic) => inside,
        _ => return None,
    };
    Some(inside.trim_ascii())
}

/// Returns true if a comment is the header of a row.
fn is_header(comment: &[u8], row: &[u8]) -> bool {
    let by = separator(row);
    let cells = |line: &[u8]| line.split(|byte| *byte == by).count();
    let is_number = |cell: &[u8]| fast_float2::parse::<f64, _>(cell.trim_ascii()).is_ok();
    let is_row = row.split(|byte| *byte == by).all(is_number);
    is_row
        && cells(row) > 1
        && cells(comment) == cells(row)
        && !comment.split(|b| *b == by).all(is_number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Option<&str> {
        find_preamble(text.as_bytes()).header.map(|range| &text[range])
    }

    #[test]
    fn find_preamble_with_comments_counts_their_lines() {
        let text = "# 2024-05-01\n\n// kp 3\n% x\ntime_s,v\n0,1\n";
        let found = find_preamble(text.as_bytes());
        assert_eq!((&text[found.start..found.start + 6], found.lines), ("time_s", 4));
        assert_eq!(found.header, None);
        for text in ["time_s,v\n0,1\n", "%time,v\n0,1\n", "", "# all\n# remarks\n"] {
            assert_eq!(find_preamble(text.as_bytes()), Preamble::default(), "{text}");
        }
    }

    #[test]
    fn find_preamble_with_commented_header_returns_it() {
        assert_eq!(header("# made by numpy\n# time_s,v\n0,1\n"), Some("time_s,v"));
        assert_eq!(header("  #  time_s;v  \r\n0;1\n"), Some("time_s;v"));
        assert_eq!(header("#,time_s,v\n0,0.1,1\n"), Some(",time_s,v"));
        assert_eq!(header("# one, two, three\n0,1\n"), None, "another number of cells");
        assert_eq!(header("# a,b\ntime_s,v\n0,1\n"), None, "the header is below");
    }
}
