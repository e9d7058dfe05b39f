//! The command `paper`: the short form of each paper runs and gives the expected results.
//!
//! The damper's networks are trained on measured tests only if `LONG_TESTS` is set, and on simulated tests always. The
//! expected results of each paper are in a file of their own.
#![cfg(feature = "papers")]

mod damper;
mod manipulator;
mod underwater_joint;

use measured_logs::MeasuredLogs;
use published_experiments::{PAPERS, PaperOutcome, PaperRequest, ResultRow};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs the short form of a paper with the command of the book, and returns the results in its `paper.json`. It uses the measured
/// logs of this run. `tests/readme/run` leaves these commands to this test.
pub fn quick(name: &str) -> PaperOutcome {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let command = format!("paper {name} --quick");
    let guide = root.join("docs/src/how-to/reproduce-the-papers.md");
    let guide = std::fs::read_to_string(guide).expect("the guide is there");
    assert!(
        guide.contains(&format!("cargo run --release --features papers -- {command} ")),
        "{command}"
    );
    let folder = tempfile::tempdir().expect("a folder");
    let mut program = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    program.args(command.split(' ')).arg("--data").arg(MeasuredLogs::of_this_run().folder());
    let output = program.current_dir(folder.path()).output().expect("runs");
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).expect("a page");
    assert!(page.trim_end().ends_with("</html>"), "{command}: half a page");
    let summary = std::fs::read_to_string(folder.path().join("out/summary.md")).expect("a summary");
    assert_eq!(documented_goals(name), goals(&summary), "docs/figures/goals-{name}.tsv: update it");
    let json = std::fs::read(folder.path().join("out/paper.json")).expect("numbers");
    let json: Value = serde_json::from_slice(&json).expect("JSON");
    let text = |value: &Value| value.as_str().expect("text").to_owned();
    let list = |name: &str| json[name].as_array().expect("a list").clone();
    let row = |row: &Value| ResultRow {
        table: text(&row["table"]),
        row: text(&row["row"]),
        column: text(&row["column"]),
        unit: text(&row["unit"]),
        ours: row["ours"].as_f64().expect("a number"),
        spread: row["spread"].as_f64(),
        printed: row["printed"].as_f64(),
        simulated: row["simulated"].as_bool().expect("whether it is simulated"),
    };
    let summary = list("summary").iter().map(text).collect();
    assert!(!list("goals").is_empty());
    PaperOutcome {
        rows: list("rows").iter().map(row).collect(),
        summary,
        ..PaperOutcome::default()
    }
}

/// Returns the goals of a paper that the documentation states, from the figures of its page.
pub fn documented_goals(name: &str) -> Vec<String> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs");
    let page = format!("src/explanation/papers/{name}.md");
    let text = std::fs::read_to_string(docs.join(&page)).expect("a page in docs");
    for part in [
        format!("of `host-sim paper {name} --out DIR`"),
        "The long form, seed 0: ".to_owned(),
        format!("{{{{table: goals-{name}}}}}"),
    ] {
        assert!(text.contains(&part), "docs/{page}: {part}");
    }
    let goals = docs.join(format!("figures/goals-{name}.tsv"));
    let goals = std::fs::read_to_string(goals).expect("goals in docs");
    goals.lines().skip(1).map(|row| row.split('\t').next().unwrap_or_default().to_owned()).collect()
}

/// Returns the names of the goals in a summary.
fn goals(summary: &str) -> Vec<String> {
    let section = summary.split("\n## ").find(|section| section.starts_with("Goals\n"));
    let lines = section.expect("goals").lines().filter(|line| line.starts_with("| "));
    let cell = |line: &str| line.split(" | ").next().unwrap_or_default()[2..].to_owned();
    lines.skip(1).map(cell).collect()
}

/// Runs the short form of a paper with measured logs in this folder.
pub fn at(name: &str, data: PathBuf) -> PaperOutcome {
    let paper = PAPERS.iter().find(|paper| paper.name() == name).expect("a paper of that name");
    let progress = |_: &str| {};
    paper
        .run(&PaperRequest { quick: true, seed: 0, data, progress: &progress })
        .expect("its short form")
}
