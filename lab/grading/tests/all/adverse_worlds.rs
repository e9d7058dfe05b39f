//! The diagnosis on unkind worlds: limits on the stored answers, and properties of the worlds.
//!
//! `stored_worlds.rs` proves that the code gives the stored answers. The full benchmark, beside a plain regression, is
//! `cargo run --release -p friction-grading --example unkind`; its tables are in
//! `lab/grading/graded/diagnosis-benchmark.tsv`. The limits are the results currently reached.

use crate::stored_worlds::answers;
use friction_grading::contest::Verdict;
use friction_grading::stored::{
    IMITATED_SEEDS, StoredWorld, UNKIND_SEEDS, WRONG_SHAPE_SEEDS, WorldRow,
};
use rayon::prelude::*;
use unkind_worlds::SensorKind;

/// Number of [`UNKIND_SEEDS`] that every run judges.
const SHORT: usize = 7;

fn unkind(seeds: &[u64]) -> Vec<WorldRow> {
    answers(&seeds.iter().copied().map(StoredWorld::Unkind).collect::<Vec<StoredWorld>>())
}

#[test]
fn diagnose_on_adverse_scenarios_stays_within_grade_limits() {
    let rows = unkind(&UNKIND_SEEDS[..if crate::is_long() { UNKIND_SEEDS.len() } else { SHORT }]);
    let count = |verdict| rows.iter().filter(|row| row.verdict == verdict).count();
    let (right, wrong) = (count(Verdict::Right), count(Verdict::Wrong));
    println!("{right} right and {wrong} wrong of {}", rows.len());
    assert!(2 * right >= rows.len() && 4 * wrong <= rows.len(), "{right} right, {wrong} wrong");
    let regression = |verdict| rows.iter().filter(|row| row.regression == Some(verdict)).count();
    assert!(wrong < regression(Verdict::Wrong), "the plain regression is wrong less often");
}

/// The base law of these worlds has a wrong shape. No cause may be named.
#[test]
fn diagnose_with_base_law_of_wrong_shape_names_no_cause() {
    for row in unkind(&WRONG_SHAPE_SEEDS) {
        assert_names_no_cause(&row);
        assert!(row.error_over_floor < 1.5, "{row:?}");
    }
}

fn assert_names_no_cause(row: &WorldRow) {
    assert_eq!(row.verdict, Verdict::Right, "{row:?}");
    assert!(row.named.split('+').all(|name| ["none", "unknown"].contains(&name)), "{row:?}");
}

#[test]
fn diagnose_with_imitated_cause_names_none_and_corrects_speed_dependence() {
    let rows = unkind(&IMITATED_SEEDS);
    rows.iter().for_each(assert_names_no_cause);
    assert!(rows[2].error_over_floor < 2.0 && rows[2].gain > 0.5, "{:?}", rows[2]);
}

#[test]
fn draw_with_same_seed_gives_same_scenario() {
    for seed in unkind_worlds::seeds(3).take(3) {
        let (one, other) = (unkind_worlds::draw(seed), unkind_worlds::draw(seed));
        assert_eq!(one.log, other.log);
        assert_eq!(one.truth.json(), other.truth.json());
    }
}

#[test]
fn draw_with_late_channel_keeps_all_rows() {
    let world = unkind_worlds::draw(453192869);
    for run in &world.log.runs {
        let rows: Vec<usize> = run.columns.iter().map(Vec::len).collect();
        assert!(rows.iter().all(|count| *count == rows[0]), "run {}: {rows:?}", run.name);
    }
}

#[test]
fn draw_covers_all_sensor_kinds_and_plants() {
    let worlds: Vec<_> = unkind_worlds::seeds(5)
        .take(24)
        .collect::<Vec<u64>>()
        .into_par_iter()
        .map(unkind_worlds::draw)
        .collect();
    for kind in SensorKind::ALL {
        assert!(worlds.iter().any(|w| w.truth.sensor == kind), "{}", kind.name());
    }
    for plant in ["bristles", "slip-elements"] {
        assert!(worlds.iter().any(|w| w.truth.plant == plant), "{plant}");
    }
    let hidden = |w: &&unkind_worlds::UnkindWorld| !w.truth.hidden.is_empty();
    assert!(worlds.iter().any(|w| !hidden(&w)));
    assert!(worlds.iter().filter(hidden).any(|w| !w.truth.is_detectable()));
    assert!(worlds.iter().filter(hidden).any(|w| w.truth.gain_in_errors() > 30.0));
    for world in &worlds {
        let truth = &world.truth;
        let seed = truth.seed;
        assert!((1_500..=25_000).contains(&world.log.rows()), "{seed}: {} rows", world.log.rows());
        assert!((3..=40).contains(&world.log.runs.len()), "{seed}");
        assert!((49.0..=2001.0).contains(&truth.rate_hz), "{seed}");
        assert!(truth.floor_nm.is_finite() && truth.floor_nm > 0.0, "{seed}");
        let position = world.log.columns.iter().any(|name| name == "position_rad");
        assert_eq!(position, truth.sensor != SensorKind::NoPosition, "{seed}");
        for run in &world.log.runs {
            assert!(run.columns.iter().flatten().all(|x| x.is_finite()), "{seed}");
            let is_increasing = run.columns[0].windows(2).all(|t| t[0] < t[1]);
            assert!(is_increasing, "{seed}: time does not increase");
        }
        // With exact sensors and a bristle plant, the floor is the sensor noise, plus that of the initial torque in
        // presliding.
        if truth.sensor == SensorKind::Exact && truth.plant == "bristles" {
            let ratio = truth.floor_nm / truth.noise_nm;
            assert!((0.95..1.5).contains(&ratio), "{seed}: {ratio}");
        }
    }
}
