//! The lines above a table: comments, and sometimes the header as the last comment.
//!
//! Loggers write the date and their settings above the header, each line with a `#`, `%` or `//` before it. Some tools
//! (numpy's `savetxt`) write the header as a comment too. Then the first line that is not a comment is a row of
//! numbers, and the last comment has the same number of cells.
//!
//! Other lines of text above a header (`Operator;Kim`) are skipped if the rows below that header are numbers, and if
//! the first line of the file is no such header. TwinCAT Scope has no header but rows of properties of the channels.

mod scope;

use super::line::{cells, is_number, separator};
use crate::column_names::ColumnNames;
use crate::{guess, unit};
use scope::find_scope_preamble;

/// The lines above a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Preamble {
    /// Start of the table, bytes: its header, or its first row if the header is a comment.
    pub start: usize,
    /// Number of lines above the table.
    pub lines: u64,
    /// The header in the last comment, if there is one.
    pub header: Option<Vec<u8>>,
    /// The columns, if the lines above the table describe them.
    pub columns: Option<ColumnNames>,
    /// The separator of the cells, where the lines above the table show it better than its rows.
    pub separator: Option<u8>,
    /// The line of units above the header.
    pub units: Option<Vec<u8>>,
    /// The first line of text that is skipped.
    pub skipped: Option<String>,
}

/// Minimum number of columns of a table below lines of text: time, motion and torque.
const MIN_COLUMNS: usize = 3;

/// Finds the preamble of a file, given its first bytes without the byte order mark. `skip` is the number of lines that
/// the user skips.
pub(super) fn find_preamble(head: &[u8], skip: usize) -> Preamble {
    let given: usize =
        head.split_inclusive(|byte| *byte == b'\n').take(skip).map(<[u8]>::len).sum();
    let rest = &head[given..];
    let of_tool = || find_labview_preamble(rest).or_else(|| find_scope_preamble(rest));
    let of_tool = if skip == 0 { of_tool() } else { None };
    let mut found = of_tool.unwrap_or_else(|| {
        let comments = find_comments(rest);
        let has_text = comments.header.is_none() && skip == 0;
        if has_text { with_text_lines(rest, comments) } else { comments }
    });
    let new_lines = rest[..found.start].iter().filter(|byte| **byte == b'\n').count();
    found.lines = (skip + new_lines) as u64;
    found.start += given;
    found
}

/// First words of a LabVIEW measurement file.
const LABVIEW: &[u8] = b"LabVIEW Measurement";

/// Finds the table of a LabVIEW measurement file: below the end of the header of its first segment. The headers have
/// rows of as many cells as the table.
fn find_labview_preamble(head: &[u8]) -> Option<Preamble> {
    if !head.starts_with(LABVIEW) {
        return None;
    }
    let (mut start, mut ends) = (0, 0);
    for line in head.split_inclusive(|byte| *byte == b'\n') {
        start += line.len();
        ends += usize::from(line.starts_with(b"***End_of_Header***"));
        if ends == 2 {
            let skipped = Some(String::from_utf8_lossy(LABVIEW).into_owned());
            return Some(Preamble { start, skipped, ..Preamble::default() });
        }
    }
    None
}

/// Returns the preamble with the lines of text above the header, below those of comments.
fn with_text_lines(head: &[u8], comments: Preamble) -> Preamble {
    let mut lines = Vec::new();
    let mut start = comments.start;
    for line in head[start..].split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii();
        if !text.is_empty() && comment_text(text).is_none() {
            lines.push((start, text));
        }
        start += line.len();
    }
    // The head may end inside its last line.
    let is_cut = head.last() != Some(&b'\n') && lines.len() > 3;
    let lines = if is_cut { &lines[..lines.len() - 1] } else { &lines[..] };
    let is_table = |at: &usize| is_header_of(lines[*at].1, lines.get(at + 1..).unwrap_or_default());
    let is_names = |at: &usize| is_table(at) && !is_all_units(lines[*at].1);
    let Some(last) = (0..lines.len()).find(is_names).or_else(|| (0..lines.len()).find(is_table))
    else {
        return comments;
    };
    // A row of words may follow the header.
    let ranked = (0..=last).rev().max_by_key(|at| header_rank(lines[*at].1, lines[last].1));
    let Some(at) = ranked.filter(|at| *at > 0) else { return comments };
    if let Some(grouped) = find_groups(lines, at) {
        return grouped;
    }
    let ((start, header), (_, above)) = (lines[at], lines[at - 1]);
    let by = separator(header);
    let is_units = is_unit_row(&cells(above, by), cells(header, by).len());
    let skipped = Some(String::from_utf8_lossy(lines[0].1).into_owned());
    Preamble { start, units: is_units.then(|| above.to_vec()), skipped, ..comments }
}

/// Joins the names of the header with those of the groups in the line above it (`joint 1,,joint 2,`), if the header has names
/// twice. pandas writes such tables, with the name of the index in a line below. Returns `None` if there are no groups.
fn find_groups(lines: &[(usize, &[u8])], at: usize) -> Option<Preamble> {
    let by = separator(lines[at].1);
    let text = |cell: &&[u8]| String::from_utf8_lossy(cell).trim().to_owned();
    let names: Vec<String> = cells(lines[at].1, by).iter().map(text).collect();
    let is_twice =
        |name: &String| !name.is_empty() && names.iter().filter(|of| *of == name).count() > 1;
    // A first name that returns is the clock of each channel.
    let are_groups = names.iter().any(is_twice) && !names.first().is_some_and(is_twice);
    let above = at.checked_sub(1).filter(|_| are_groups)?;
    let mut groups: Vec<String> = cells(lines[above].1, by).iter().map(text).collect();
    if groups.len() != names.len() || groups.iter().any(|group| is_number(group.as_bytes())) {
        return None;
    }
    for place in 1..groups.len() {
        if groups[place].is_empty() {
            groups[place] = groups[place - 1].clone();
        }
    }
    let below = lines.get(at + 1).map(|(_, line)| cells(line, by));
    let index = below.as_ref().filter(|row| is_index_name(row, names.len()));
    let index_name = index.map(|row| text(&row[0]));
    let joined = names.iter().zip(&groups).enumerate().map(|(place, (name, group))| {
        let parts = match (place, &index_name) {
            (0, Some(index)) if name.is_empty() => return index.clone(),
            _ if is_twice(name) || name.is_empty() => [group.as_str(), name.as_str()],
            _ => ["", name.as_str()],
        };
        parts.join(" ").trim().to_owned()
    });
    let columns = Some(ColumnNames { names: joined.collect(), ..ColumnNames::default() });
    let (start, _) = *lines.get(at + 1 + usize::from(index_name.is_some()))?;
    Some(Preamble { start, columns, separator: Some(by), ..Preamble::default() })
}

/// Returns true if a row holds only the name of the index.
fn is_index_name(row: &[&[u8]], columns: usize) -> bool {
    let [first, others @ ..] = row else { return false };
    row.len() == columns
        && !first.is_empty()
        && !is_number(first)
        && others.iter().all(|cell| cell.is_empty())
}

/// Ranks a line as the header, among lines above the rows of numbers: 0 for a line that is none, else one more than the
/// number of its names that name a quantity. `header` is the last of the lines.
fn header_rank(line: &[u8], header: &[u8]) -> usize {
    let by = separator(header);
    let names = cells(line, by);
    let empty = names.iter().filter(|name| name.is_empty()).count();
    let is_of_table = names.len() == cells(header, by).len() && empty <= 1;
    if line != header && (!is_of_table || names.iter().any(|name| is_number(name))) {
        return 0;
    }
    let is_known = |name: &&&[u8]| guess::quantity(&String::from_utf8_lossy(name)).is_some();
    1 + names.iter().filter(is_known).count()
}

/// Returns true if a line is the header of the rows below it: names, perhaps a row of units, and numbers.
fn is_header_of(line: &[u8], below: &[(usize, &[u8])]) -> bool {
    let by = separator(line);
    let names = cells(line, by);
    let numbers = names.iter().filter(|cell| is_number(cell)).count();
    let empty = names.iter().filter(|cell| cell.is_empty()).count();
    // The index of a table has no name.
    if names.len() < MIN_COLUMNS || 2 * numbers >= names.len() || empty > 1 {
        return false;
    }
    let is_row = |(_, line): &(usize, &[u8])| {
        let row = cells(line, by);
        let filled = row.iter().filter(|cell| !cell.is_empty()).count();
        let numbers = row.iter().filter(|cell| is_number(cell)).count();
        row.len() == names.len() && numbers > 0 && 2 * numbers >= filled
    };
    let is_index = |(_, line): &(usize, &[u8])| is_index_name(&cells(line, by), names.len());
    let below = below.get(usize::from(below.first().is_some_and(is_index))..).unwrap_or_default();
    let is_units =
        below.first().is_some_and(|(_, line)| is_unit_row(&cells(line, by), names.len()));
    let rows = below.get(usize::from(is_units)..).unwrap_or_default();
    !rows.is_empty() && rows.iter().take(2).all(is_row)
}

/// Returns true if a row holds units.
fn is_unit_row(row: &[&[u8]], columns: usize) -> bool {
    row.len() == columns
        && !row.iter().any(|cell| is_number(cell))
        && row.iter().filter(|cell| !cell.is_empty()).any(is_unit)
}

/// Returns true if a line holds only units.
fn is_all_units(line: &[u8]) -> bool {
    let row = cells(line, separator(line));
    let filled = || row.iter().filter(|cell| !cell.is_empty());
    filled().count() > 1 && filled().all(is_unit)
}

/// Returns true if a cell holds a unit, perhaps in brackets.
fn is_unit(cell: &&[u8]) -> bool {
    unit::is_symbol(&unit::in_cell(cell))
}

/// Finds the comments above a table.
fn find_comments(head: &[u8]) -> Preamble {
    let (mut start, mut last) = (0, None);
    for line in head.split_inclusive(|byte| *byte == b'\n') {
        let text = line.trim_ascii();
        match comment_text(text) {
            Some(inside) => last = Some(inside),
            None if text.is_empty() => {}
            None => {
                let header = last.filter(|last| is_header(last, text)).map(<[u8]>::to_vec);
                return Preamble { start, header, ..Preamble::default() };
            }
        }
        start += line.len();
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
    let is_number = |cell: &&[u8]| fast_float2::parse::<f64, _>(*cell).is_ok();
    let (names, row) = (cells(comment, by), cells(row, by));
    row.iter().all(is_number)
        && row.len() > 1
        && names.len() == row.len()
        && !names.iter().all(is_number)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(text: &str) -> Option<String> {
        find_preamble(text.as_bytes(), 0).header.and_then(|header| String::from_utf8(header).ok())
    }

    #[test]
    fn find_preamble_with_comments_counts_their_lines() {
        let text = "# 2024-05-01\n\n// kp 3\n% x\ntime_s,v\n0,1\n";
        let found = find_preamble(text.as_bytes(), 0);
        assert_eq!((&text[found.start..found.start + 6], found.lines), ("time_s", 4));
        assert_eq!(found.header, None);
        for text in ["time_s,v\n0,1\n", "%time,v\n0,1\n", "", "# all\n# remarks\n"] {
            assert_eq!(find_preamble(text.as_bytes(), 0), Preamble::default(), "{text}");
        }
    }

    #[test]
    fn find_preamble_with_commented_header_returns_it() {
        assert_eq!(header("# made by numpy\n# time_s,v\n0,1\n").as_deref(), Some("time_s,v"));
        assert_eq!(header("  #  time_s;v  \r\n0;1\n").as_deref(), Some("time_s;v"));
        assert_eq!(header("#,time_s,v\n0,0.1,1\n").as_deref(), Some(",time_s,v"));
        assert_eq!(
            header("# t  dq tau\n0 0.1  1\n").as_deref(),
            Some("t  dq tau"),
            "aligned blanks"
        );
        assert_eq!(header("# one, two, three\n0,1\n"), None, "another number of cells");
        assert_eq!(header("# a,b\ntime_s,v\n0,1\n"), None, "the header is below");
    }

    /// Returns the first line of the table, the number of lines above it, and the first line that is skipped.
    fn table(text: &str, skip: usize) -> (&str, u64, Option<String>) {
        let found = find_preamble(text.as_bytes(), skip);
        let line = text[found.start..].lines().next().unwrap_or_default();
        (line, found.lines, found.skipped)
    }

    #[test]
    fn find_preamble_with_lines_of_text_skips_them() {
        for above in [
            "Operator;Kim\nkp;3\n",
            "Kim,2024,5\nkd,4,4\n",
            "Kim,rig,a,b\nkp,kd,a,b\n",
            "Rig 3\n\n",
            "a,,,\nb,3,,\n",
        ] {
            let header = "time_s,velocity_rad_s,torque_nm,q";
            let text = format!("{above}{header}\n0,1,2,3\n1,1,2,3\n");
            let first = above.lines().next().map(str::to_owned);
            assert_eq!(table(&text, 0), (header, 2, first), "{above}");
            let units = format!("{above}{header}\ns,rad/s,Nm,rad\n0,1,2,3\n1,1,2,3\n");
            assert_eq!(table(&units, 0).0, header, "{above}");
        }
        let comments = "# rig\nOperator,Kim\nt,v,tau\n0,1,2\n1,1,2\n";
        assert_eq!(table(comments, 0), ("t,v,tau", 2, Some("Operator,Kim".into())));
    }

    #[test]
    fn find_preamble_with_ordinary_table_skips_nothing() {
        for text in [
            "t,v,tau\n0,1,2\n1,1,2\n",
            "t,v,tau\ns,rpm,Nm\n0,1,2\n",
            "t,v,tau\n2024-05-01T00:00:00,1,2\n",
            "t,v,tau\nx,off,off\n0,1,2\n",
            "a,b,c\nx,off,off\n0,1,2\n",
            "t,v,tau\n",
            "t,v\n0,1\n",
            "0,1,2\n1,2,3\n",
        ] {
            assert_eq!(find_preamble(text.as_bytes(), 0), Preamble::default(), "{text}");
        }
    }

    #[test]
    fn find_preamble_of_labview_skips_both_headers() {
        let end = "***End_of_Header***\t\n";
        let text =
            format!("LabVIEW Measurement\t\n{end}\t\nTime\t1\t1\n{end}X_Value\tv\tT\n0\t1\t2\n");
        assert_eq!(table(&text, 0), ("X_Value\tv\tT", 5, Some("LabVIEW Measurement".into())));
    }

    #[test]
    fn find_preamble_with_given_lines_skips_just_these() {
        assert_eq!(table("a\nb\nt,v,tau\n0,1,2\n", 2), ("t,v,tau", 2, None));
        assert_eq!(table("a\nt,v,tau\n0,1,2\n1,2,3\n", 0).0, "t,v,tau");
        assert_eq!(table("a\n", 5), ("", 5, None));
    }
}
