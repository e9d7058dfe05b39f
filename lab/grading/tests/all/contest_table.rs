//! The table of the contest's figures: every value is within its limits, and the answers that it counts are those of the code.
//!
//! `lab/grading/graded/contest.tsv` holds the figures (`lab/grading/calibrate` makes it, in hours). `contest-worlds.tsv` holds the
//! probabilities on a few worlds, which every run computes again. The following command regenerates it:
//!
//! ```text
//! UPDATE_TABLES=1 cargo test --release -p friction-grading --test all contest_table::
//! ```

use friction_diagnose::contest_calibration::ContestCalibration;
use friction_grading::contest_figures::{FigureRow, LOG_GROUPS, PATH, parse};
use friction_grading::contest_logs::worlds;
use rayon::prelude::*;
use std::path::Path;
use unkind_worlds::{Family, draw_family};

/// Seeds of the worlds.
const SEEDS: std::ops::Range<u64> = 61..71;

/// Least probability of a candidate in the table.
const LEAST: f64 = 0.1;

/// Largest difference of a probability. Another processor or C library changes the last bits of a sine, and a fit then ends
/// elsewhere within its tolerance.
const TOLERANCE: f64 = 0.03;

const STORED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/graded/contest-worlds.tsv");

fn table() -> Vec<FigureRow> {
    parse(&std::fs::read_to_string(PATH).expect("the table is in git")).expect("complete rows")
}

#[test]
fn figures_of_the_contest_are_within_their_limits() {
    let table = table();
    let outside: Vec<&FigureRow> = table.iter().filter(|row| !row.is_within()).collect();
    assert!(outside.is_empty(), "{outside:?}");
    for logs in LOG_GROUPS {
        let rows = table.iter().filter(|row| row.logs == logs);
        assert!(rows.clone().count() >= 8, "{logs}");
        let brier = rows.clone().find(|row| row.figure == "Brier score").expect("a score");
        assert!(brier.limits[1] < 0.5, "{brier:?}");
    }
}

/// Returns the likely candidates of a world, by cause.
fn likely(folder: &Path, seed: u64) -> Vec<(String, f64)> {
    let world = draw_family(seed, Family::Mixed);
    let world_folder = folder.join(seed.to_string());
    std::fs::create_dir_all(&world_folder).expect("a folder");
    std::fs::write(world_folder.join("world.csv"), world.log.csv()).expect("a log");
    std::fs::write(world_folder.join("world.json"), world.truth.json().to_string())
        .expect("a truth");
    let logs = worlds(&world_folder).expect("a world");
    let rows = logs[0].evidence().expect("a contest");
    let calibration = ContestCalibration::current();
    let candidates = rows.iter().filter(|row| row.is_candidate);
    let mut likely: Vec<(String, f64)> = candidates
        .map(|row| {
            let p = calibration.probability_of(&row.cause, &row.follows, &row.figures);
            (format!("{} {}", row.cause, row.follows).trim_end().to_owned(), p)
        })
        .filter(|(_, p)| *p >= LEAST)
        .collect();
    likely.sort_by(|a, b| a.0.cmp(&b.0));
    likely
}

#[test]
fn probabilities_of_stored_worlds_are_what_the_code_computes() {
    let folder = std::env::temp_dir().join(format!("contest-worlds-{}", std::process::id()));
    let computed: Vec<(u64, Vec<(String, f64)>)> =
        SEEDS.into_par_iter().map(|seed| (seed, likely(&folder, seed))).collect();
    std::fs::remove_dir_all(&folder).expect("the folder is ours");
    let lines = computed.iter().flat_map(|(seed, causes)| {
        causes.iter().map(move |(cause, p)| format!("{seed}\t{cause}\t{p:.3}\n"))
    });
    let text = String::from("world\tcause\tprobability\n") + &lines.collect::<String>();
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(STORED, &text).expect("the table is written");
    }
    let stored = std::fs::read_to_string(STORED).expect("the table is in git");
    let cells = |text: &str| -> Vec<(String, f64)> {
        let rows = text.lines().skip(1).filter_map(|line| line.rsplit_once('\t'));
        rows.map(|(key, p)| (key.to_owned(), p.parse().expect("a number"))).collect()
    };
    // A candidate at the edge of the table may be in one only.
    let is_sure = |p: f64| p > LEAST + TOLERANCE;
    let (ours, known) = (cells(&text), cells(&stored));
    for (one, other) in [(&ours, &known), (&known, &ours)] {
        for (key, p) in one.iter().filter(|(_, p)| is_sure(*p)) {
            let twin =
                other.iter().find(|(twin_key, _)| twin_key == key).map_or(f64::NAN, |(_, p)| *p);
            assert!((twin - p).abs() <= TOLERANCE, "{key}: {p} and {twin}\n{text}");
        }
    }
    assert!(ours.iter().any(|(_, p)| is_sure(*p)), "{text}");
}
