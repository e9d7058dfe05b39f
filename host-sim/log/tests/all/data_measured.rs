//! Reading of logs of real machines, and of made-up ones after public bug reports (`tests/data`).
//!
//! Every run reads the excerpts, `LONG_TESTS=1` the full files (see `measured_logs`).

use std::path::{Path, PathBuf};

use super::message;
use joint_log::{Dataset, JointKind, Quantity, ReadOptions, SplitRule, read, split};
use measured_logs::{MeasuredLogs, case_log};

/// Returns the paths of some logs, and the number of rows of each: that of the excerpt or that of the full file.
fn measured<const N: usize>(logs: [(&str, usize, usize); N]) -> ([PathBuf; N], [usize; N]) {
    let measured = MeasuredLogs::of_this_run();
    let rows = logs.map(|(_, excerpt, full)| if measured.is_full() { full } else { excerpt });
    (logs.map(|(name, ..)| measured.file(name)), rows)
}

fn load(files: &[PathBuf], columns: &[(&str, &str)]) -> Dataset {
    let columns = columns.iter().map(|(a, b)| (a.to_string(), b.to_string())).collect();
    read(files, &ReadOptions { columns, skip: 0, ..ReadOptions::default() }, &|_, _| {}).unwrap()
}

#[test]
fn read_with_positioning_system_maps_columns() {
    let logs = [("emps-train.csv", 2_480, 24_841), ("emps-pulses.csv", 2_480, 24_841)];
    let (files, rows) = measured(logs);
    let columns =
        [("time_s", "t_s"), ("velocity_m_s", "vel_m_per_s"), ("force_n", "motor_force_N")];
    let data = load(&files, &columns);
    assert_eq!(data.joint, JointKind::Prismatic);
    assert_eq!((data.rows_read, data.bad_rows.count), (rows.iter().sum(), 0));
    assert_eq!(data.runs[0].name, "emps-train");
}

#[test]
fn read_with_seals_returns_all_rows() {
    let (files, rows) =
        measured([("seal-oring.csv", 17_745, 46_414), ("seal-kdn.csv", 11_719, 32_439)]);
    for (file, rows) in files.into_iter().zip(rows) {
        let data = load(&[file], &[]);
        assert_eq!((data.rows, data.bad_rows.count), (rows, 0));
        assert!(data.runs.iter().all(|run| run.get(Quantity::Pressure).is_some()));
    }
}

#[test]
fn read_with_worm_drive_and_servo_returns_all_rows() {
    let (files, rows) =
        measured([("worm-drive.csv", 5_750, 22_997), ("servo-pendulum.csv", 14_910, 14_910)]);
    let data = load(&files[..1], &[]);
    assert_eq!((data.rows, data.bad_rows.count), (rows[0], 0));
    let rule = SplitRule::HoldOut { column: "run".into(), values: vec![data.runs[3].name.clone()] };
    assert_eq!(split(&data, &rule, 0).unwrap().test.len(), 1);

    let data = load(&files[1..], &[("torque_nm", "drive_voltage_v")]);
    assert_eq!((data.rows, data.runs.len(), data.bad_rows.count), (rows[1], 16, 0));
    assert_eq!(data.covariates, ["kp"]);
    assert_eq!(data.runs[0].labels, [("trajectory".to_string(), "sin_sin".to_string())]);
    let rule = SplitRule::parse_hold_out("kp=400").unwrap();
    assert_eq!(split(&data, &rule, 0).unwrap().test.len(), 4);
}

#[test]
fn read_with_reported_logs_without_a_clock_says_what_to_type() {
    let cases = ["clock-stands-still.csv", "step-instead-of-clock.csv", "candump-delta-stamps.log"];
    let files = cases.map(case_log);
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
