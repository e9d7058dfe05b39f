//! What is wrong with the log itself: before anything that rests on it.

use super::Scene;
use crate::report::{Block, Cell, Table};
use friction_identification::log_check::LogFinding;

/// The section.
pub(super) fn log(scene: &Scene) -> Vec<Block> {
    let found = &scene.about.found.log_findings;
    let mut blocks = vec![Block::Heading("The log itself".into())];
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
