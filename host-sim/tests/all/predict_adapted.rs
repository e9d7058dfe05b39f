//! `predict --adapt`: gains that follow a simulated log.
#![cfg(feature = "cli")]

use crate::snapshot;
use compensator_core::{LawKind, ModelState, ParameterId as Id, Parameters, Sample};
use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

const PERIOD_S: f64 = 0.01;
const ROWS: usize = 20_000;

fn joint() -> Parameters<f64> {
    Parameters::new(LawKind::Lugre)
        .with(Id::CoulombTorque, 1.2)
        .with(Id::StaticTorque, 1.5)
        .with(Id::StribeckVelocity, 0.05)
        .with(Id::BristleStiffness, 500.0)
        .with(Id::BristleDamping, 0.5)
        .with(Id::ViscousFriction, 0.3)
}

/// Writes a log of two runs that share a clock, whose levels are multiplied by `level` of the share of the log. `change` may
/// change a line or remove it.
fn write_log(
    file: &Path,
    level: impl Fn(f64) -> f64,
    change: impl Fn(usize, [f64; 3]) -> Option<[f64; 3]>,
) {
    let mut text = "run,time_s,velocity_rad_s,torque_nm\n".to_owned();
    let mut state = ModelState::default();
    for row in 0..ROWS {
        let time = row as f64 * PERIOD_S;
        let velocity = (0.9 * time).sin() * (0.8 + 0.6 * (0.23 * time).sin());
        let gain = level(row as f64 / ROWS as f64);
        let scaled = joint();
        let scaled = [Id::CoulombTorque, Id::StaticTorque].iter().fold(scaled, |scaled, id| {
            let value = gain * scaled.get(*id);
            scaled.with(*id, value)
        });
        let sample = Sample { velocity_rad_s: velocity, ..Sample::default() };
        let torque = scaled.build_unchecked::<f64>(PERIOD_S).step(&mut state, &sample);
        let noise = 0.04 * (((row * 7919) % 1000) as f64 / 1000.0 - 0.5);
        if let Some([time, velocity, torque]) = change(row, [time, velocity, torque + noise]) {
            let run = if row < ROWS / 2 { "first" } else { "second" };
            let _ = writeln!(text, "{run},{time:.3},{velocity:.6},{torque:.6}");
        }
    }
    std::fs::write(file, text).expect("written");
}

fn unchanged(_: usize, row: [f64; 3]) -> Option<[f64; 3]> {
    Some(row)
}

/// Runs the program in a folder. Returns its exit code, and its output or standard error.
fn run(folder: &Path, arguments: &str) -> (Option<i32>, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let output = command.args(arguments.split_whitespace()).current_dir(folder).output();
    let output = output.expect("host-sim starts");
    let said = if output.status.success() { output.stdout } else { output.stderr };
    (output.status.code(), String::from_utf8(said).expect("UTF-8"))
}

/// Returns a folder with the model of a joint whose friction is steady, `fit/params.toml`, and its log, `steady.csv`.
fn identified() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    write_log(&folder.path().join("steady.csv"), |_| 1.0, unchanged);
    let (code, said) = run(folder.path(), "identify steady.csv --model lugre --out fit");
    assert_eq!(code, Some(0), "{said}");
    folder
}

fn predict(folder: &Path, arguments: &str) -> Value {
    let (code, said) =
        run(folder, &format!("predict fit/params.toml {arguments} --json --out rows.csv"));
    assert_eq!(code, Some(0), "{said}");
    serde_json::from_str(&said).expect("JSON")
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// Returns the columns of a file by their names.
fn columns(file: &Path, names: &[&str]) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(file).expect("read");
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let place = |name: &&str| head.iter().position(|known| known == name).expect("a column");
    let places: Vec<usize> = names.iter().map(place).collect();
    let cells = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        places.iter().map(|place| cells[*place].to_owned()).collect()
    };
    lines.map(cells).collect()
}

#[test]
fn predict_adapted_with_rising_friction_has_a_third_of_the_fixed_error() {
    let folder = identified();
    write_log(&folder.path().join("rising.csv"), |share| 1.0 + 0.5 * share, unchanged);
    let all = predict(folder.path(), "rising.csv --adapt");
    let adaptation = &all["adaptation"];
    let [fixed, adapted] = ["fixed", "adapted"].map(|which| number(&adaptation[which]["rmse"]));
    assert!(3.0 * adapted <= fixed, "{adapted} {fixed}");
    let plain = predict(folder.path(), "rising.csv");
    assert_eq!(adaptation["fixed"], plain["metrics"], "the fixed set is that without the option");
    let last = number(&adaptation["gains"]["level"]["last"]);
    // A drift is followed about two memories late.
    assert!((last - 1.45).abs() < 0.04, "{last}");
    assert_eq!(adaptation["runs"].as_array().map(Vec::len), Some(2));

    let (code, said) =
        run(folder.path(), "predict fit/params.toml rising.csv --adapt --out rows.csv");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains(&format!(": {last:.3}")) && said.contains("  second: "), "{said}");
    snapshot::check("predict", "adapted", &said);
    let rows = columns(
        &folder.path().join("rows.csv"),
        &["gain_level", "gain_viscous", "std_level", "std_viscous", "frozen"],
    );
    assert_eq!(rows.len(), ROWS);
    let level = |row: usize| rows[row][0].parse::<f64>().expect("a number");
    assert_eq!(rows[0][0], "1.0", "nothing is known before the first row");
    assert!((level(ROWS / 2) - 1.2).abs() < 0.04, "gains are kept over runs: {}", level(ROWS / 2));
    assert!(rows.iter().any(|row| row[4] == "learning"));
    assert!(rows.iter().any(|row| row[4] == "reversal"));
}

#[test]
fn predict_adapted_is_causal() {
    let folder = identified();
    write_log(&folder.path().join("rising.csv"), |share| 1.0 + 0.5 * share, unchanged);
    // The same log, with other torques in its last part.
    let changed = ROWS / 2 + 4000;
    write_log(
        &folder.path().join("other.csv"),
        |share| 1.0 + 0.5 * share,
        |row, [time, velocity, torque]| {
            Some([time, velocity, if row < changed { torque } else { 0.7 * torque }])
        },
    );
    let gains = |log: &str| {
        predict(folder.path(), &format!("{log} --adapt --motion logged"));
        let names = ["predicted_torque_nm", "gain_level", "gain_viscous"];
        columns(&folder.path().join("rows.csv"), &names)
    };
    let (one, other) = (gains("rising.csv"), gains("other.csv"));
    assert!(one[..changed] == other[..changed]);
    assert!(one[changed..] != other[changed..]);
}

#[test]
fn predict_adapted_with_steady_friction_keeps_the_error() {
    let folder = identified();
    let adaptation = &predict(folder.path(), "steady.csv --adapt")["adaptation"];
    let [fixed, adapted] = ["fixed", "adapted"].map(|which| number(&adaptation[which]["rmse"]));
    assert!(adapted <= 1.02 * fixed, "{adapted} {fixed}");
}

#[test]
fn predict_adapted_with_bad_cells_gaps_and_uneven_times_learns_the_level() {
    let folder = identified();
    let damage = |row: usize, [time, velocity, torque]: [f64; 3]| {
        // A gap of three seconds, a row that stands alone in another, and lost rows.
        let is_lost = (4000..4300).contains(&row)
            || (9000..9800).contains(&row) && row != 9400
            || row.is_multiple_of(37);
        let torque = if row.is_multiple_of(211) { f64::NAN } else { torque };
        let jitter = 0.002 * ((row * 31 % 7) as f64 / 7.0);
        (!is_lost).then_some([time + jitter, velocity, torque])
    };
    write_log(&folder.path().join("damaged.csv"), |share| 1.0 + 0.5 * share, damage);
    let adaptation = &predict(folder.path(), "damaged.csv --adapt --start rest")["adaptation"];
    let [fixed, adapted] = ["fixed", "adapted"].map(|which| number(&adaptation[which]["rmse"]));
    assert!(2.0 * adapted <= fixed, "{adapted} {fixed}");
    let rows = columns(&folder.path().join("rows.csv"), &["predicted_torque_nm", "gain_level"]);
    assert!(rows.iter().all(|row| row[0].is_empty() == row[1].is_empty()));
}

#[test]
fn predict_adapted_with_a_set_of_a_driver_takes_the_noise_from_the_first_rows() {
    let folder = identified();
    let file = folder.path().join("fit/params.toml");
    let text = std::fs::read_to_string(&file).expect("read");
    let noise = |folder: &Path| {
        number(&predict(folder, "steady.csv --adapt")["adaptation"]["settings"]["noise"])
    };
    let of_fit = noise(folder.path());
    let without: Vec<&str> = text.lines().filter(|line| !line.starts_with("rmse = ")).collect();
    assert!(without.len() < text.lines().count(), "{text}");
    std::fs::write(&file, without.join("\n")).expect("written");
    let of_rows = noise(folder.path());
    assert!((of_rows / of_fit - 1.0).abs() < 0.1, "{of_rows} {of_fit}");
}

#[test]
fn predict_adapted_with_bad_options_is_rejected_in_one_line() {
    let folder = identified();
    let mut messages = String::new();
    for (options, word) in [
        ("--adapt-memory 20s", "--adapt"),
        ("--adapt --adapt-memory 0.1s", "memory_s = 0.1: "),
        ("--adapt --adapt-memory long", "20s"),
        ("--adapt --adapt-range 2", "0.4:2.5"),
        ("--adapt --adapt-range 1.5:2", "least_gain = 1.5: "),
        ("--adapt --adapt-range 0.5:0.8", "largest_gain = 0.8: "),
        ("--adapt --adapt-range NaN:2", "least_gain"),
    ] {
        let (code, said) =
            run(folder.path(), &format!("predict fit/params.toml steady.csv {options}"));
        assert_eq!(code, Some(2), "{options}: {said}");
        assert!(said.contains(word), "{options}: {said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        messages += &said;
    }
    snapshot::check("predict", "bad options of the adaptation", &messages);
}
