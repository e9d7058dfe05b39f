//! The stored worlds: their rows are what the code computes, and decision and calibration hold on them.
//!
//! `friction_grading::stored` describes the tables. Every run computes the worlds of [`SHORT`] again, `LONG_TESTS=1` all. The
//! tables may lack worlds; a test that needs one diagnoses it. With `UPDATE_TABLES=1` all are computed and both tables
//! written:
//!
//! ```text
//! UPDATE_TABLES=1 cargo test --release -p friction-grading --test all stored_worlds::
//! ```

use friction_diagnose::calibration::Calibration;
use friction_grading::stored::{
    EvidenceRow, StoredWorld, WorldRow, WorldRows, emit_evidence, emit_worlds, parse_evidence,
    parse_worlds, stored_worlds,
};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Seeds of the worlds that every run computes again.
const SHORT: [u64; 3] = [3323915129, 1225412155, 4928642751683831197];

/// Largest difference of a number from its stored value, relative to values above 1. Another processor or C library changes
/// the last bits of a sine, and a fit then ends elsewhere within its tolerance.
const TOLERANCE: f64 = 1e-3;

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graded").join(name)
}

fn read(name: &str) -> String {
    std::fs::read_to_string(path(name)).expect("the table is in git")
}

/// Returns the stored rows of all worlds.
pub fn worlds() -> Vec<WorldRow> {
    parse_worlds(&read("worlds.tsv")).expect("complete rows")
}

/// Returns the answers on worlds: the stored rows, and else what the diagnosis gives now.
pub fn answers(chosen: &[StoredWorld]) -> Vec<WorldRow> {
    let stored = worlds();
    let answer = |world: &StoredWorld| {
        let known = stored.iter().find(|row| row.seed == world.seed()).cloned();
        known.unwrap_or_else(|| world.compute().expect("a diagnosis").world)
    };
    chosen.par_iter().map(answer).collect()
}

/// Returns the stored rows of all causes.
fn evidence() -> Vec<EvidenceRow> {
    parse_evidence(&read("evidence.tsv")).expect("complete rows")
}

fn compute(worlds: &[StoredWorld]) -> Vec<WorldRows> {
    let compute = |world: &StoredWorld| {
        let rows = world.compute().expect("a diagnosis");
        print!("{}{}", emit_worlds([&rows.world].into_iter()), emit_evidence(rows.evidence.iter()));
        rows
    };
    worlds.par_iter().map(compute).collect()
}

/// Asserts that two tables are equal, numbers within [`TOLERANCE`].
fn assert_equal_rows(computed: &str, stored: &str) {
    assert_eq!(computed.lines().count(), stored.lines().count(), "{computed}\n{stored}");
    for (ours, known) in computed.lines().zip(stored.lines()) {
        let (cells, expected) = (ours.split('\t'), known.split('\t'));
        assert_eq!(cells.clone().count(), expected.clone().count(), "{ours}\n{known}");
        for (cell, expected) in cells.zip(expected) {
            let is_equal = match (cell.parse::<f64>(), expected.parse::<f64>()) {
                (Ok(a), Ok(b)) => (a - b).abs() <= TOLERANCE * b.abs().max(1.0),
                _ => cell == expected,
            };
            assert!(is_equal, "{cell} for {expected}: the diagnosis changed?\n{ours}\n{known}");
        }
    }
}

#[test]
fn stored_rows_equal_those_that_the_code_computes() {
    let all = stored_worlds();
    if std::env::var_os("UPDATE_TABLES").is_some() {
        let rows = compute(&all);
        let text = emit_worlds(rows.iter().map(|row| &row.world));
        std::fs::write(path("worlds.tsv"), text).expect("the folder is there");
        let text = emit_evidence(rows.iter().flat_map(|row| &row.evidence));
        std::fs::write(path("evidence.tsv"), text).expect("the folder is there");
    }
    let (worlds, evidence) = (worlds(), evidence());
    let is_stored = |world: &StoredWorld| worlds.iter().any(|row| row.seed == world.seed());
    assert_eq!(all.iter().filter(|world| is_stored(world)).count(), worlds.len());
    let is_computed = |world: &StoredWorld| {
        is_stored(world) && (crate::is_long() || SHORT.contains(&world.seed()))
    };
    let chosen: Vec<StoredWorld> = all.into_iter().filter(is_computed).collect();
    assert!(chosen.len() >= SHORT.len());
    let seeds: Vec<u64> = chosen.iter().map(|world| world.seed()).collect();
    let computed = compute(&chosen);
    let stored = worlds.iter().filter(|row| seeds.contains(&row.seed));
    assert_equal_rows(&emit_worlds(computed.iter().map(|row| &row.world)), &emit_worlds(stored));
    let stored = evidence.iter().filter(|row| seeds.contains(&row.seed));
    let computed = computed.iter().flat_map(|row| &row.evidence);
    assert_equal_rows(&emit_evidence(computed), &emit_evidence(stored));
}

#[test]
fn probability_of_stored_evidence_equals_calibration_in_use() {
    for row in evidence() {
        let model = &Calibration::current().finding;
        let probability = model.calibrated(model.log_odds(&row.figures));
        assert!((probability - row.probability).abs() < 1e-4, "{row:?}: now {probability}");
    }
}

/// A named cause has reached the threshold. What a rule or the evaluation withdrew may lie above it and be unnamed.
#[test]
fn named_causes_of_stored_worlds_reach_the_threshold() {
    let threshold = Calibration::current().naming_threshold;
    for row in evidence().iter().filter(|row| row.is_named) {
        assert!(row.probability >= threshold, "{row:?}");
    }
    // The decision by the calibration alone: the first cause at the threshold is the name of a world.
    let (worlds, evidence) = (worlds(), evidence());
    let first =
        |seed: u64| evidence.iter().find(|row| row.seed == seed && row.probability >= threshold);
    let names: Vec<&EvidenceRow> = worlds.iter().filter_map(|row| first(row.seed)).collect();
    let false_names = names.iter().filter(|row| !row.is_real).count();
    println!("{} names, {false_names} false", names.len());
    assert!(2 * names.len() >= worlds.len() && 10 * false_names <= worlds.len());
}

/// Real causes have higher probabilities than others, as the Brier score and the mean of each group show.
#[test]
fn probabilities_of_stored_evidence_are_calibrated() {
    let evidence = evidence();
    let truth = |row: &EvidenceRow| f64::from(u8::from(row.is_real));
    let brier = evidence.iter().map(|row| (row.probability - truth(row)).powi(2)).sum::<f64>()
        / evidence.len() as f64;
    let mean = |is_real: bool| {
        let own = evidence.iter().filter(|row| row.is_real == is_real);
        own.clone().map(|row| row.probability).sum::<f64>() / own.count() as f64
    };
    let (real, other) = (mean(true), mean(false));
    println!("{} causes, Brier score {brier:.3}, mean {real:.3} and {other:.3}", evidence.len());
    assert!(brier < 0.15, "Brier score {brier}");
    assert!(real > other + 0.4, "mean probability {real} of real causes, {other} of others");
}
