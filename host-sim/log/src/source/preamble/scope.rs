//! The lines above the table of an export of TwinCAT Scope.
//!
//! Lines of the project come first (`Name`, `File`, `Starttime of export`). Then each line holds a property of all
//! channels, with the property's name before each group of channels: `Name<TAB>v<TAB>Name<TAB>tau`. The column of that
//! name is the group's time column, in ms. Depending on the settings, only the line `Name` exists.

use super::Preamble;
use crate::column_names::ColumnNames;
use crate::source::line::{cells, is_number, separator};

/// Name of the time columns, which have none in the file.
const TIME: &str = "time";

/// Finds the preamble of an export of TwinCAT Scope.
pub(super) fn find_scope_preamble(head: &[u8]) -> Option<Preamble> {
    if !head.trim_ascii_start().starts_with(b"Name") {
        return None;
    }
    let (mut start, mut of_names) = (0, None);
    let mut properties: Vec<Vec<&[u8]>> = Vec::new();
    let mut is_export = false;
    for line in head.split_inclusive(|byte| *byte == b'\n') {
        let by = separator(line);
        let row = cells(line, by);
        // Rows of numbers may have more decimal commas than separators.
        of_names = if line.starts_with(b"Name") { Some(by) } else { of_names };
        let key = *row.first()?;
        is_export |= key == b"File" || key == b"SymbolName" || key.starts_with(b"Starttime");
        let columns = groups(&properties).map_or(0, |of| of.len());
        let filled = row.iter().filter(|cell| !cell.is_empty());
        if columns > 1
            && row.len() == columns
            && !key.is_empty()
            && filled.clone().all(|c| is_number(c))
        {
            let columns = Some(is_export.then(|| column_names(&properties))??);
            return Some(Preamble { start, columns, separator: of_names, ..Preamble::default() });
        }
        properties.push(row);
        start += line.len();
    }
    None
}

/// Returns the line that names the channels: the last one of the symbols or else of the names.
fn groups<'a, 'b>(properties: &'b [Vec<&'a [u8]>]) -> Option<&'b Vec<&'a [u8]>> {
    let of = |wanted: &[u8]| properties.iter().rev().find(|row| row.len() > 1 && row[0] == wanted);
    of(b"SymbolName").or_else(|| of(b"Name"))
}

/// Returns the names and units of the columns.
fn column_names(properties: &[Vec<&[u8]>]) -> Option<ColumnNames> {
    let marks = groups(properties)?;
    let of = |wanted: &[u8]| {
        let fits = |row: &&Vec<&[u8]>| row.len() == marks.len() && row[0] == wanted;
        properties.iter().rev().find(fits)
    };
    let text = |row: Option<&Vec<&[u8]>>, at: usize| {
        row.map(|row| String::from_utf8_lossy(row[at]).into_owned()).unwrap_or_default()
    };
    let is_time = |at: usize| marks[at] == marks[0];
    let channels = || (0..marks.len()).filter(|at| !is_time(*at));
    let short: Vec<String> = channels().map(|at| text(of(b"Name"), at)).collect();
    // A channel that is drawn twice is exported twice.
    let is_unique =
        |name: &String| !name.is_empty() && short.iter().filter(|of| *of == name).count() == 1;
    let names_are_unique = short.iter().all(is_unique);
    let mut found = ColumnNames { is_twincat_scope: true, ..ColumnNames::default() };
    for at in 0..marks.len() {
        let (name, unit) = if is_time(at) {
            (TIME.to_owned(), "ms".to_owned())
        } else {
            let (short, symbol) = (text(of(b"Name"), at), text(of(b"SymbolName"), at));
            let name = if names_are_unique || symbol.is_empty() { short } else { symbol };
            (name, text(of(b"Unit"), at))
        };
        let same = |known: &&String| !is_time(at) && **known == name;
        let earlier = found.names.iter().filter(same).count();
        found.names.push(if earlier > 0 { format!("{name} ({})", earlier + 1) } else { name });
        found.units.push(unit);
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(text: &str) -> Option<(ColumnNames, u64)> {
        let found = crate::source::preamble::find_preamble(text.as_bytes(), 0);
        Some((found.columns?, found.lines))
    }

    #[test]
    fn find_scope_preamble_with_properties_returns_names_and_units() {
        let text = "Name\tRig\nFile\tx.tcscopex\n\nName\tv\tName\ttau\nSymbolName\tMAIN.v\tSymbolName\tMAIN.tau\n\
                    SampleTime[ms]\t1\tSampleTime[ms]\t2\nUnit\t\u{b0}/s\tUnit\tNm\n\n0\t-1,5\t0\t2,5\n";
        let (columns, lines) = find(text).unwrap();
        assert_eq!(columns.names, ["time", "v", "time", "tau"]);
        assert_eq!(columns.units, ["ms", "\u{b0}/s", "ms", "Nm"]);
        assert_eq!(lines, 8);
    }

    #[test]
    fn find_scope_preamble_with_equal_names_returns_symbols() {
        let text = "Name,Rig\nFile,x\nName,v,v\nSymbolName,A.v,B.v\n0,1,2\n";
        assert_eq!(find(text).unwrap().0.names, ["time", "A.v", "B.v"]);
        let no_symbols = "Name,Rig\nFile,x\nName,v,v\n0,1,2\n";
        assert_eq!(find(no_symbols).unwrap().0.names, ["time", "v", "v (2)"]);
    }

    #[test]
    fn find_scope_preamble_with_other_table_returns_none() {
        for text in ["Name,v,tau\n0,1,2\n", "time,v\n0,1\n", "Name,Kim\n", "Name\tRig\nFile\tx\n"] {
            assert_eq!(find(text), None, "{text}");
        }
    }
}
