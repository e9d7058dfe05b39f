//! Reading of logs of real machines.
//!
//! The logs are not part of the project. They are in `../shared/data`, relative to the workspace root, or in the directory
//! that the environment variable `MEASURED_DATA` names. Without them the tests print that they are skipped, and pass.

use std::path::{Path, PathBuf};

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
