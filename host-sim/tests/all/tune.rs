//! `tune` and `move` as a user runs them, on a simulated joint in virtual time.
//!
//! A session takes some seconds, so there are two: one that gains, one that does not. The library's tests
//! (`host-sim/tune/tests`) have the refusals of a joint, interrupts, and the way back.
#![cfg(feature = "cli")]

use crate::snapshot;
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

const FILES: [&str; 6] =
    ["tune.html", "tune.json", "runs.parquet", "before.toml", "params.toml", "diagnosis.json"];

fn run(folder: &TempDir, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(arguments.split_whitespace()).current_dir(folder.path());
    command.output().expect("host-sim starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// Runs a command that succeeds, and returns its standard output.
fn succeed(folder: &TempDir, arguments: &str) -> String {
    let output = run(folder, arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments}: {}", text(&output.stderr));
    text(&output.stdout)
}

/// Runs a command that is refused: exit code 2, nothing on standard output, one line on standard error.
fn refused(folder: &TempDir, arguments: &str) -> String {
    let output = run(folder, arguments);
    let line = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{arguments}: {line}");
    assert_eq!(text(&output.stdout), "", "{arguments}");
    assert!(line.starts_with("error: ") && line.trim_end().lines().count() == 1, "{line}");
    line
}

/// Asserts that a document has all keys that its schema requires, at every level that the schema describes in place.
fn assert_required(schema: &Value, root: &Value, document: &Value, at: &str) {
    if let Some(name) = schema["$ref"].as_str() {
        let pointer = name.trim_start_matches('#');
        return assert_required(root.pointer(pointer).expect(name), root, document, at);
    }
    for key in schema["required"].as_array().into_iter().flatten() {
        let key = key.as_str().expect("a name");
        assert!(document.get(key).is_some(), "{at}: no {key}");
    }
    for (key, below) in schema["properties"].as_object().into_iter().flatten() {
        if let Some(value) = document.get(key) {
            assert_required(below, root, value, &format!("{at}.{key}"));
        }
    }
    for item in document.as_array().into_iter().flatten() {
        assert_required(&schema["items"], root, item, &format!("{at}[]"));
    }
}

fn assert_of_schema(document: &Value) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/tune.schema.json");
    let schema: Value =
        serde_json::from_str(&fs::read_to_string(path).expect("a schema")).expect("JSON");
    assert_required(&schema, &schema, document, "tune.json");
}

#[test]
fn tune_of_joint_with_ripple_saves_a_gain_and_writes_all_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let shown = succeed(&folder, "tune --bus loop --motor --hide position-ripple --seed 7");
    snapshot::check("tune", "a gain that is saved", &shown);
    let out = folder.path().join("out/tune");
    for file in FILES {
        assert!(out.join(file).is_file(), "{file}");
        assert!(shown.contains(file), "{file}: {shown}");
    }
    let document: Value =
        serde_json::from_str(&fs::read_to_string(out.join("tune.json")).expect("a file"))
            .expect("JSON");
    assert_of_schema(&document);
    assert_eq!(document["saved"], true);
    let gains = document["gains"].as_array().expect("gains");
    assert!(
        gains.iter().any(|gain| gain["ci95"][0].as_f64().is_some_and(|low| low > 0.05)),
        "{gains:?}"
    );
    let diagnosed = succeed(&folder, "diagnose out/tune/runs.parquet --json");
    let diagnosis: Value = serde_json::from_str(&diagnosed).expect("JSON alone");
    assert!(diagnosis["cause"].is_string() || diagnosis["causes"].is_array(), "{diagnosed:.300}");
}

#[test]
fn tune_that_gains_nothing_exits_1_and_prints_json_alone() {
    let folder = tempfile::tempdir().expect("a folder");
    // A creep of 0.1 mrad is below the error of the encoder: no gain can be proven on it.
    fs::write(folder.path().join("creep.csv"), "time_s,position_rad\n0,0\n4,0.0001\n8,0\n")
        .expect("written");
    let arguments = "tune --bus loop --motor --hide none --seed 5 --motion creep.csv --minutes 2 --json --out here";
    let output = run(&folder, arguments);
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert_eq!(stderr, "", "--json is for scripts");
    let document: Value = serde_json::from_slice(&output.stdout).expect("JSON alone");
    assert_of_schema(&document);
    assert_eq!(document["saved"], false);
    let why_not = document["why_not"].as_str().expect("a reason");
    assert!(!why_not.is_empty() && !why_not.contains("position error reached"), "{why_not}");
    assert!(document["rounds"].as_array().is_some_and(|all| all.len() > 3), "{document:#}");
    for file in ["tune.html", "tune.json", "runs.parquet", "before.toml"] {
        assert!(folder.path().join("here").join(file).is_file(), "{file}");
    }
}

#[test]
fn tune_that_must_not_move_the_joint_exits_2_with_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |name: &str, rows: &str| {
        fs::write(folder.path().join(name), rows).expect("written");
    };
    write("text.csv", "time_s,position_rad\n0,0\n1,x\n");
    write("wide.csv", "time_s,position_rad\n0,0\n9,0.9\n");
    write("fast.csv", "time_s,position_rad\n0,0\n0.1,0.3\n");
    let on_loop = "--bus loop --motor --seed 3";
    let mut messages = String::new();
    for (arguments, expected) in [
        ("tune --bus loop", "--motor"),
        ("tune --bus vcan0 --motor", "--bus loop"),
        ("tune --bus loop --hide position-ripple", "--motor"),
        ("tune --bus loop --motor --node-id 2", "node 1"),
        ("tune --bus loop --motor --hide nonsense", "nonsense"),
        ("tune --bus loop --motor --minutes 0", "1 to 60"),
        ("tune --bus loop --motor --range 0", "--range"),
        ("tune --bus loop --motor --range 1.2rad", "0.980 rad"),
        ("tune --bus loop --motor --speed 90rad/s", "--speed 90 rad/s"),
        ("tune --bus loop --motor --motion missing.csv", "missing.csv"),
        ("tune --bus loop --motor --motion text.csv", "row 3, column position_rad: "),
        ("tune --bus loop --motor --motion wide.csv", "0.4 rad (--range)"),
        ("tune --bus loop --motor --motion fast.csv", "1.5 rad/s (--speed)"),
        ("tune --bus loop --motor --undo", "undo"),
        ("tune --bus loop --motor --undo --yes", "--yes"),
        ("move --bus loop --motor", "--to"),
        ("move --bus loop --motor --to 0 --standard", "--standard"),
        ("move --bus loop --motor --to 99", "--to 99: "),
        ("move --bus loop --motor --sine 0.2", "'0.2'"),
        ("move --bus loop --motor --sine 0.2,-1", "'0.2,-1'"),
        ("move --bus loop --motor --sine 0.3,2", "1.5 rad/s (--speed)"),
        ("move --bus loop --motor --sine 0.5,0.3", "0.4 rad (--range)"),
        ("move --bus loop --motor --file text.csv", "row 3, column position_rad"),
        ("move --bus loop --standard", "--motor"),
        ("move --to 0.1 --dry-run", "--dry-run: "),
    ] {
        let line = refused(&folder, &arguments.replace("--bus loop --motor", on_loop));
        assert!(line.contains(expected), "{arguments}: {line}");
        messages += &line;
    }
    snapshot::check("tune", "refused commands of tune and move", &messages);
    assert!(!folder.path().join("out").exists(), "nothing is written");
}

/// Reads a column of a CSV file.
fn column(csv: &str, name: &str) -> Vec<f64> {
    let mut lines = csv.lines();
    let names = lines.next().expect("a header");
    let at = names.split(',').position(|known| known == name).expect(name);
    let cell = |line: &str| line.split(',').nth(at).expect("a cell").parse().expect("a number");
    lines.map(cell).collect()
}

fn span(values: &[f64]) -> f64 {
    let [low, high] = [f64::min, f64::max].map(|pick| values.iter().copied().reduce(pick));
    high.unwrap_or(f64::NAN) - low.unwrap_or(f64::NAN)
}

#[test]
fn move_along_a_sine_records_the_demand_and_how_well_it_was_followed() {
    let folder = tempfile::tempdir().expect("a folder");
    let joint = "--bus loop --motor --seed 3";
    let document = succeed(&folder, &format!("move --sine 0.2,0.5,2 {joint} --json"));
    let document: Value = serde_json::from_str(&document).expect("JSON alone");
    let tracking = document["tracking-rms"].as_f64().expect("an error");
    assert!(tracking > 0.0 && tracking < 0.1, "{document}");
    let csv = fs::read_to_string(folder.path().join("out/move.csv")).expect("a file");
    let (demand, position) = (column(&csv, "demand_rad"), column(&csv, "position_rad"));
    assert!((span(&demand) - 0.4).abs() < 0.005, "{}", span(&demand));
    assert!((span(&position) - 0.4).abs() < 0.1, "{}", span(&position));
    let seconds = span(&column(&csv, "time_s"));
    assert!(
        (4.5..7.0).contains(&seconds),
        "{seconds} s for two periods of 2 s, the way there and back"
    );
    let square: f64 = demand.iter().zip(&position).map(|(a, b)| (a - b).powi(2)).sum();
    let rms = (square / demand.len() as f64).sqrt();
    assert!((rms / tracking - 1.0).abs() < 0.01, "{rms}, {tracking}");
}

#[test]
fn move_to_a_position_ends_there() {
    let folder = tempfile::tempdir().expect("a folder");
    // The position is in the window of a drawn joint: within 1 rad of its start, which a first move finds.
    let joint = "--bus loop --motor --seed 3";
    let line = refused(&folder, &format!("move --to 99 {joint}"));
    // The message has the ends of the window.
    let least: f64 = line.split(' ').find_map(|word| word.parse().ok()).expect(&line);
    let to = least + 1.3;
    let document = succeed(&folder, &format!("move --to {to} {joint} --json"));
    let document: Value = serde_json::from_str(&document).expect("JSON alone");
    let at = document["position_rad"].as_f64().expect("a position");
    assert!((at - to).abs() < 0.05, "{at}, {to}");
    let shown = succeed(&folder, &format!("move --to {to} {joint}"));
    assert!(shown.starts_with("node 1 on loop: "), "{shown}");
    snapshot::check("tune", "a move to a position", &shown);
    assert!(!folder.path().join("out").exists());
}

#[test]
fn move_writes_the_standard_motion_which_a_file_brings_back() {
    let folder = tempfile::tempdir().expect("a folder");
    succeed(&folder, "move --standard --range 0.2rad --speed 30deg/s --dry-run");
    let motion = fs::read_to_string(folder.path().join("out/motion.csv")).expect("a file");
    let positions = column(&motion, "position_rad");
    assert!((span(&positions) - 0.38).abs() < 0.002, "{}", span(&positions));
    assert_eq!((positions.first(), positions.last()), (Some(&0.0), Some(&0.0)));
    assert_eq!(fs::read_dir(folder.path().join("out")).expect("a folder").count(), 1);
    let joint = "--range 0.2rad --speed 30deg/s --bus loop --motor --seed 3";
    let demand = |arguments: &str| {
        succeed(&folder, &format!("move {arguments} {joint} --out {}", &arguments[2..6]));
        let csv = fs::read_to_string(folder.path().join(&arguments[2..6]).join("move.csv"));
        column(&csv.expect("a file"), "demand_rad")
    };
    let standard = demand("--standard");
    let file = demand("--file out/motion.csv");
    assert!((span(&standard) - span(&file)).abs() < 1e-3);
    // A file is performed with a rest before and after it.
    assert!(file.len() >= standard.len() && file.len() < standard.len() + 700);
}
