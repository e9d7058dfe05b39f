//! Published experiments made anew: each paper's short form runs, and says what it is to say; the damper's, with its networks
//! trained on measured tests, where `LONG_TESTS` is set, and on simulated tests always.
//!
//! What a paper's numbers have to be is in a file of its own beside this one.
#![cfg(feature = "cli")]

mod damper;
mod manipulator;
mod underwater_joint;

use host_sim::papers::{Outcome, PAPERS, Request, Row};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The short form of a paper by the README's command, on the measured logs beside the checkout where they are: its
/// numbers and sentences as they stand in `paper.json`. `tests/readme/run` leaves these commands to this.
pub fn quick(name: &str) -> Outcome {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let command = format!("paper {name} --quick");
    let readme = std::fs::read_to_string(root.join("README.md")).expect("the README is there");
    assert!(readme.contains(&format!("cargo run --release -- {command} ")), "{command}");
    let folder = tempfile::tempdir().expect("a folder");
    let mut program = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    program.args(command.split(' ')).arg("--data").arg(root.join("../shared/data"));
    let output = program.current_dir(folder.path()).output().expect("runs");
    assert!(output.status.success(), "{command}: {}", String::from_utf8_lossy(&output.stderr));
    let page = std::fs::read_to_string(folder.path().join("out/report.html")).expect("a page");
    assert!(page.trim_end().ends_with("</html>"), "{command}: half a page");
    let summary = std::fs::read_to_string(folder.path().join("out/summary.md")).expect("a summary");
    assert_eq!(goals(&docs_page(name)), goals(&summary), "docs/{name}.md: make it anew");
    let json = std::fs::read(folder.path().join("out/paper.json")).expect("numbers");
    let json: Value = serde_json::from_slice(&json).expect("JSON");
    let text = |value: &Value| value.as_str().expect("text").to_owned();
    let list = |name: &str| json[name].as_array().expect("a list").clone();
    let row = |row: &Value| Row {
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
    Outcome { rows: list("rows").iter().map(row).collect(), summary, ..Outcome::default() }
}

/// The page of a paper, which is `summary.md` of its long form as it is.
pub fn docs_page(name: &str) -> String {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../docs/{name}.md"));
    let text = std::fs::read_to_string(page).expect("a page in docs");
    assert!(text.contains(&format!("of `host-sim paper {name} --out DIR`")), "docs/{name}.md");
    assert!(text.contains("The long form, seed 0: "), "docs/{name}.md");
    text
}

/// What the goals of a summary are, in their order.
fn goals(summary: &str) -> Vec<String> {
    let section = summary.split("\n## ").find(|section| section.starts_with("Goals\n"));
    let lines = section.expect("goals").lines().filter(|line| line.starts_with("| "));
    let cell = |line: &str| line.split(" | ").next().unwrap_or_default()[2..].to_owned();
    lines.skip(1).map(cell).collect()
}

/// A paper's short form on measured logs at a place of one's own.
pub fn at(name: &str, data: PathBuf) -> Outcome {
    let paper = PAPERS.iter().find(|paper| paper.name() == name).expect("a paper of that name");
    let progress = |_: &str| {};
    paper.run(&Request { quick: true, seed: 0, data, progress: &progress }).expect("its short form")
}
