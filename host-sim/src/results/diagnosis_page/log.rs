//! What is wrong with the log itself: before anything that rests on it.

use super::Scene;
use crate::report::{Block, Cell, Table};
use friction_identification::log_check::{ColumnOverview, LogFinding, overview};
use friction_identification::number::figure;

/// The section.
pub(super) fn log(scene: &Scene) -> Vec<Block> {
    let found = &scene.about.found.log_findings;
    let mut blocks = vec![Block::Heading("The log itself".into()), columns(scene)];
    let notes = &scene.about.data.notes;
    if !notes.is_empty() {
        blocks.push(Block::List(notes.clone()));
    }
    if found.is_empty() {
        blocks.push(Block::Paragraph(
            "Held channels, late ones, noise, steps, clipping, units, signs, clock: nothing was found.".into(),
        ));
        return blocks;
    }
    let row = |finding: &LogFinding| {
        vec![
            finding.kind.name().into(),
            finding.columns.join(", ").into(),
            Cell::Digits(finding.value, 3),
            finding.unit.as_str().into(),
            if finding.corrected { "yes" } else { "no" }.into(),
        ]
    };
    let header = ["what", "columns", "size", "unit", "corrected"];
    blocks.push(Block::Table(Table {
        caption: "Found in the log before any model".into(),
        header: header.map(str::to_owned).to_vec(),
        rows: found.iter().map(row).collect(),
        best: Vec::new(),
    }));
    blocks.push(Block::List(found.iter().map(|finding| finding.in_words.clone()).collect()));
    blocks
}

/// What was read: each column with its range, and where it comes from.
fn columns(scene: &Scene) -> Block {
    let data = scene.about.data;
    let read = overview(data);
    let row = |column: &ColumnOverview| {
        let from = column.source.as_ref().map_or_else(String::new, |source| match &source.unit {
            Some(unit) => format!("{} in {unit}", source.header),
            None => source.header.clone(),
        });
        let [least, most] = column.range.map(|limit| Cell::Digits(limit, 4));
        vec![column.name.as_str().into(), least, most, column.unit.as_str().into(), from.into()]
    };
    let header = ["column", "least", "largest", "unit", "from"];
    let [slowest, fastest] = read.rate_hz.map(figure);
    let rate = if slowest == fastest { fastest } else { format!("{slowest} to {fastest}") };
    Block::Table(Table {
        caption: format!("{} rows in {} runs, {rate} Hz; as used", read.rows, read.runs),
        header: header.map(str::to_owned).to_vec(),
        rows: read.columns.iter().map(row).collect(),
        best: Vec::new(),
    })
}
