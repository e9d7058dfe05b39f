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

/// Runs the program in a folder; gives its exit code, and what it printed on both outputs.
fn host_sim(folder: &Path, arguments: &str) -> (i32, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let output = command.args(arguments.split_whitespace()).current_dir(folder).output();
    let output = output.expect("runs");
    let text = [output.stdout, output.stderr].concat();
    (output.status.code().unwrap_or(-1), String::from_utf8_lossy(&text).into_owned())
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
    assert!(folder.join("out/identify-log/params.toml").exists());
    let fit = fs::read_to_string(folder.join("out/identify-log/fit.json")).expect("written");
    (
        serde_json::from_str(&fit).expect("JSON"),
        folder.join("out/identify-log/network.json").exists(),
    )
}

#[test]
fn a_network_is_handed_out_where_it_gains_on_runs_left_out() {
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
    handed_on(folder.path());
}

/// What was written is taken wherever `--params` is, to a driver and back, and refused where it does not fit.
fn handed_on(folder: &Path) {
    let said = |arguments: &str, code: i32, words: &[&str]| {
        let (found, text) = host_sim(folder, arguments);
        assert_eq!(found, code, "{arguments}: {text}");
        for word in words {
            assert!(text.contains(word), "{arguments}: no {word:?} in {text}");
        }
        text
    };
    // A driver in this process runs it, bit for bit as the core: its frames bring `grip` as the auxiliary covariate.
    said("simulate damper --seed 1 --out trace", 0, &[]);
    let replayed =
        said("replay trace/trace.log --params out/identify-log/params.toml --out r --json", 0, &[]);
    let replayed: Value = serde_json::from_str(&replayed).expect("JSON");
    assert_eq!(replayed["holds"], Value::Bool(true), "{replayed}");
    said("params set out/identify-log/params.toml --bus loop", 0, &[" values changed (crc "]);
    said(
        "params diff out/identify-log/params.toml --bus loop",
        1,
        &["network: driver none, file crc "],
    );
    said("params get --network n.json --bus loop", 2, &["the driver has none"]);
    // Forms for others.
    said(
        "export out/identify-log/params.toml --to onnx --out e",
        0,
        &["network.onnx", "fed with grip"],
    );
    said("export out/identify-log/params.toml --to network --out e", 0, &["1872 bytes"]);
    let record = fs::read(folder.join("e/network.bin")).expect("written");
    let network = compensator_core::network::record::parse(&record).expect("a record");
    assert_eq!(network.map(|network| network.feeds.len()), Some(1));
    said(
        "export out/identify-log/params.toml --to record --out e",
        0,
        &["the network that supplies"],
    );
    // Where a law of constants is wanted.
    said(
        "diagnose log.csv --params out/identify-log/params.toml",
        2,
        &["a network supplies its levels"],
    );
    said("diagnose log.csv --model lugre-lstm", 2, &["identify --model lugre-lstm"]);
    said("compare log.csv --models lugre-lstm", 2, &["identify --model lugre-lstm"]);
    // Another network beside it, or none.
    let beside = folder.join("out/identify-log/network.json");
    let text = fs::read_to_string(&beside).expect("written");
    fs::write(&beside, text.replacen("0.5", "0.25", 1)).expect("written");
    said(
        "export out/identify-log/params.toml --to onnx --out e",
        2,
        &["network.crc32", "was changed"],
    );
    fs::remove_file(&beside).expect("gone");
    said(
        "replay trace/trace.log --params out/identify-log/params.toml",
        2,
        &["network.file", "No such file"],
    );
}
