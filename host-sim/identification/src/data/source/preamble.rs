//! What stands above a table: remarks, and sometimes the header among them.
//!
//! Loggers write the date and their settings above the columns' names, each line with a `#`, `%` or `//` before it. Some
//! write the names so, too (numpy's `savetxt`): then the first line that is no remark is a row of numbers, and the last
//! remark has as many cells.

use super::csv_file::separator;
use std::ops::Range;

/// What stands above a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Preamble {
    /// Where the table begins, bytes: its header, or its first row if the header is a remark.
    pub start: usize,
    /// Lines above.
    pub lines: u64,
    /// The header in the last remark, if it is there.
    pub header: Option<Range<usize>>,
}

/// Looks at the beginning of a file, behind its byte order mark.
pub(super) fn preamble(head: &[u8]) -> Preamble {
    let (mut start, mut lines, mut last) = (0, 0, None);
    for line in head.split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii();
        match remark(text) {
            Some(inside) => {
                let at = line.len() - line.trim_ascii_start().len() + text.len() - inside.len();
                last = Some(start + at..start + at + inside.len());
            }
            None if text.is_empty() => {}
            None => {
                let header = last.filter(|at: &Range<usize>| heads(&head[at.clone()], text));
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

/// What a remark says; `None` if the line is none. `%time` is a name.
fn remark(line: &[u8]) -> Option<&[u8]> {
    let inside = match line {
        [b'#', inside @ ..] | [b'/', b'/', inside @ ..] => inside,
        [b'%', inside @ ..] if !inside.first().is_some_and(u8::is_ascii_alphabetic) => inside,
        _ => return None,
    };
    Some(inside.trim_ascii())
}

/// Whether a remark is the header of a row.
fn heads(remark: &[u8], row: &[u8]) -> bool {
    let by = separator(row);
    let cells = |line: &[u8]| line.split(|byte| *byte == by).count();
    let is_number = |cell: &[u8]| fast_float2::parse::<f64, _>(cell.trim_ascii()).is_ok();
    let is_row = row.split(|byte| *byte == by).all(is_number);
    is_row
        && cells(row) > 1
        && cells(remark) == cells(row)
        && !remark.split(|b| *b == by).all(is_number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Option<&str> {
        preamble(text.as_bytes()).header.map(|range| &text[range])
    }

    #[test]
    fn remarks_are_passed_over_and_counted() {
        let text = "# 2024-05-01\n\n// kp 3\n% x\ntime_s,v\n0,1\n";
        let found = preamble(text.as_bytes());
        assert_eq!((&text[found.start..found.start + 6], found.lines), ("time_s", 4));
        assert_eq!(found.header, None);
        for text in ["time_s,v\n0,1\n", "%time,v\n0,1\n", "", "# all\n# remarks\n"] {
            assert_eq!(preamble(text.as_bytes()), Preamble::default(), "{text}");
        }
    }

    #[test]
    fn a_header_may_be_the_last_remark() {
        assert_eq!(header("# made by numpy\n# time_s,v\n0,1\n"), Some("time_s,v"));
        assert_eq!(header("  #  time_s;v  \r\n0;1\n"), Some("time_s;v"));
        assert_eq!(header("#,time_s,v\n0,0.1,1\n"), Some(",time_s,v"));
        assert_eq!(header("# one, two, three\n0,1\n"), None, "another number of cells");
        assert_eq!(header("# a,b\ntime_s,v\n0,1\n"), None, "the header is below");
    }
}
