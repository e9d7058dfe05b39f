//! `predict --adapt` on logs of real machines whose friction drifts, compared with a table in the repository.
//!
//! A set is identified on the first run. The other runs are predicted by the fixed set, by the set with gains that follow
//! the log, and by models that are fitted to these very rows afterwards, with and without drift. Every figure must be
//! within [`LIMITS`] of that in `measured/adaptation-measured.tsv`.
//!
//! Every run reads the excerpts of [`SHORT`], `LONG_TESTS=1` all full files. The following command writes the table:
//!
//! ```text
//! LONG_TESTS=1 UPDATE_TABLES=1 cargo test --release -p host-sim --test all measured_adaptation::
//! ```
#![cfg(feature = "cli")]

use joint_log::{ReadOptions, read};
use measured_logs::MeasuredLogs;
use serde_json::Value;
use std::fmt::Write as _;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Limits of an error over that in the table. A change of the fit that moves errors by a per cent needs no new table.
const LIMITS: RangeInclusive<f64> = 0.85..=1.05;

/// A log of several runs, of which a set is identified on the first.
struct Case {
    log: &'static str,
    rigid_body: &'static str,
    unit: &'static str,
    /// What is known of its friction.
    known: &'static str,
    /// The adapted error must be at most this share of the fixed set's.
    largest_share: f64,
}

const CASES: [Case; 4] = [
    Case {
        log: "seal-xring-7bar.csv",
        rigid_body: "offset",
        unit: "N",
        known: "the seal's friction rises by a third over ten strokes",
        largest_share: 0.6,
    },
    Case {
        log: "damper-5.csv",
        rigid_body: "offset",
        unit: "N",
        known: "the band is tightened while it moves",
        largest_share: 0.9,
    },
    Case {
        log: "seal-kdn.csv",
        rigid_body: "offset",
        unit: "N",
        known: "the pressure differs from run to run, and the model has no pressure",
        largest_share: 0.6,
    },
    Case {
        log: "robot-axis1.csv",
        rigid_body: "inertia,load,offset",
        unit: "Nm",
        known: "nothing drifts",
        largest_share: 1.02,
    },
];

/// Logs whose excerpts have all rows, so that they have the figures of the full files.
const SHORT: [&str; 2] = ["seal-xring-7bar.csv", "robot-axis1.csv"];

/// Models that are fitted to the predicted rows themselves.
const REFITTED: [&str; 3] = ["lugre", "lugre+time-drift", "lugre+warm-up"];

/// Names of the errors of a case, in the order of its figures.
const COLUMNS: [&str; 6] =
    ["fixed set", "adapted", "refitted", "with time drift", "with warm-up", "each run refitted"];

/// Errors of a case, RMSE in the unit of the log, in the order of [`COLUMNS`].
type Figures = [f64; COLUMNS.len()];

fn table_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("measured/adaptation-measured.tsv")
}

/// The rows of some runs of a log, and a folder for results.
struct Bench<'a> {
    case: &'a Case,
    log: PathBuf,
    folder: tempfile::TempDir,
}

impl Bench<'_> {
    fn run(&self, arguments: &[&str]) -> String {
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        let output = command.args(arguments).current_dir(self.folder.path()).output();
        let output = output.expect("host-sim starts");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments:?}: {said}");
        String::from_utf8(output.stdout).expect("UTF-8")
    }

    /// Identifies a model on runs of the log and writes it to `out`.
    fn identify(&self, runs: &str, model: &str, out: &str, split: &[&str]) {
        let log = self.log.to_str().expect("UTF-8");
        let of = ["identify", log, "--where", runs, "--model", model, "--out", out];
        let body = ["--rigid-body", self.case.rigid_body];
        self.run(&[&of[..], &body, split].concat());
    }

    /// Predicts runs of the log with the model in `out`.
    fn predict(&self, runs: &str, out: &str, options: &[&str]) -> Value {
        let params = format!("{out}/params.toml");
        let log = self.log.to_str().expect("UTF-8");
        let of = ["predict", &params, log, "--where", runs, "--json", "--out", "rows.csv"];
        serde_json::from_str(&self.run(&[&of[..], options].concat())).expect("JSON")
    }
}

/// Nearly all rows are fitted, as the models are to be the best for these rows.
const ALL_ROWS: [&str; 2] = ["--tail", "0.01"];

fn rmse(of: &Value) -> f64 {
    of["rmse"].as_f64().expect("a number")
}

fn runs_of(log: &Path) -> Vec<String> {
    let data = read(&[log.to_owned()], &ReadOptions::default(), &|_, _| {}).expect("a log");
    data.runs.into_iter().map(|run| run.name).collect()
}

fn figures(case: &Case, logs: &MeasuredLogs) -> Figures {
    let log = logs.file(case.log);
    let bench = Bench { case, log, folder: tempfile::tempdir().expect("a folder") };
    let runs = runs_of(&bench.log);
    let first = format!("run={}", runs[0]);
    let others = format!("run={}", runs[1..].join(","));
    bench.identify(&first, "lugre", "first", &[]);
    let followed = bench.predict(&others, "first", &["--adapt"]);
    let mut figures =
        vec![rmse(&followed["adaptation"]["fixed"]), rmse(&followed["adaptation"]["adapted"])];
    for (at, model) in REFITTED.iter().enumerate() {
        let out = format!("refitted-{at}");
        bench.identify(&others, model, &out, &ALL_ROWS);
        figures.push(rmse(&bench.predict(&others, &out, &[])["metrics"]));
    }
    let (mut squares, mut rows) = (0.0, 0.0);
    for (at, run) in runs[1..].iter().enumerate() {
        let (run, out) = (format!("run={run}"), format!("alone-{at}"));
        bench.identify(&run, "lugre", &out, &ALL_ROWS);
        let alone = bench.predict(&run, &out, &[]);
        let count = alone["rows"].as_f64().expect("a number");
        squares += count * rmse(&alone["metrics"]).powi(2);
        rows += count;
    }
    figures.push((squares / rows).sqrt());
    figures.try_into().expect("a figure for each column")
}

fn format_table(all: &[(&Case, Figures)]) -> String {
    let mut text = format!("log\tknown\tunit\t{}\n", COLUMNS.join("\t"));
    for (case, figures) in all {
        let _ = write!(text, "`{}`\t{}\t{}", case.log, case.known, case.unit);
        for figure in figures {
            let _ = write!(text, "\t{}", joint_log::number::significant(*figure, 4));
        }
        text.push('\n');
    }
    text
}

/// Returns the figures of a log in the table.
fn known_figures(text: &str, log: &str) -> Option<Figures> {
    let line = text.lines().find(|line| line.starts_with(&format!("`{log}`")))?;
    let numbers: Option<Vec<f64>> =
        line.split('\t').skip(3).map(|cell| cell.parse().ok()).collect();
    numbers?.try_into().ok()
}

#[test]
fn predict_adapted_of_measured_logs_matches_table() {
    let logs = MeasuredLogs::of_this_run();
    let chosen = CASES.iter().filter(|case| logs.is_full() || SHORT.contains(&case.log));
    let all: Vec<(&Case, Figures)> = chosen.map(|case| (case, figures(case, &logs))).collect();
    if logs.is_full() && std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(table_file(), format_table(&all)).expect("written");
    }
    let text = std::fs::read_to_string(table_file()).expect("the table");
    let mut wrong = Vec::new();
    for (case, figures) in &all {
        let has_changed = |(now, then): (&f64, &f64)| !LIMITS.contains(&(now / then));
        match known_figures(&text, case.log) {
            Some(known) if !figures.iter().zip(&known).any(has_changed) => {}
            known => {
                wrong.push(format!("{}: now {figures:.4?}, in the table {known:.4?}", case.log))
            }
        }
        let [fixed, adapted, ..] = figures;
        if *adapted > case.largest_share * fixed {
            wrong.push(format!("{}: {adapted} of {fixed}", case.log));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
