//! `scope` as a user runs it: the current loop of the simulated joint at 20 kHz, as files and on the terminal.

use crate::snapshot;
use serde_json::Value;
use std::path::Path;
use std::process::Command;

const PROGRAM: &str = env!("CARGO_BIN_EXE_host-sim");

fn run(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output =
        Command::new(PROGRAM).current_dir(folder).args(arguments).output().expect("starts");
    let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn scope_with_level_trigger_shows_what_led_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["scope", "--signals", "velocity_rad_s,current_a,friction_torque_nm"];
    let more = ["--trigger", "velocity_rad_s>0.05", "--before", "0.5", "--json"];
    let (code, out, stderr) = run(folder.path(), &[&arguments[..], &more].concat());
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    let found: Value = serde_json::from_str(&out).unwrap();
    let at = |path: &str| found.pointer(path).unwrap_or_else(|| panic!("{path}: {out}")).clone();
    assert_eq!((at("/rows"), at("/trigger_rows/0")), (2048.into(), 1024.into()));
    assert!((at("/period_s").as_f64().unwrap() - 5e-5).abs() < 1e-10);
    let number = |path: &str| at(path).as_f64().unwrap();
    // The joint reverses: its model's friction changes sign within the capture.
    assert!(number("/signals/0/max") > 0.05 && number("/signals/0/min") < 0.05, "{out}");
    assert!(number("/signals/2/max") > 0.5, "{out}");
    let page = std::fs::read_to_string(folder.path().join("out/scope.html")).unwrap();
    assert!(page.contains("trigger: velocity_rad_s&gt;0.05") && page.contains("20000 Hz"));
}

#[test]
fn rows_of_several_captures_are_a_log_with_runs() {
    let folder = tempfile::tempdir().unwrap();
    let arguments = ["scope", "--rate", "1000", "--captures", "2", "--out", "runs"];
    let (code, out, stderr) = run(folder.path(), &arguments);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    for part in ["2 captures", "3072 rows", "1000 Hz", "trigger: now"] {
        assert!(out.contains(part), "{part}: {out}");
    }
    snapshot::check("scope", "two captures", &out);
    let fit = ["identify", "runs/scope.parquet", "--model", "linear", "--json", "--out", "fit"];
    let (code, out, stderr) = run(folder.path(), &fit);
    assert_eq!(code, Some(0), "{stderr}");
    assert!(out.contains("coulomb_torque"), "{out}");
    assert!(stderr.contains("2 runs, 6144 rows, 1000 Hz"), "{stderr}");
}

#[test]
fn scope_that_cannot_be_made_says_why_in_a_line_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = String::new();
    for (arguments, part) in [
        (vec!["--signals", "speed"], "current_a, current_d_a"),
        (vec!["--signals", "current_a,current_a"], "current_a"),
        (vec!["--trigger", "current_a>1"], "--signals"),
        (vec!["--trigger", "velocity_rad_s=1"], "NAME>LEVEL or NAME<LEVEL"),
        (vec!["--rate", "30000"], "0.3 to 20000"),
        (vec!["--before", "1"], "0 to 0.95"),
        (vec!["--trigger", "velocity_rad_s>9", "--timeout", "0.2"], "0.2 s"),
        (vec!["--node-id", "2"], "node 1"),
    ] {
        let (code, out, stderr) = run(folder.path(), &[&["scope"][..], &arguments].concat());
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments:?}: {stderr}");
        assert!(stderr.contains(part) && stderr.lines().count() == 1, "{stderr}");
        messages += &stderr;
    }
    snapshot::check("scope", "bad arguments", &messages);
    assert!(!folder.path().join("out").exists());
}
