//! `simulate underwater-joint`: hidden effects, refusals, and files that are kept.
//!
//! The tests of `friction-grading` check that a simulated scenario contains exactly the effects of its truth.

use crate::snapshot;
use joint_log::{ReadOptions, read};
use std::fs;
use std::process::Command;

/// Runs `simulate`. Returns exit code, standard output and standard error.
fn simulate(folder: &tempfile::TempDir, arguments: &str) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(["simulate", "underwater-joint"]).args(arguments.split_whitespace());
    let output = command.current_dir(folder.path()).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn simulate_with_hide_writes_the_requested_effects() {
    let folder = tempfile::tempdir().unwrap();
    let how = "--runs 6 --seconds 2 --rate 200 --noise 0.04 --seed 5 --json --force";
    for (hide, causes, size) in [
        ("--hide none", vec![], None),
        ("--hide pressure-coulomb:2e-6", vec!["pressure-coulomb"], Some(2e-6)),
        ("--hide torque-offset:-0.2 --hide backlash", vec!["backlash", "torque-offset"], None),
        ("--hide unknown", vec!["unknown"], None),
    ] {
        let (code, stdout, stderr) = simulate(&folder, &format!("{hide} {how}"));
        assert_eq!(code, Some(0), "{stderr}");
        let truth: serde_json::Value = serde_json::from_str(&stdout).unwrap();
        let hidden = truth["hidden"].as_array().unwrap();
        let mut found: Vec<&str> = hidden.iter().filter_map(|one| one["cause"].as_str()).collect();
        found.sort_unstable();
        assert_eq!(found, causes);
        if let Some(size) = size {
            assert_eq!(hidden[0]["size"]["value"].as_f64(), Some(size));
        }
        assert_eq!(truth["recording"]["runs"], 6);
        assert_eq!(truth["recording"]["torque_noise_nm"], 0.04);
        assert_eq!(fs::read_to_string(folder.path().join("out/truth.json")).unwrap(), stdout);
        let path = folder.path().join("out/data.csv");
        let data = read(&[path], &ReadOptions::default(), &|_, _| {}).unwrap();
        assert_eq!(data.runs.len(), 6);
    }
}

#[test]
fn simulate_into_folder_of_another_run_needs_force() {
    let folder = tempfile::tempdir().unwrap();
    let how = "--runs 1 --seconds 0.2 --rate 200";
    let log = || fs::read(folder.path().join("out/data.csv")).unwrap();
    assert_eq!(simulate(&folder, &format!("{how} --seed 5")).0, Some(0));
    let first = log();
    let (code, _, stderr) = simulate(&folder, &format!("{how} --seed 5"));
    assert_eq!((code, log()), (Some(0), first.clone()), "the same run again: {stderr}");
    let (code, stdout, stderr) = simulate(&folder, &format!("{how} --seed 6"));
    assert_eq!((code, stdout.as_str(), stderr.lines().count()), (Some(2), "", 1), "{stderr}");
    assert!(stderr.contains("out/data.csv") && stderr.contains("--force"), "{stderr}");
    assert_eq!(log(), first, "the other run's file is unchanged");
    assert_eq!(simulate(&folder, &format!("{how} --seed 6 --force")).0, Some(0));
    assert_ne!(log(), first);
}

#[test]
fn simulate_with_invalid_hide_returns_one_line_error() {
    let folder = tempfile::tempdir().unwrap();
    let mut messages = String::new();
    for (arguments, word) in [
        ("--hide pressure", "none, radial-force-coulomb"),
        ("--hide pressure-coulomb:7", "0 to 0.0001 Nm/Pa"),
        ("--hide none --hide backlash", "none"),
        ("--hide backlash --hide backlash", "two"),
        ("--hide backlash --hide torque-offset --hide time-drift", "two"),
        ("--hide none --unloaded", "--unloaded"),
        ("--hide none --runs 1000 --seconds 1000", "2000 s"),
        ("--hide none --runs 10 --seconds 10 --rate 1e6", "5000000 rows"),
    ] {
        let (code, stdout, stderr) = simulate(&folder, arguments);
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{arguments}");
        assert_eq!(stderr.lines().count(), 1, "{arguments}: {stderr}");
        assert!(stderr.contains(word), "{arguments}: {stderr}");
        messages += &stderr;
    }
    snapshot::check("simulate", "bad hidden effects", &messages);
    assert!(!folder.path().join("out").exists(), "an error must leave no file");
}
