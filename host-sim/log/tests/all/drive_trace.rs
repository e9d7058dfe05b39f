//! CAN logs of other makers' drives. The frames are written here byte by byte, independently of the reader.

use super::folder::{Folder, plain};
use super::message;
use joint_log::{Dataset, Preset, Quantity, ReadOptions, TorqueConstant, read};
use std::f64::consts::TAU;
use std::fmt::Write;

const ROWS: u32 = 400;
const PERIOD_S: f64 = 0.01;
/// Time from the frame of the velocity to that of the torque, s.
const LATER_S: f64 = 0.0002;

/// Velocity, turns/s.
fn velocity(time_s: f64) -> f64 {
    1.5 * (2.0 * time_s).sin()
}

/// Position, turns.
fn position(time_s: f64) -> f64 {
    0.75 * (1.0 - (2.0 * time_s).cos())
}

/// Torque, Nm.
fn torque(time_s: f64) -> f64 {
    0.4 * velocity(time_s).signum() + 0.1 * velocity(time_s)
}

fn line(text: &mut String, time_s: f64, identifier: u32, data: &[u8]) {
    let hex: String = data.iter().map(|byte| format!("{byte:02X}")).collect();
    let _ = writeln!(text, "({:.6}) can0 {identifier:03X}#{hex}", 1_700_000_000.0 + time_s);
}

fn pair(first: f64, second: f64) -> Vec<u8> {
    [first as f32, second as f32].iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// Writes the frames of an ODrive: a heartbeat, the estimates, and torques (command 1Ch) or currents (14h).
fn odrive(text: &mut String, node: u32, command: u32) {
    for row in 0..ROWS {
        let time_s = PERIOD_S * f64::from(row);
        if row % 10 == 0 {
            line(text, time_s, node << 5 | 0x01, &[0, 0, 0, 0, 8, 0, 0, 0]);
        }
        line(text, time_s, node << 5 | 0x09, &pair(position(time_s), velocity(time_s)));
        let later = time_s + LATER_S;
        line(text, later, node << 5 | command, &pair(9.0, torque(later)));
    }
}

/// Writes the answers of a moteus: the registers 0 to 3 as 16-bit integers in CAN FD frames.
fn moteus(text: &mut String) {
    for row in 0..ROWS {
        let time_s = PERIOD_S * f64::from(row);
        let registers =
            [10.0, position(time_s) / 1e-4, velocity(time_s) / 2.5e-4, torque(time_s) / 0.01];
        let values = registers.iter().flat_map(|value| (value.round() as i16).to_le_bytes());
        let hex: String = values.map(|byte| format!("{byte:02x}")).collect();
        let stamp = 1_700_000_000.0 + time_s;
        let _ = writeln!(text, "({stamp:.6}) can0 00008001##1140400");
        let _ = writeln!(text, "({stamp:.6}) can0 100##1240400{hex}5050");
    }
}

fn read_text(text: &str, options: &ReadOptions) -> Result<Dataset, String> {
    let folder = Folder::new();
    let file = folder.write("drive.log", text);
    read(&[file], options, &|_, _| {}).map_err(|error| plain(&folder, &error))
}

fn preset(preset: Preset) -> ReadOptions {
    ReadOptions { preset: Some(preset), ..ReadOptions::default() }
}

/// Requires the motion and the torque of the log, `torque_scale` times as large.
fn assert_is_log(data: &Dataset, later_s: f64, torque_scale: f64, resolution_nm: f64) {
    let run = &data.runs[0];
    assert!(run.len() > ROWS as usize - 3, "{} rows", run.len());
    let position_rad = run.get(Quantity::Position).expect("a position");
    let mut compared = 0;
    for (row, time_s) in run.time_s.iter().enumerate() {
        let log_s = time_s - run.time_s[0] + later_s;
        // Around a reversal the torque changes within the resolution of the times.
        if velocity(log_s).abs() < 0.05 {
            continue;
        }
        compared += 1;
        let error = run.velocity[row] - TAU * velocity(log_s);
        assert!(error.abs() < 0.01, "{log_s}: {error} rad/s");
        let error = position_rad[row] - TAU * position(log_s);
        assert!(error.abs() < 0.01, "{log_s}: {error} rad");
        let error = run.torque[row] - torque_scale * torque(log_s);
        assert!(error.abs() < resolution_nm, "{log_s}: {error} Nm");
    }
    assert!(compared > 300, "{compared}");
}

#[test]
fn read_of_odrive_trace_returns_si_units_with_and_without_preset() {
    let mut text = String::new();
    odrive(&mut text, 3, 0x1C);
    for options in [preset(Preset::ODrive), ReadOptions::default()] {
        let data = read_text(&text, &options).expect("a log");
        assert_is_log(&data, LATER_S, 1.0, 1e-3);
        message::require(&data.notes.join("\n"), &["torque_nm", "Torque_Estimate"]);
        if options.preset.is_some() {
            let parts = ["odrive"];
            message::check("drives", "trace of an ODrive", &data.notes.join("\n"), &parts);
        }
    }
}

#[test]
fn read_of_moteus_trace_returns_si_units_with_and_without_preset() {
    let mut text = String::new();
    moteus(&mut text);
    for options in [preset(Preset::Moteus), ReadOptions::default()] {
        let data = read_text(&text, &options).expect("a log");
        assert_is_log(&data, 0.0, 1.0, 6e-3);
    }
}

#[test]
fn read_of_odrive_trace_with_columns_reverses_sign() {
    let mut text = String::new();
    odrive(&mut text, 0, 0x1C);
    let columns = vec![("torque_nm".to_owned(), "Torque_Estimate:-Nm".to_owned())];
    let data = read_text(&text, &ReadOptions { columns, ..preset(Preset::ODrive) });
    assert_is_log(&data.expect("a log"), LATER_S, -1.0, 1e-3);
}

#[test]
fn read_of_odrive_trace_with_currents_needs_torque_constant() {
    let mut text = String::new();
    odrive(&mut text, 5, 0x14);
    let error = read_text(&text, &preset(Preset::ODrive)).expect_err("no constant");
    let parts = ["torque_nm", "Iq_Measured", "torque constant"];
    message::check("drives", "currents without torque constant", &error, &parts);
    let torque_constant = TorqueConstant::parse("0.05Nm/A").ok();
    let data = read_text(&text, &ReadOptions { torque_constant, ..preset(Preset::ODrive) });
    assert_is_log(&data.expect("a log"), LATER_S, 0.05, 1e-3);
}

#[test]
fn read_of_odrive_trace_of_two_drives_asks_for_one() {
    let (mut first, mut second) = (String::new(), String::new());
    odrive(&mut first, 1, 0x1C);
    odrive(&mut second, 2, 0x1C);
    let mut lines: Vec<&str> = first.lines().chain(second.lines()).collect();
    lines.sort_by(|a, b| a[..20].cmp(&b[..20]));
    let text = lines.join("\n") + "\n";
    let error = read_text(&text, &preset(Preset::ODrive)).expect_err("two drives");
    assert!(error.contains("joint") && error.contains("1, 2"), "{error}");
    let only = vec![("joint".to_owned(), vec!["2".to_owned()])];
    let data = read_text(&text, &ReadOptions { only, ..preset(Preset::ODrive) });
    assert_is_log(&data.expect("a log"), LATER_S, 1.0, 1e-3);
}

#[test]
fn read_of_trace_without_frames_of_drive_names_what_is_missing() {
    let mut estimates = String::new();
    odrive(&mut estimates, 3, 0x02);
    let error = read_text(&estimates, &preset(Preset::ODrive)).expect_err("no torque");
    let parts = ["drive.log", "061", "odrive", "Get_Encoder_Estimates"];
    message::check("drives", "frames without torque of an ODrive", &error, &parts);
    let error = read_text(&estimates, &preset(Preset::Moteus)).expect_err("another drive");
    message::check("drives", "frames of no moteus", &error, &["moteus", "registers 002"]);
    let error = read_text(&estimates, &ReadOptions::default()).expect_err("no joint");
    message::check("drives", "frames of no joint", &error, &["drive.log"]);
}

#[test]
fn read_of_odrive_trace_with_many_malformed_lines_returns_error() {
    let mut text = String::new();
    odrive(&mut text, 3, 0x1C);
    let damaged = |(at, line): (usize, &str)| match at % 5 {
        0 => format!("{}\n", line.replace('#', "!")),
        _ => format!("{line}\n"),
    };
    let text: String = text.lines().enumerate().map(damaged).collect();
    let error = read_text(&text, &preset(Preset::ODrive)).expect_err("damaged");
    assert!(error.contains("row 1") || error.contains("line 1"), "{error}");
}

/// Returns the lines of `candump -L` as candump shows them by default, with other stamps.
fn default_view(text: &str, stamp: impl Fn(usize, f64) -> String) -> String {
    let view = |(at, line): (usize, &str)| {
        let (time_s, frame) = line.split_once(") can0 ").expect("a line");
        let (identifier, data) = frame.split_once('#').expect("a frame");
        let bytes: Vec<String> = data
            .as_bytes()
            .chunks(2)
            .map(|pair| String::from_utf8_lossy(pair).into_owned())
            .collect();
        let (length, bytes) = (bytes.len(), bytes.join(" "));
        let time_s = time_s[1..].parse().expect("a stamp");
        format!(" {}  can0  {identifier}   [{length}]  {bytes}   'a) #.'\n", stamp(at, time_s))
    };
    text.lines().enumerate().map(view).collect()
}

#[test]
fn read_of_default_view_of_candump_needs_stamps() {
    let mut text = String::new();
    odrive(&mut text, 3, 0x1C);
    for stamp in [
        |_, time_s: f64| format!("({time_s:.6})"),
        |_, time_s: f64| format!("(2026-11-30 10:11:{:09.6})", time_s - 1_700_000_000.0),
    ] {
        let data = read_text(&default_view(&text, stamp), &ReadOptions::default()).expect("a log");
        assert_is_log(&data, LATER_S, 1.0, 1e-3);
    }
    let unstamped = default_view(&text, |_, _| String::new());
    for rate_hz in [None, Some(100.0)] {
        let options = ReadOptions { rate_hz, ..preset(Preset::ODrive) };
        let error = read_text(&unstamped, &options).expect_err("no times");
        let parts = ["drive.log", "without time stamps", "candump -l can0", "candump -L", "rate"];
        message::check("drives", "default view without stamps", &error, &parts);
    }
}

#[test]
fn read_of_joint_without_stamps_counts_syncs_at_the_given_rate() {
    let mut text = String::new();
    for row in 0..ROWS {
        let time_s = PERIOD_S * f64::from(row);
        line(&mut text, time_s, 0x481, &pair(velocity(time_s), position(time_s)));
        line(&mut text, time_s, 0x681, &pair(torque(time_s), f64::NAN));
        line(&mut text, time_s, 0x080, &[(row % 240 + 1) as u8]);
    }
    let unstamped = default_view(&text, |_, _| String::new());
    let options = ReadOptions { rate_hz: Some(1.0 / PERIOD_S), ..ReadOptions::default() };
    let (counted, stamped) =
        (read_text(&unstamped, &options), read_text(&text, &ReadOptions::default()));
    let (counted, stamped) = (counted.expect("a log"), stamped.expect("a log"));
    assert_eq!((counted.rows, stamped.rows), (ROWS as usize, ROWS as usize));
    assert_eq!(counted.runs[0].torque, stamped.runs[0].torque);
    let off =
        counted.runs[0].time_s.iter().zip(&stamped.runs[0].time_s).map(|(a, b)| (a - b).abs());
    assert!(off.fold(0.0, f64::max) < 1e-6);
    assert!(read_text(&unstamped, &ReadOptions::default()).is_err());
}
