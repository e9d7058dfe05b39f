//! `identify --model lugre-lstm` from outside: a network is handed out where it gains on runs it has not seen.
#![cfg(feature = "cli")]

use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

/// Six runs to and fro; the level follows the grip by more than a line can say, or not at all.
fn log(level: impl Fn(f64) -> f64) -> String {
    let mut text = String::from("run,time_s,velocity_rad_s,torque_nm,grip\n");
    for run in 0..6 {
        let grip = f64::from(run) / 5.0;
        for row in 0..400 {
            let time = 0.01 * f64::from(row);
            let velocity = (3.0 * time).sin();
            // A noise of its own kind, so that no model of the log is perfect.
            let noise = 0.02 * (f64::from(row * (run + 3)) * 12.9898).sin();
            let torque = level(grip) * (velocity / 0.02).tanh() + 0.1 * velocity + noise;
            let _ = writeln!(text, "{run},{time:.2},{velocity:.6},{torque:.6},{grip}");
        }
    }
    text
}

/// `fit.json` of a log, and whether a network was written beside it.
fn identified(folder: &Path, log: &str) -> (Value, bool) {
    fs::write(folder.join("log.csv"), log).expect("written");
    let _ = fs::remove_dir_all(folder.join("out"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .args("identify log.csv --model lugre-lstm --inputs grip --epochs 30".split_whitespace());
    let output = command.current_dir(folder).output().expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(folder.join("out/params.toml").exists());
    let fit = fs::read_to_string(folder.join("out/fit.json")).expect("written");
    (serde_json::from_str(&fit).expect("JSON"), folder.join("out/network.json").exists())
}

#[test]
fn a_network_is_handed_out_where_it_gains_on_runs_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = |fit: &Value, place: &str| {
        let rmse = fit.pointer(place).and_then(Value::as_f64);
        rmse.unwrap_or_else(|| panic!("{place} in {fit}"))
    };
    for (level, must_gain) in [(1.0, true), (0.0, false)] {
        let log = log(|grip| 1.0 + level * grip * grip);
        let (fit, is_written) = identified(folder.path(), &log);
        let network = error(&fit, "/models/0/test/rmse");
        let constants = error(&fit, "/models/0/base/test/rmse");
        assert_eq!(is_written, network < constants, "{network} Nm, {constants} Nm");
        assert_eq!(fit["models"][0]["network"]["file"].is_string(), is_written);
        assert!(is_written || !must_gain, "{network} Nm, {constants} Nm");
    }
}
