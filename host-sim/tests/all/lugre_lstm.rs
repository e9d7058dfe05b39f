//! `identify --model lugre-lstm`: the network is written only if it reduces the error on held-out runs.
#![cfg(feature = "network")]

use crate::snapshot;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

/// A log of six runs back and forth. The friction level is a function of the covariate `grip`.
fn log(level: impl Fn(f64) -> f64) -> String {
    let mut text = String::from("run,time_s,velocity_rad_s,torque_nm,grip\n");
    for run in 0..6 {
        let grip = f64::from(run) / 5.0;
        for row in 0..400 {
            let time = 0.01 * f64::from(row);
            let velocity = (3.0 * time).sin();
            // Deterministic noise, so that no model is perfect.
            let noise = 0.02 * (f64::from(row * (run + 3)) * 12.9898).sin();
            let torque = level(grip) * (velocity / 0.02).tanh() + 0.1 * velocity + noise;
            let _ = writeln!(text, "{run},{time:.2},{velocity:.6},{torque:.6},{grip}");
        }
    }
    text
}

/// Runs the program in a folder. Returns its exit code and everything it printed.
fn host_sim(folder: &Path, arguments: &str) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let output = command.args(arguments.split_whitespace()).current_dir(folder).output();
    let output = output.expect("runs");
    let text = [output.stdout, output.stderr].concat();
    (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&text).into_owned())
}

/// Fits a log. Returns `fit.json` and whether a network was written.
fn identified(folder: &Path, log: &str) -> (Value, bool) {
    fs::write(folder.join("log.csv"), log).expect("written");
    let _ = fs::remove_dir_all(folder.join("out"));
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command
        .args("identify log.csv --model lugre-lstm --inputs grip --epochs 30".split_whitespace());
    let output = command.current_dir(folder).output().expect("runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(folder.join("out/identify-log/params.toml").exists());
    let fit = fs::read_to_string(folder.join("out/identify-log/fit.json")).expect("written");
    (
        serde_json::from_str(&fit).expect("JSON"),
        folder.join("out/identify-log/network.json").exists(),
    )
}

#[test]
fn network_is_written_only_if_it_reduces_the_held_out_error() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = |fit: &Value, place: &str| {
        let rmse = fit.pointer(place).and_then(Value::as_f64);
        rmse.unwrap_or_else(|| panic!("{place} in {fit}"))
    };
    for (level, must_gain) in [(0.0, false), (1.0, true)] {
        let log = log(|grip| 1.0 + level * grip * grip);
        let (fit, is_written) = identified(folder.path(), &log);
        let network = error(&fit, "/models/0/test/rmse");
        let constants = error(&fit, "/models/0/base/test/rmse");
        assert_eq!(is_written, network < constants, "{network} Nm, {constants} Nm");
        assert_eq!(fit["models"][0]["network"]["file"].is_string(), is_written);
        assert!(is_written || !must_gain, "{network} Nm, {constants} Nm");
    }
    assert_network_is_usable(folder.path());
}

/// Checks that every command with `--params` accepts the network and that unsuitable uses are rejected.
fn assert_network_is_usable(folder: &Path) {
    let run = |arguments: &str, code: i32, words: &[&str]| {
        let (found, text) = host_sim(folder, arguments);
        assert_eq!(found, code, "{arguments}: {text}");
        for word in words {
            assert!(text.contains(word), "{arguments}: no {word:?} in {text}");
        }
        text
    };
    // A driver in this process runs the network, bit-identical to the core. It receives `grip` as auxiliary covariate.
    run("simulate damper --seed 1 --out trace", 0, &[]);
    let replayed =
        run("replay trace/trace.log --params out/identify-log/params.toml --out r --json", 0, &[]);
    let replayed: Value = serde_json::from_str(&replayed).expect("JSON");
    assert_eq!(replayed["holds"], Value::Bool(true), "{replayed}");
    run("params set out/identify-log/params.toml --bus loop", 0, &[" values changed (crc "]);
    run(
        "params diff out/identify-log/params.toml --bus loop",
        1,
        &["network: ", "none, ", " crc "],
    );
    let mut refused = run("params get --network n.json --bus loop", 2, &["network"]);
    // Export formats.
    #[cfg(feature = "onnx")]
    run(
        "export out/identify-log/params.toml --to onnx --out e",
        0,
        &["network.onnx", "network inputs: grip"],
    );
    run("export out/identify-log/params.toml --to network --out e", 0, &["1872 bytes"]);
    let record = fs::read(folder.join("e/network.bin")).expect("written");
    let network = compensator_core::network::record::parse(&record).expect("a record");
    assert_eq!(network.map(|network| network.feeds.len()), Some(1));
    let settings = "scale=0.8,torque_limit_nm=6,torque_constant_nm_per_a=1,current_limit_a=26";
    let record = "export out/identify-log/params.toml --to record --out e --compensator";
    run(&format!("{record} {settings}"), 0, &["network"]);
    // Commands that require a law with constant parameters.
    refused += &run("diagnose log.csv --params out/identify-log/params.toml", 2, &["network"]);
    refused += &run("diagnose log.csv --model lugre-lstm", 2, &["identify --model lugre-lstm"]);
    snapshot::check("network", "refused uses of a network", &refused);
    run("compare log.csv --models lugre-lstm", 2, &["identify --model lugre-lstm"]);
    // A changed network file, and a missing one.
    let beside = folder.join("out/identify-log/network.json");
    let text = fs::read_to_string(&beside).expect("written");
    fs::write(&beside, text.replacen("0.5", "0.25", 1)).expect("written");
    run(
        "export out/identify-log/params.toml --to network --out e",
        2,
        &["network.crc32", "was changed"],
    );
    fs::remove_file(&beside).expect("gone");
    run(
        "replay trace/trace.log --params out/identify-log/params.toml",
        2,
        &["network.file", "No such file"],
    );
}
