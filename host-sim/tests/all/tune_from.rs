//! A friction feed-forward for drives of other makers, from logs as their tools write them.
//!
//! The plant is that of `simulated-machines`: its own equations and its own integrator. The logs are written here, with units
//! converted by hand, quantisation and noise.
#![cfg(feature = "cli")]

use crate::seal_equation::{self, Surroundings};
use crate::snapshot;
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use serde_json::Value;
use simulated_machines::friction::Seal;
use std::f64::consts::TAU;
use std::fmt::Write;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use tempfile::TempDir;

const PERIOD_S: f64 = 0.01;
const STEP_S: f64 = 4e-5;
const INERTIA_KG_M2: f64 = 0.04;
const SEAL: Seal = Seal {
    k0: 3000.0,
    k1: 10.0,
    k2: 0.08,
    coulomb_nm: 1.4,
    static_nm: 1.9,
    stribeck_rad_s: 0.15,
    per_pressure: 0.0,
    per_force: 0.0,
    eta3: 0.0,
};

/// A row of the plant, SI units.
#[derive(Clone, Copy)]
struct Row {
    time: f64,
    position: f64,
    velocity: f64,
    acceleration: f64,
    torque: f64,
}

/// Length of a piece of a motion, s.
const PIECE_S: f64 = 8.0;

/// A motion of several pieces: triangles and sines of position, each with its own speed, and a rest at its end.
fn velocity(pieces: &[(f64, f64, bool)], t: f64) -> f64 {
    let Some((peak, period, is_triangle)) = pieces.get((t / PIECE_S) as usize) else { return 0.0 };
    let local = t % PIECE_S;
    let wave = (TAU * local / period).sin();
    let shape = if *is_triangle { (8.0 * wave).tanh() } else { wave };
    let end = ((PIECE_S - 1.0 - local) / 0.5).clamp(0.0, 1.0);
    peak * shape * (local / 0.5).min(1.0) * end
}

/// The standard motion: triangles and sines at three speeds, both directions, with rests.
const STANDARD: [(f64, f64, bool); 6] = [
    (3.0, 4.0, true),
    (0.9, 5.0, true),
    (0.2, 6.0, true),
    (3.0, 4.0, false),
    (0.9, 3.0, false),
    (0.2, 5.0, false),
];

/// Another motion, at other speeds.
const FRESH: [(f64, f64, bool); 3] = [(2.2, 3.3, false), (0.5, 2.6, true), (1.4, 4.7, true)];

fn plant(seal: &Seal, inertia: f64, pieces: &[(f64, f64, bool)]) -> Vec<Row> {
    let at = |t: f64| Surroundings {
        velocity: velocity(pieces, t),
        force: 0.0,
        force_rate: 0.0,
        pressure: 0.0,
    };
    let (mut z, mut position) = (0.0, 0.0);
    let steps = (PERIOD_S / STEP_S).round() as usize;
    let rows = (PIECE_S / PERIOD_S) as usize * pieces.len();
    (0..rows)
        .map(|row| {
            let time = row as f64 * PERIOD_S;
            for step in 0..steps * usize::from(row > 0) {
                let now = time - PERIOD_S + step as f64 * STEP_S;
                z = seal_equation::advance(seal, z, now, STEP_S, at);
                position += STEP_S * at(now + 0.5 * STEP_S).velocity;
            }
            let acceleration = (at(time + 1e-4).velocity - at(time - 1e-4).velocity) / 2e-4;
            let now = at(time);
            let torque = seal_equation::torque(seal, z, &now) + inertia * acceleration;
            Row { time, position, velocity: now.velocity, acceleration, torque }
        })
        .collect()
}

/// Adds noise of sensors: torque, velocity.
fn measured(rows: &[Row], seed: u64) -> Vec<Row> {
    let mut random = Pcg64::seed_from_u64(seed);
    let torque = Normal::new(0.0, 0.03).expect("a size");
    let velocity = Normal::new(0.0, 0.004).expect("a size");
    let noisy = |row: &Row| Row {
        torque: row.torque + torque.sample(&mut random),
        velocity: row.velocity + velocity.sample(&mut random),
        ..*row
    };
    rows.iter().map(noisy).collect()
}

/// Writes rows as the example `csv_output.py` of moteus does: floats of 32 bit, position of 14 bit.
fn moteus_csv(rows: &[Row]) -> String {
    let mut text = "time,MODE,POSITION,VELOCITY,TORQUE,VOLTAGE,TEMPERATURE,FAULT\n".to_owned();
    for row in rows {
        let position = (row.position / std::f64::consts::TAU * 16384.0).round() / 16384.0;
        let velocity = (row.velocity / std::f64::consts::TAU) as f32;
        let (time, torque) = (row.time, row.torque as f32);
        let _ = writeln!(text, "{time:.6},10,{position},{velocity},{torque},24.5,31.0,0");
    }
    text
}

/// Torque constant of the simulated motor, Nm/A.
const TORQUE_CONSTANT: f64 = 0.0625;

/// Writes rows as a capture of an ODrive's properties, with the current instead of the torque.
fn odrive_csv(rows: &[Row]) -> String {
    let axis = "axis0.encoder.pos_estimate,axis0.encoder.vel_estimate";
    let mut text = format!("time,{axis},axis0.motor.current_control.Iq_measured\n");
    for row in rows {
        let counts = (row.position * 8192.0 / std::f64::consts::TAU).round();
        let (position, velocity) =
            (counts / 8192.0, row.velocity * 60.0 / std::f64::consts::TAU / 60.0);
        let current = (row.torque / TORQUE_CONSTANT * 100.0).round() / 100.0;
        let _ = writeln!(text, "{:.5},{position},{velocity},{current}", row.time);
    }
    text
}

/// Writes rows as candump logs the cyclic messages of an ODrive, node 5, firmware 0.6.
fn odrive_candump(rows: &[Row]) -> String {
    let mut text = String::new();
    for row in rows {
        let stamp = 1_764_000_000.0 + row.time;
        let hex = |a: f64, b: f64| -> String {
            let bytes = [(a as f32).to_le_bytes(), (b as f32).to_le_bytes()].concat();
            bytes.iter().map(|byte| format!("{byte:02X}")).collect()
        };
        // 5 * 32 + 9 = 0x0A9, 5 * 32 + 28 = 0x0BC.
        let estimates =
            hex(row.position / std::f64::consts::TAU, row.velocity / std::f64::consts::TAU);
        let _ = writeln!(text, "({stamp:.6}) can0 0A9#{estimates}");
        let _ = writeln!(text, "({:.6}) can0 0BC#{}", stamp + 0.00015, hex(0.0, row.torque));
    }
    text
}

struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().expect("a folder"))
    }

    fn with(name: &str, text: &str) -> Self {
        let folder = Self::new();
        folder.write(name, text);
        folder
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).expect("written");
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).expect(name)
    }

    /// Runs the command. Returns exit code, standard output, and errors without the lines on the log.
    fn tune(&self, arguments: &str) -> (Option<i32>, String, String) {
        let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
        command.arg("tune").args(arguments.split_whitespace()).current_dir(self.0.path());
        let output = command.output().expect("host-sim starts");
        let text = |bytes| String::from_utf8(bytes).expect("UTF-8");
        let stderr = text(output.stderr);
        let errors = stderr.lines().filter(|line| !line.starts_with("log: "));
        let errors = errors.map(|line| format!("{line}\n")).collect();
        (output.status.code(), text(output.stdout), errors)
    }

    /// Runs the command, which must have a gain. Returns its JSON document.
    fn tuned(&self, arguments: &str) -> Value {
        let (code, stdout, errors) = self.tune(&format!("{arguments} --json"));
        assert_eq!((code, errors.as_str()), (Some(0), ""), "{arguments}: {stdout}");
        serde_json::from_str(&stdout).expect("JSON alone")
    }

    /// Runs the command, which must refuse its input. Returns the line.
    fn refused(&self, arguments: &str) -> String {
        let (code, stdout, errors) = self.tune(arguments);
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{arguments}: {errors}");
        assert!(errors.starts_with("error: ") && errors.lines().count() == 1, "{errors}");
        assert!(!self.path("out").exists(), "{arguments} wrote files");
        errors
    }

    /// Returns the names of the files in the folder of results.
    fn results(&self, folder: &str) -> Vec<String> {
        let files = fs::read_dir(self.path(folder)).expect("results");
        let names = files.flatten().map(|file| file.file_name().to_string_lossy().into_owned());
        let mut names: Vec<String> = names.filter(|name| !name.starts_with('.')).collect();
        names.sort();
        names
    }

    /// Returns speed, torque and standard error of the rows of `feed-forward.csv`.
    fn table(&self, folder: &str) -> Vec<[f64; 3]> {
        let text = self.read(&format!("{folder}/feed-forward.csv"));
        let row = |line: &str| -> [f64; 3] {
            let cells = line.split(',').map(|cell| cell.parse().expect("a number"));
            cells.take(3).collect::<Vec<f64>>().try_into().expect("three cells")
        };
        text.lines().skip(1).map(row).collect()
    }
}

/// Returns the torque of a table at a speed: linear between the rows, constant beyond them.
fn lookup(table: &[[f64; 3]], speed: f64) -> f64 {
    let Some(after) = table.iter().position(|row| row[0] >= speed) else {
        return table[table.len() - 1][1];
    };
    if after == 0 {
        return table[0][1];
    }
    let ([x0, y0, _], [x1, y1, _]) = (table[after - 1], table[after]);
    y0 + (y1 - y0) * (speed - x0) / (x1 - x0)
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut squares, mut count) = (0.0, 0.0);
    for value in values {
        squares += value * value;
        count += 1.0;
    }
    f64::sqrt(squares / count)
}

/// Requires that a table over turns/s reduces the torque that is left to the controller on a fresh motion of the plant. At
/// rest the joint holds any torque up to its static level, which no table over speed can contain.
fn assert_reduces_error_on_fresh_motion(table: &[[f64; 3]], inertia: f64) {
    let rows = plant(&SEAL, INERTIA_KG_M2, &FRESH);
    let without = |row: &Row| row.torque - inertia * row.acceleration;
    let with = |row: &Row| without(row) - lookup(table, row.velocity / TAU);
    let moving = || rows.iter().filter(|row| row.velocity.abs() > 0.05);
    for (rows, most) in [(rows.iter().collect::<Vec<_>>(), 0.5), (moving().collect(), 0.2)] {
        let of = |error: &dyn Fn(&Row) -> f64| rms(rows.iter().map(|row| error(row)));
        let [without, with] = [of(&without), of(&with)];
        assert!(with < most * without, "{with} Nm instead of {without} Nm");
    }
}

/// Requires the steady torque of the seal within four standard errors and one percent.
fn assert_is_steady_torque(table: &[[f64; 3]]) {
    for [speed, torque, std_error] in table.iter().filter(|row| row[0].abs() > 0.1) {
        let velocity = speed * TAU;
        let level = 1.4 + 0.5 * (-(velocity / 0.15).powi(2)).exp();
        let expected = level * velocity.signum() + 0.08 * velocity;
        let allowed = 4.0 * std_error + 0.02 * expected.abs();
        assert!((torque - expected).abs() < allowed, "{speed} turns/s: {torque} Nm, {expected} Nm");
        assert!(*std_error > 0.0 && *std_error < 0.1, "{speed} turns/s: {std_error} Nm");
    }
}

#[test]
fn tune_from_moteus_log_reduces_torque_error_of_plant_on_fresh_motion() {
    let rows = measured(&plant(&SEAL, INERTIA_KG_M2, &STANDARD), 1);
    let folder = Folder::with("motion.csv", &moteus_csv(&rows));
    let document = folder.tuned("--from moteus motion.csv --out r");
    assert_eq!(document["drive"], "moteus");
    assert_eq!((&document["has_gain"], &document["gravity"]), (&Value::Bool(true), &Value::Null));
    let files = [
        "feed-forward.csv",
        "feed-forward.json",
        "feed_forward.py",
        "fit.html",
        "moteus.cfg",
        "params.toml",
    ];
    assert_eq!(folder.results("r"), files);
    let table = folder.table("r");
    assert!(table.windows(2).all(|pair| pair[0][0] < pair[1][0]), "speeds increase");
    assert_is_steady_torque(&table);
    let config = folder.read("r/moteus.cfg");
    let inertia = config.strip_prefix("conf set servo.inertia_feedforward ").expect("a parameter");
    let inertia: f64 = inertia.trim_end().parse().expect("a number");
    assert!((inertia / INERTIA_KG_M2 - 1.0).abs() < 0.05, "{inertia}");
    assert_reduces_error_on_fresh_motion(&table, inertia);
    // The held-out errors are ordered, and that of the table is what a fresh motion shows.
    let held_out = &document["held_out"];
    let error = |name: &str| held_out[name].as_f64().expect("a number");
    assert!(error("rmse_with_model") <= error("rmse_with_table"));
    assert!(error("rmse_with_table") < 0.5 * error("rmse_without"));
    assert!(held_out["gain_of_table"]["ci95"][0].as_f64() > Some(0.0));
}

#[test]
fn tune_from_odrive_log_of_current_separates_gravity_from_friction() {
    let lifted = |row: &Row| Row { torque: row.torque + 0.6 * row.position.cos(), ..*row };
    let rows: Vec<Row> = plant(&SEAL, INERTIA_KG_M2, &STANDARD).iter().map(lifted).collect();
    let rows = measured(&rows, 2);
    let folder = Folder::with("capture.csv", &odrive_csv(&rows));
    let error = folder.refused("--from odrive capture.csv");
    assert!(error.contains("--torque-constant"), "{error}");
    snapshot::check("tune-from", "a current without its constant", &error);
    let document = folder.tuned("--from odrive capture.csv --torque-constant 0.0625Nm/A --out r");
    assert_eq!(document["units"]["speed"], "turns/s");
    let gravity = document["gravity"]["cosine"].as_f64().expect("gravity");
    assert!((gravity - 0.6).abs() < 0.03, "{gravity} Nm");
    let remarks = document["remarks"].to_string();
    // The zero of the position must be that of the log, and the torque constant the same.
    assert!(document["remarks"].as_array().is_some_and(|all| all.len() >= 2), "{remarks}");
    snapshot::check("tune-from", "remarks on a current and gravity", &remarks);
    let table = folder.table("r");
    assert_is_steady_torque(&table);
    assert_reduces_error_on_fresh_motion(&table, INERTIA_KG_M2);
    assert!(!folder.results("r").contains(&"moteus.cfg".to_owned()));
}

#[test]
fn tune_from_candump_of_odrive_recognises_drive_and_script_returns_table() {
    let rows = measured(&plant(&SEAL, INERTIA_KG_M2, &STANDARD), 3);
    let folder = Folder::with("bus.log", &odrive_candump(&rows));
    let document = folder.tuned("--from candump bus.log --out r");
    assert_eq!(document["drive"], "odrive");
    let table = folder.table("r");
    assert_is_steady_torque(&table);
    // The script that the user's program calls.
    let speeds = [-9.0, -0.31, -0.02, 0.0, 0.004, 0.2, 9.0];
    let listed = speeds.map(|speed| speed.to_string()).join(",");
    let program = format!(
        "import struct, feed_forward as f\n\
         for v in [{listed}]: print(f.feed_forward_nm(v))\n\
         print(f.feed_forward_nm(0.2, acceleration=3.0) - f.feed_forward_nm(0.2))\n\
         print(struct.unpack('<fhh', f.set_input_pos_data(1.5, 0.2))[2])\n\
         f.SCALE = 0\n\
         print(f.feed_forward_nm(0.2))\n"
    );
    let output = Command::new("python3")
        .args(["-c", &program])
        .current_dir(folder.path("r"))
        .output()
        .expect("python3 starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}");
    let printed = String::from_utf8(output.stdout).expect("UTF-8");
    let values: Vec<f64> = printed.lines().map(|line| line.parse().expect("a number")).collect();
    assert_eq!(values.len(), speeds.len() + 3);
    for (speed, value) in speeds.iter().zip(&values) {
        assert!((value - lookup(&table, *speed)).abs() < 1e-6, "{speed}: {value}");
    }
    // Nm for 3 turns/s^2.
    let expected = INERTIA_KG_M2 * TAU * 3.0;
    assert!((values[7] / expected - 1.0).abs() < 0.05, "{} {expected}", values[7]);
    assert_eq!(values[8], (1000.0 * lookup(&table, 0.2)).round());
    assert_eq!(values[9], 0.0);
}

#[test]
fn tune_from_log_without_friction_writes_no_parameters_and_exits_1() {
    let free = |row: &Row| Row { torque: INERTIA_KG_M2 * row.acceleration, ..*row };
    let rows: Vec<Row> = plant(&SEAL, 0.0, &STANDARD).iter().map(free).collect();
    let rows = measured(&rows, 4);
    let folder = Folder::with("motion.csv", &moteus_csv(&rows));
    let (code, stdout, errors) = folder.tune("--from moteus motion.csv --out r");
    assert_eq!((code, errors.as_str()), (Some(1), ""), "{stdout}");
    snapshot::check("tune-from", "a log without friction", &stdout);
    assert_eq!(folder.results("r"), ["feed-forward.json", "fit.html"]);
    let document: Value = serde_json::from_str(&folder.read("r/feed-forward.json")).expect("JSON");
    assert_eq!((&document["has_gain"], &document["table"]), (&Value::Bool(false), &Value::Null));
}

#[test]
fn tune_from_log_with_reversed_sign_names_columns_that_turn_it() {
    let rows: Vec<Row> = measured(&plant(&SEAL, INERTIA_KG_M2, &STANDARD), 5);
    let turned: Vec<Row> = rows.iter().map(|row| Row { torque: -row.torque, ..*row }).collect();
    let folder = Folder::with("motion.csv", &moteus_csv(&turned));
    let error = folder.refused("--from moteus motion.csv");
    assert!(error.contains("motion.csv: torque_nm: "), "{error}");
    snapshot::check("tune-from", "a reversed sign", &error);
    let pair = "--columns torque_nm=TORQUE:-Nm";
    assert!(error.trim_end().ends_with(pair), "{error}");
    let document = folder.tuned(&format!("--from moteus motion.csv {pair} --out r"));
    assert_eq!(document["is_sign_reversed"], true);
    assert_is_steady_torque(&folder.table("r"));
    assert!(folder.read("r/feed_forward.py").contains("--columns"));
}

#[test]
fn tune_from_log_that_is_no_base_names_file_and_column() {
    let rows = measured(&plant(&SEAL, INERTIA_KG_M2, &STANDARD[..2]), 6);
    let whole = moteus_csv(&rows);
    let folder = Folder::new();
    folder.write("bare.csv", &whole.replace("TORQUE", "D_CURRENT"));
    let bare = folder.refused("--from moteus bare.csv");
    assert!(bare.contains("bare.csv: --from moteus: ") && bare.contains("torque_nm"), "{bare}");
    // Every tenth torque is a word.
    let damaged = |(at, line): (usize, &str)| match (at, at % 10) {
        (0, _) | (_, 1..) => format!("{line}\n"),
        _ => {
            let mut cells: Vec<&str> = line.split(',').collect();
            cells[4] = "off";
            cells.join(",") + "\n"
        }
    };
    folder.write("damaged.csv", &whole.lines().enumerate().map(damaged).collect::<String>());
    let damaged = folder.refused("--from moteus damaged.csv");
    assert!(damaged.contains("damaged.csv") && damaged.contains("row 11"), "{damaged}");
    assert!(damaged.contains("TORQUE") && damaged.contains("\"off\""), "{damaged}");
    let ahead: Vec<Row> =
        rows.iter().map(|row| Row { velocity: row.velocity.abs() + 0.1, ..*row }).collect();
    let ahead: String = moteus_csv(&ahead)
        .lines()
        .map(|line| {
            let mut cells: Vec<&str> = line.split(',').collect();
            cells.remove(2);
            cells.join(",") + "\n"
        })
        .collect();
    let ahead = ahead.replace(",-", ",");
    folder.write("ahead.csv", &ahead);
    let one_way = folder.refused("--from moteus ahead.csv");
    assert!(one_way.contains("ahead.csv"), "{one_way}");
    let no_log = folder.refused("--from moteus");
    assert!(no_log.contains("LOG"), "{no_log}");
    let no_drive = folder.refused("bare.csv");
    assert!(no_drive.contains("--from"), "{no_drive}");
    let messages = [bare, damaged, one_way, no_log, no_drive].concat();
    snapshot::check("tune-from", "logs that are no base", &messages);
}
