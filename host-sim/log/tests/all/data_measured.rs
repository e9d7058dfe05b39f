//! Reading of logs of real machines.
//!
//! The logs are not part of the project. They are in `../shared/data`, relative to the workspace root, or in the directory
//! that the environment variable `MEASURED_DATA` names. Without them the tests print that they are skipped, and pass.

use std::path::{Path, PathBuf};

use super::message;
use joint_log::{Dataset, JointKind, Quantity, ReadOptions, SplitRule, read, split};

/// Returns the files, or `None` after printing that the test is skipped.
fn measured(names: &[&str]) -> Option<Vec<PathBuf>> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("MEASURED_DATA").map_or_else(beside, PathBuf::from);
    let files: Vec<PathBuf> = names.iter().map(|name| folder.join(name)).collect();
    if let Some(missing) = files.iter().find(|file| !file.exists()) {
        eprintln!("skipped: {} is not there (MEASURED_DATA)", missing.display());
        return None;
    }
    Some(files)
}

fn load(files: &[PathBuf], columns: &[(&str, &str)]) -> Dataset {
    let columns = columns.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    read(files, &ReadOptions { columns, skip: 0, ..ReadOptions::default() }, &|_, _| {}).unwrap()
}

#[test]
fn read_with_positioning_system_maps_columns() {
    let Some(files) = measured(&["emps-train.csv", "emps-pulses.csv"]) else { return };
    let columns =
        [("time_s", "t_s"), ("velocity_m_s", "vel_m_per_s"), ("force_n", "motor_force_N")];
    let data = load(&files, &columns);
    assert_eq!(data.joint, JointKind::Prismatic);
    assert_eq!((data.rows_read, data.bad_rows.count), (2 * 24_841, 0));
    assert_eq!(data.runs[0].name, "emps-train");
}

#[test]
fn read_with_seals_returns_all_rows() {
    for (name, rows) in [("seal-oring.csv", 46_414), ("seal-kdn.csv", 32_439)] {
        let Some(files) = measured(&[name]) else { return };
        let data = load(&files, &[]);
        assert_eq!((data.rows, data.bad_rows.count), (rows, 0));
        assert!(data.runs.iter().all(|run| run.get(Quantity::Pressure).is_some()));
    }
}

#[test]
fn read_with_worm_drive_and_servo_returns_all_rows() {
    let Some(files) = measured(&["worm-drive.csv"]) else { return };
    let data = load(&files, &[]);
    assert_eq!((data.rows, data.bad_rows.count), (22_997, 0));
    let rule = SplitRule::HoldOut { column: "run".into(), values: vec![data.runs[3].name.clone()] };
    assert_eq!(split(&data, &rule, 0).unwrap().test.len(), 1);

    let Some(files) = measured(&["servo-pendulum.csv"]) else { return };
    let data = load(&files, &[("torque_nm", "drive_voltage_v")]);
    assert_eq!((data.rows, data.runs.len(), data.bad_rows.count), (14_910, 16, 0));
    assert_eq!(data.covariates, ["kp"]);
    assert_eq!(data.runs[0].labels, [("trajectory".to_string(), "sin_sin".to_string())]);
    let rule = SplitRule::parse_hold_out("kp=400").unwrap();
    assert_eq!(split(&data, &rule, 0).unwrap().test.len(), 4);
}

#[test]
fn read_with_reported_logs_without_a_clock_says_what_to_type() {
    let cases = ["clock-stands-still.csv", "step-instead-of-clock.csv", "candump-delta-stamps.log"];
    let Some(files) =
        measured(&cases.map(|name| format!("cases/{name}")).each_ref().map(String::as_str))
    else {
        return;
    };
    let pairs = |time: &str| {
        let theirs = [time, "motor_torque [N.m]", "encoder_paddle_pos [deg]:deg"];
        let ours = ["time_s", "torque_nm", "position_rad"];
        let columns = ours.iter().zip(theirs).map(|(a, b)| (a.to_string(), b.to_owned())).collect();
        ReadOptions { columns, ..ReadOptions::default() }
    };
    let error = |file: &Path, options: &ReadOptions| {
        read(&[file.into()], options, &|_, _| {}).unwrap_err().to_string()
    };
    let still = error(&files[0], &ReadOptions::default());
    message::require(&still, &["clock-stands-still.csv", "0 s", "rate 200Hz"]);
    let step = error(&files[1], &pairs("timestep [us]:us"));
    message::require(&step, &["columns time_s=timestep [us]:us:step", "3.500 ms"]);
    let summed = read(&files[1..2], &pairs("timestep [us]:us:step"), &|_, _| {}).unwrap();
    let run = &summed.runs[0];
    assert!((run.time_s[run.len() - 1] - 0.0035 * (run.len() - 1) as f64).abs() < 1e-9);
    let trace = load(&files[2..], &[]);
    let time = &trace.runs[0].time_s;
    let length = time[time.len() - 1] - time[0];
    assert!(length > 0.9e-3 * time.len() as f64, "{} rows in {length} s", time.len());
}
