//! The section about the log itself: its columns and its problems.

use super::Scene;
use crate::report::{Cell, Section, Table};
use joint_log::log_check::{ColumnOverview, LogFinding, overview};

/// Returns the section.
pub(super) fn log(scene: &Scene) -> Section {
    let found = &scene.about.found.log_findings;
    let section = Section::new("Log check")
        .table(columns(scene))
        .list(scene.about.input.data.notes.iter().cloned());
    if found.is_empty() {
        return section.words(
            "The log was checked for held and delayed channels, noise, quantisation, saturation, wrong units, wrong signs and \
             time jumps. No problem was found.",
        );
    }
    let row = |finding: &LogFinding| {
        vec![
            finding.kind.name().into(),
            finding.columns.join(", ").into(),
            Cell::ShortNumber(finding.value, 3),
            finding.unit.as_str().into(),
            if finding.corrected { "yes" } else { "no" }.into(),
        ]
    };
    let header = "problem|columns|size|unit|corrected";
    section
        .table(Table::new("Problems of the log", header, found.iter().map(row)))
        .list(found.iter().map(|finding| finding.in_words.clone()))
}

/// Returns the table of the columns with their range and source.
fn columns(scene: &Scene) -> Table {
    let data = &scene.about.input.data;
    let read = overview(data);
    let row = |column: &ColumnOverview| {
        let from = column.source.as_ref().map_or_else(String::new, |source| match &source.unit {
            Some(unit) => format!("{} ({unit})", source.header),
            None => source.header.clone(),
        });
        let [least, most] = column.range.map(|limit| Cell::ShortNumber(limit, 4));
        vec![column.name.as_str().into(), least, most, column.unit.as_str().into(), from.into()]
    };
    let rate = read.rate_in_words();
    let caption = format!("Columns as used: {} rows in {} runs, {rate}", read.rows, read.runs);
    let rows = read.columns.iter().map(row);
    Table::new(caption, "column|minimum|maximum|unit|column in file", rows)
}
