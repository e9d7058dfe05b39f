//! Grades the diagnosis on measured logs with an added simulated effect.
//!
//! `friction_grading::planted` describes the method. Every test run uses the shortest log, and with `LONG_TESTS=1` all
//! logs. The long form compares the table `lab/grading/graded/planted.tsv`, which the following command regenerates:
//!
//! ```text
//! LONG_TESTS=1 UPDATE_TABLES=1 cargo test --release -p friction-grading --test all planted::
//! ```

use friction_grading::diagnose_log;
use friction_grading::measured::{MEASURED_LOGS, MeasuredLog, folder};
use friction_grading::planted::{PLANTED_EFFECTS, PlantedEffect};
use rayon::prelude::*;
use std::fmt::Write;
use std::path::Path;

/// Base of the seeds of covariates and motions.
const SEED: u64 = 20261123;

/// The logs, each with the RMS size of the added effect in the unit of its torque. The size equals the held-out error of
/// the diagnosis on the unchanged log.
const LOG_SIZES: [(&str, f64); 5] = [
    ("worm-drive.csv", 1.5e-4),
    ("screw-antibacklash.csv", 4.6e-4),
    ("emps-train.csv", 1.7),
    ("servo-pendulum.csv", 0.49),
    ("bldc-cogging.csv", 0.34),
];

/// A log with an added effect, and its diagnosis.
struct Answer {
    log: &'static str,
    planted: PlantedEffect,
    named: Vec<String>,
    /// True if the cause is a finding, or is listed as indistinguishable from one.
    is_named: bool,
    /// True if a finding follows the covariate.
    is_blamed: bool,
    gain: f64,
}

fn answer(folder: &Path, log: &MeasuredLog, planted: PlantedEffect, rms: f64, seed: u64) -> Answer {
    let (mut data, question) = log.read(folder).expect("a log by the contract").expect("the log");
    planted.hide(&mut data, rms, seed);
    let column = planted.covariate.name(data.joint);
    let (found, _) = diagnose_log(data, &question).expect("an answer");
    let is_it = |name: &str| Some(name) == planted.cause;
    let findings = found.findings.iter();
    Answer {
        log: log.file,
        planted,
        named: findings
            .clone()
            .map(|f| format!("{} ({})", f.cause.name(), f.columns.join(", ")))
            .collect(),
        is_named: findings.clone().any(|f| {
            is_it(f.cause.name()) || f.confusable_with.iter().any(|r| is_it(r.cause.name()))
        }),
        is_blamed: findings.clone().any(|f| f.columns.iter().any(|own| own == column)),
        gain: found.gain.value,
    }
}

#[test]
fn diagnose_finds_planted_effects_and_ignores_decoys() {
    let Some(folder) = folder() else {
        println!("skipped: effects planted in measured logs: the logs are missing");
        return;
    };
    let logs = &LOG_SIZES[..if crate::is_long() { LOG_SIZES.len() } else { 1 }];
    let cases: Vec<_> = logs
        .iter()
        .enumerate()
        .flat_map(|(at, (file, rms))| {
            PLANTED_EFFECTS.iter().map(move |planted| (at, *file, *rms, *planted))
        })
        .collect();
    let answers: Vec<Answer> = cases
        .par_iter()
        .enumerate()
        .map(|(place, (_, file, rms, planted))| {
            let log = MEASURED_LOGS.iter().find(|log| log.file == *file).expect("a known log");
            answer(&folder, log, *planted, *rms, SEED + place as u64)
        })
        .collect();
    let table = table(&answers);
    println!("{table}");
    for answer in answers.iter().filter(|answer| answer.planted.cause.is_none()) {
        assert!(!answer.is_blamed, "{}: a decoy is blamed: {:?}", answer.log, answer.named);
    }
    for answer in &answers {
        assert!(answer.gain >= 0.0, "{}: {:?} gains {}", answer.log, answer.named, answer.gain);
    }
    let hidden = || answers.iter().filter(|answer| answer.planted.cause.is_some());
    // At most one in five may be missed or only found to follow its column.
    let named = hidden().filter(|answer| answer.is_named).count();
    assert!(5 * named >= 4 * hidden().count(), "{named} of {} are named", hidden().count());
    if crate::is_long() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("graded/planted.tsv");
        if std::env::var_os("UPDATE_TABLES").is_some() {
            std::fs::write(&path, &table).expect("the table is written");
        }
        let kept = std::fs::read_to_string(&path).expect("the table");
        assert_eq!(kept, table, "UPDATE_TABLES=1 regenerates the table");
    }
}

fn table(answers: &[Answer]) -> String {
    let mut text = "log\thidden\tverdict\tnamed\n".to_owned();
    for answer in answers {
        let hidden = answer.planted.cause.unwrap_or("decoy (no effect)");
        let verdict = match (answer.planted.cause, answer.is_named, answer.is_blamed) {
            (None, _, false) => "not named",
            (None, _, true) => "named",
            (Some(_), true, _) => "named",
            (Some(_), false, true) => "column found, other cause",
            (Some(_), false, false) => "missed",
        };
        let _ = writeln!(text, "{}\t{hidden}\t{verdict}\t{}", answer.log, answer.named.join("; "));
    }
    text
}
