//! An effect is hidden in measured logs, and has to be found beside what the machines have of themselves.
//!
//! How is said in `host_sim::benchmark::planted`. Every test run asks about the shortest log, with `LONG_TESTS=1` about all of
//! them, and then compares the table `host-sim/graded/planted.md`, which is made anew by
//!
//! ```text
//! LONG_TESTS=1 UPDATE_TABLES=1 cargo test --release -p host-sim --test planted
//! ```

use host_sim::benchmark::ask;
use host_sim::benchmark::measured::{LOGS, MeasuredLog, folder};
use host_sim::benchmark::planted::{PLANTED, Planted};
use rayon::prelude::*;
use std::fmt::Write;
use std::path::Path;

/// Base of the seeds of covariates and travels.
const SEED: u64 = 20261123;

/// A log, and what the diagnosis leaves of it as it is on rows left out, in the unit of its torque: what is hidden is as large.
const ASKED: [(&str, f64); 5] = [
    ("worm-drive.csv", 1.5e-4),
    ("screw-antibacklash.csv", 4.6e-4),
    ("emps-train.csv", 1.7),
    ("servo-pendulum.csv", 0.49),
    ("bldc-cogging.csv", 0.34),
];

/// What was hidden where, and what was said of it.
struct Answer {
    log: &'static str,
    planted: Planted,
    named: Vec<String>,
    /// The cause was named, or not told from one that was.
    is_named: bool,
    /// Something was said to follow the covariate.
    is_blamed: bool,
    gain: f64,
}

fn answer(folder: &Path, log: &MeasuredLog, planted: Planted, rms: f64, seed: u64) -> Answer {
    let (mut data, question) = log.read(folder).expect("a log by the contract").expect("the log");
    planted.hide(&mut data, rms, seed);
    let column = planted.covariate.name(data.joint);
    let (found, _) = ask(data, &question).expect("an answer");
    let is_it = |name: &str| Some(name) == planted.cause;
    let said = found.findings.iter();
    Answer {
        log: log.file,
        planted,
        named: said
            .clone()
            .map(|f| format!("{} ({})", f.cause.name(), f.columns.join(", ")))
            .collect(),
        is_named: said.clone().any(|f| {
            is_it(f.cause.name()) || f.confusable_with.iter().any(|r| is_it(r.cause.name()))
        }),
        is_blamed: said.clone().any(|f| f.columns.iter().any(|own| own == column)),
        gain: found.gain.value,
    }
}

fn is_long() -> bool {
    std::env::var_os("LONG_TESTS").is_some()
}

#[test]
fn what_is_hidden_in_a_measured_log_is_found_and_a_decoy_is_not() {
    let Some(folder) = folder() else {
        println!("skipped: effects hidden in measured logs: there are no logs");
        return;
    };
    let logs = &ASKED[..if is_long() { ASKED.len() } else { 1 }];
    let cases: Vec<_> = logs
        .iter()
        .enumerate()
        .flat_map(|(at, (file, rms))| {
            PLANTED.iter().map(move |planted| (at, *file, *rms, *planted))
        })
        .collect();
    let answers: Vec<Answer> = cases
        .par_iter()
        .enumerate()
        .map(|(place, (_, file, rms, planted))| {
            let log = LOGS.iter().find(|log| log.file == *file).expect("a known log");
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
    // One in five is missed or only seen to follow its column.
    let named = hidden().filter(|answer| answer.is_named).count();
    assert!(5 * named >= 4 * hidden().count(), "{named} of {} are named", hidden().count());
    if is_long() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("graded/planted.md");
        if std::env::var_os("UPDATE_TABLES").is_some() {
            std::fs::write(&path, &table).expect("the table is written");
        }
        let kept = std::fs::read_to_string(&path).expect("the table");
        assert_eq!(kept, table, "UPDATE_TABLES=1 makes it anew");
    }
}

fn table(answers: &[Answer]) -> String {
    let mut text = "# Effects hidden in measured logs\n\nMade by `tests/planted.rs`: what is hidden is simulated and as large as what the diagnosis leaves of \
                    the log as it is; all else is measured.\n\n| log | hidden | verdict | named |\n|---|---|---|---|\n"
        .to_owned();
    for answer in answers {
        let hidden = answer.planted.cause.unwrap_or("nothing: a decoy");
        let verdict = match (answer.planted.cause, answer.is_named, answer.is_blamed) {
            (None, _, false) => "not blamed",
            (None, _, true) => "blamed",
            (Some(_), true, _) => "named",
            (Some(_), false, true) => "seen to follow its column",
            (Some(_), false, false) => "missed",
        };
        let _ = writeln!(
            text,
            "| {} | {hidden} | {verdict} | {} |",
            answer.log,
            answer.named.join("; ")
        );
    }
    text
}
