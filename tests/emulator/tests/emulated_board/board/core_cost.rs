//! What each law and term takes per update of the core on the chip: instructions and cycles, within `core-cost.tsv`.
//!
//! The calls are counted in the courses of `core_bits`. The file has limits on both sides, with room for another compiler: a
//! step below them does not compute what it should. The measured figures are written to `target/figures/core-cost.tsv`.

use super::core_bits::{Costs, costs};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

const LIMITS: &str = include_str!("../../../core-cost.tsv");

const HEAD: &str = "# Instructions per update\n\
model, number\tmodel, least\tmodel, most\tcompensator, least\tcompensator, most\tcycles of both, most\n";
const NETWORK_HEAD: &str = "\n# Network\n\
network, number\tevaluation, least\tevaluation, most\tits law, least\tits law, most\tcycles of both, most\n";

/// Room of a new limit, below and above what is measured, and its resolution.
const ROOM: f64 = 0.12;
const RESOLUTION: f64 = 10.0;

/// Returns the figures of each row: of all models, and of the network.
fn rows(all: &[Costs]) -> [Vec<(String, Vec<u32>)>; 2] {
    [false, true].map(|is_network| {
        let chosen = all.iter().filter(|cost| cost.is_network == is_network);
        let row = |Costs { name, functions: [first, second], .. }: &Costs| {
            let counts = [first.least, first.most, second.least, second.most];
            (name.clone(), [&counts[..], &[first.cycles + second.cycles]].concat())
        };
        chosen.map(row).collect()
    })
}

fn emit([models, networks]: &[Vec<(String, Vec<u32>)>; 2]) -> String {
    let mut text = HEAD.to_owned();
    let write = |text: &mut String, rows: &[(String, Vec<u32>)]| {
        for (name, figures) in rows {
            let cells: Vec<String> = figures.iter().map(u32::to_string).collect();
            let _ = writeln!(text, "{name}\t{}", cells.join("\t"));
        }
    };
    write(&mut text, models);
    text.push_str(NETWORK_HEAD);
    write(&mut text, networks);
    text
}

/// Returns true if a column has lower limits: the first of each pair.
fn is_least(column: usize, columns: usize) -> bool {
    column.is_multiple_of(2) && column + 1 < columns
}

/// Returns limits with room around these figures.
fn with_room(figures: &[u32]) -> Vec<u32> {
    let columns = figures.len();
    let limit = |(column, figure): (usize, &u32)| {
        let figure = f64::from(*figure) / RESOLUTION;
        let least = is_least(column, columns);
        let limit =
            if least { (figure * (1.0 - ROOM)).floor() } else { (figure * (1.0 + ROOM)).ceil() };
        (limit * RESOLUTION) as u32
    };
    figures.iter().enumerate().map(limit).collect()
}

/// Returns the limits of each row.
fn limits() -> BTreeMap<(usize, String), Vec<u32>> {
    let mut limits = BTreeMap::new();
    for (block, text) in LIMITS.split("\n\n").enumerate() {
        for line in text.lines().skip(2) {
            let mut cells = line.split('\t');
            let name = cells.next().unwrap_or_default().to_owned();
            let figures = cells.map(|cell| cell.parse().expect("a number")).collect();
            limits.insert((block, name), figures);
        }
    }
    limits
}

#[test]
fn core_cost_of_every_law_and_term_is_within_its_limits() {
    let rows = rows(&costs().1);
    let written = emit(&rows);
    print!("{written}");
    let folder: PathBuf = [env!("CARGO_TARGET_TMPDIR"), "..", "figures"].iter().collect();
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join("core-cost.tsv"), &written).expect("a file");
    let mut limits = limits();
    let mut violations = String::new();
    for (block, rows) in rows.iter().enumerate() {
        for (name, figures) in rows {
            let columns = figures.len();
            let known = limits.remove(&(block, name.clone())).unwrap_or_default();
            let is_within = |(column, (figure, limit)): (usize, (&u32, &u32))| {
                if is_least(column, columns) { figure >= limit } else { figure <= limit }
            };
            let pairs = figures.iter().zip(&known).enumerate();
            if known.len() != columns || !pairs.into_iter().all(is_within) {
                let cells: Vec<String> = with_room(figures).iter().map(u32::to_string).collect();
                let _ = writeln!(violations, "{name}\t{}\tnow {figures:?}", cells.join("\t"));
            }
        }
    }
    assert!(
        violations.is_empty(),
        "outside tests/emulator/core-cost.tsv; with room:\n{violations}"
    );
    assert!(limits.is_empty(), "no such models: {limits:?}");
}
