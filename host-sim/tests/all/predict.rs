//! `predict` and the file `rows.parquet`: every command gives the same prediction of the same model.
#![cfg(feature = "cli")]

use crate::snapshot;
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

/// Rows of each run.
const ROWS: usize = 300;

/// Writes a log of two runs of a joint with Coulomb and viscous friction.
fn write_log(folder: &Path) {
    let mut text = "run,time_s,velocity_rad_s,torque_nm,pressure_diff_pa\n".to_owned();
    for run in 0..2 {
        for row in 0..ROWS {
            let t = 0.01 * row as f64;
            let v = (1.0 + f64::from(run)) * (4.0 * t).sin();
            let noise = 0.01 * ((row * 7919) % 1000) as f64 / 1000.0;
            let y = 1.2 * v.signum() + 0.3 * v + noise;
            let _ = writeln!(text, "{run},{t:.2},{v:.6},{y:.6},{}", 1e5 + 1e3 * t);
        }
    }
    std::fs::write(folder.join("log.csv"), text).expect("written");
}

/// Runs the program in a folder. Returns its exit code and its standard error or output.
fn run(folder: &Path, arguments: &str) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let output = command.args(arguments.split_whitespace()).current_dir(folder).output();
    let output = output.expect("host-sim starts");
    let said = if output.status.success() { output.stdout } else { output.stderr };
    (output.status.code(), String::from_utf8(said).expect("UTF-8"))
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn predict_with_written_model_returns_rows_of_the_command_that_wrote_it() {
    let folder = tempfile::tempdir().expect("a folder");
    write_log(folder.path());
    for (command, document) in [
        ("identify log.csv --model lugre --out a", "a/fit.json"),
        ("compare log.csv --models linear,lugre --out b", "b/compare.json"),
        ("diagnose log.csv --out c", "c/diagnosis.json"),
    ] {
        let (code, said) = run(folder.path(), command);
        assert_eq!(code, Some(0), "{said}");
        let written = document.split('/').next().expect("a folder");
        let text = std::fs::read_to_string(folder.path().join(document)).expect("read");
        let stated = &json(&text)["prediction"];
        let (code, said) = run(
            folder.path(),
            &format!("predict {written}/params.toml log.csv --json --out p.parquet"),
        );
        assert_eq!(code, Some(0), "{said}");
        let predicted = json(&said);
        assert_eq!(predicted["metrics"]["rmse"], stated["rmse"], "{command}");
        assert_eq!(predicted["as_exported_rmse"], stated["as_exported_rmse"], "{command}");
        let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect("read");
        assert!(bytes("p.parquet") == bytes(&format!("{written}/rows.parquet")), "{command}");
    }
}

#[test]
fn predict_as_csv_writes_residuals_of_stated_error() {
    let folder = tempfile::tempdir().expect("a folder");
    write_log(folder.path());
    run(folder.path(), "identify log.csv --model lugre --out a");
    let (code, said) = run(folder.path(), "predict a/params.toml log.csv --json --out p.csv");
    assert_eq!(code, Some(0), "{said}");
    let text = std::fs::read_to_string(folder.path().join("p.csv")).expect("read");
    let mut lines = text.lines();
    assert_eq!(
        lines.next(),
        Some(
            "run,time_s,velocity_rad_s,torque_nm,pressure_diff_pa,predicted_torque_nm,residual_torque_nm,\
             bristle_torque_nm,flags"
        )
    );
    let (mut squares, mut rows) = (0.0, 0);
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let [measured, predicted, residual] =
            [3, 5, 6].map(|at: usize| cells[at].parse::<f64>().expect("a number"));
        assert_eq!(measured - predicted, residual);
        squares += residual * residual;
        rows += 1;
    }
    assert_eq!(rows, 2 * ROWS);
    let stated = json(&said)["metrics"]["rmse"].as_f64().expect("a number");
    let found = (squares / rows as f64).sqrt();
    assert!((found / stated - 1.0).abs() < 1e-12, "{found} {stated}");
    assert!(stated < 0.1, "{stated}");
}

#[test]
fn predict_with_wrong_arguments_is_rejected_and_keeps_the_log() {
    let folder = tempfile::tempdir().expect("a folder");
    write_log(folder.path());
    run(folder.path(), "identify log.csv --model lugre+pressure-coulomb --out a");
    let before = std::fs::read(folder.path().join("log.csv")).expect("read");
    let mut messages = String::new();
    for (arguments, word) in [
        ("log.csv --out log.csv", "--out: log.csv"),
        ("log.csv --out a/params.toml", "--out: a/params.toml"),
        ("log.csv --out p.xlsx", ".parquet or .csv"),
        ("log.csv --tail 0.2", "'--tail'"),
        ("none.csv", "none.csv"),
    ] {
        let (code, said) = run(folder.path(), &format!("predict a/params.toml {arguments}"));
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains(word), "{said}");
        messages += &said;
    }
    snapshot::check("predict", "bad arguments", &messages);
    assert!(before == std::fs::read(folder.path().join("log.csv")).expect("read"));
}
