//! Grades the diagnosis on measured logs with an added simulated effect.
//!
//! `friction_grading::planted` describes the method. `lab/grading/graded/planted.tsv` holds the answers on all full logs. Every
//! run judges them, and diagnoses a decoy and one effect in an excerpt; `LONG_TESTS=1` judges all of the code's. The following
//! command regenerates the table:
//!
//! ```text
//! LONG_TESTS=1 UPDATE_TABLES=1 cargo test --release -p friction-grading --test all planted::
//! ```

use friction_grading::diagnose_log;
use friction_grading::measured::{MEASURED_LOGS, MeasuredLog};
use friction_grading::planted::{PLANTED_EFFECTS, PlantedEffect};
use measured_logs::MeasuredLogs;
use rayon::prelude::*;
use std::fmt::Write;
use std::path::{Path, PathBuf};

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

fn answer(
    logs: &MeasuredLogs,
    log: &MeasuredLog,
    planted: PlantedEffect,
    rms: f64,
    seed: u64,
) -> Answer {
    let (mut data, question) = log.read(logs).expect("a log by the contract").expect("the log");
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
        is_blamed: findings.clone().any(|f| f.columns.iter().any(|name| name == column)),
        gain: found.gain.value,
    }
}

impl Answer {
    fn verdict(&self) -> &'static str {
        match (self.planted.cause, self.is_named, self.is_blamed) {
            (None, _, false) => "not named",
            (None, _, true) => "named",
            (Some(_), true, _) => "named",
            (Some(_), false, true) => "column found, other cause",
            (Some(_), false, false) => "missed",
        }
    }
}

/// Effects in the first log that every run diagnoses: the decoy and the first effect.
const SHORT: usize = 2;

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("graded/planted.tsv")
}

#[test]
fn diagnose_finds_planted_effects_and_ignores_decoys() {
    let logs = MeasuredLogs::of_this_run();
    let all = LOG_SIZES
        .iter()
        .flat_map(|(file, rms)| PLANTED_EFFECTS.iter().map(move |planted| (*file, *rms, *planted)));
    let cases: Vec<_> = all.take(if logs.is_full() { usize::MAX } else { SHORT }).collect();
    let answers: Vec<Answer> = cases
        .par_iter()
        .enumerate()
        .map(|(place, (file, rms, planted))| {
            let log = MEASURED_LOGS.iter().find(|log| log.file == *file).expect("a known log");
            answer(&logs, log, *planted, *rms, SEED + place as u64)
        })
        .collect();
    for answer in &answers {
        assert!(answer.gain >= 0.0, "{}: {:?} gains {}", answer.log, answer.named, answer.gain);
    }
    let table = table(&answers);
    if !logs.is_full() {
        let verdicts: Vec<&str> = answers.iter().map(Answer::verdict).collect();
        assert_eq!(verdicts, ["not named", "named"], "{table}");
        return;
    }
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(path(), &table).expect("the table is written");
    }
    judge(&table);
    assert_eq!(table.lines().count() - 1, LOG_SIZES.len() * PLANTED_EFFECTS.len(), "{table}");
}

#[test]
fn stored_answers_find_planted_effects_and_ignore_decoys() {
    let kept = std::fs::read_to_string(path()).expect("the table");
    judge(&kept);
    let count = |is_decoy: bool| {
        let rows = kept.lines().filter(|line| line.contains(".csv\t"));
        rows.filter(|line| line.contains("decoy") == is_decoy).count()
    };
    assert_eq!(count(true), LOG_SIZES.len());
    assert_eq!(count(false), LOG_SIZES.len() * (PLANTED_EFFECTS.len() - 1));
}

/// Requires that no decoy is blamed, and that at most one effect in five is missed or only found to follow its column.
fn judge(table: &str) {
    let verdict = |line: &str| line.split('\t').nth(2).unwrap_or_default().to_owned();
    let rows = || table.lines().filter(|line| line.contains(".csv\t"));
    let decoys = rows().filter(|line| line.contains("decoy"));
    decoys.for_each(|line| assert_eq!(verdict(line), "not named", "a decoy is blamed: {line}"));
    let hidden = || rows().filter(|line| !line.contains("decoy"));
    let named = hidden().filter(|line| verdict(line) == "named").count();
    assert!(5 * named >= 4 * hidden().count(), "{named} of {} are named", hidden().count());
}

fn table(answers: &[Answer]) -> String {
    let mut text = "log\thidden\tverdict\tnamed\n".to_owned();
    for answer in answers {
        let hidden = answer.planted.cause.unwrap_or("decoy (no effect)");
        let verdict = answer.verdict();
        let _ = writeln!(text, "{}\t{hidden}\t{verdict}\t{}", answer.log, answer.named.join("; "));
    }
    text
}
