//! A log of several joints: every command reports each joint as if it were the only one.
#![cfg(feature = "cli")]

use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

/// Coulomb torques of the joints, Nm.
const COULOMB_NM: [f64; 2] = [1.0, 3.0];

/// Time, velocity and torque of a joint, three runs.
fn rows(joint: usize) -> impl Iterator<Item = (usize, f64, f64, f64)> {
    (0..3).flat_map(move |run| {
        (0..400).map(move |row| {
            let t = 0.01 * row as f64;
            let velocity = (1.0 + run as f64) * (3.0 * t + 0.4 * joint as f64).sin();
            let noise = 0.01 * ((row * 7919 + run * 31) % 1000) as f64 / 1000.0;
            let torque = COULOMB_NM[joint] * velocity.signum() + 0.2 * velocity + noise - 0.005;
            (run, t, velocity, torque)
        })
    })
}

/// A log with both joints in each row and numbered columns.
fn side_by_side() -> String {
    let mut text =
        "run,time_s,velocity_rad_s_1,torque_nm_1,velocity_rad_s_2,torque_nm_2\n".to_owned();
    for ((run, t, v, y), (_, _, w, z)) in rows(0).zip(rows(1)) {
        let _ = writeln!(text, "{run},{t:.2},{v},{y},{w},{z}");
    }
    text
}

/// A log with one row for each joint and a column with the joint's name.
fn row_by_row() -> String {
    let mut text = "run,time_s,joint,velocity_rad_s,torque_nm\n".to_owned();
    for (first, second) in rows(0).zip(rows(1)) {
        for ((run, t, v, y), name) in [(first, "left hip"), (second, "left-hip")] {
            let _ = writeln!(text, "{run},{t:.2},{name},{v},{y}");
        }
    }
    text
}

fn run(folder: &Path, arguments: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(arguments.split_whitespace()).current_dir(folder).output().expect("it runs")
}

fn json(folder: &Path, name: &str) -> Value {
    let text = std::fs::read_to_string(folder.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
    serde_json::from_str(&text).expect("JSON")
}

fn coulomb(document: &Value) -> f64 {
    document["models"][0]["params"]["coulomb_torque"]["value"].as_f64().expect("a number")
}

#[test]
fn identify_with_several_joints_writes_one_result_each_and_a_list() {
    for (log, names, folders) in [
        (side_by_side(), ["1", "2"], ["joint-1", "joint-2"]),
        (row_by_row(), ["left hip", "left-hip"], ["joint-left-hip", "joint-left-hip-2"]),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let folder = folder.path();
        std::fs::write(folder.join("arm.csv"), log).expect("written");
        let done = run(folder, "identify arm.csv --model linear");
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let all = json(folder, "out/identify-arm/fit.json");
        for (index, name) in names.iter().enumerate() {
            let listed = &all["joints"][index];
            assert_eq!(listed["joint"], *name);
            assert!((coulomb(listed) - COULOMB_NM[index]).abs() < 0.02, "{name}");
            let alone = json(folder, &format!("out/identify-arm/{}/fit.json", folders[index]));
            assert_eq!(alone["models"], listed["models"]);
            for file in ["fit.html", "params.toml"] {
                assert!(
                    folder.join("out/identify-arm").join(folders[index]).join(file).is_file(),
                    "{file}"
                );
            }
        }
        let shown = String::from_utf8_lossy(&done.stdout);
        assert!(names.iter().all(|name| shown.contains(&format!("joint {name}:"))), "{shown}");
        assert!(
            !folder.join("out/identify-arm/params.toml").exists(),
            "a parameter file belongs to one joint"
        );
    }
}

#[test]
fn identify_with_where_joint_writes_only_that_joint() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("arm.csv"), side_by_side()).expect("written");
    let done = run(folder, "identify arm.csv --model linear --where joint=2 --out alone");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!((coulomb(&json(folder, "alone/fit.json")) - COULOMB_NM[1]).abs() < 0.02);
    assert!(folder.join("alone/params.toml").is_file() && !folder.join("alone/joint-2").exists());
    let refused = run(folder, "identify arm.csv --model linear --where joint=3 --out none");
    assert_eq!(refused.status.code(), Some(2));
    let line = String::from_utf8_lossy(&refused.stderr);
    assert!(line.starts_with("error: arm.csv: --where joint=3: "), "{line}");
    assert!(line.ends_with(" 1, 2\n") && line.lines().count() == 1, "{line}");
    crate::snapshot::check("identify-inside", "a joint that is not in the log", &line);
    assert!(!folder.join("none").exists());
}

#[test]
fn compare_and_diagnose_report_all_joints() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    std::fs::write(folder.join("arm.csv"), side_by_side()).expect("written");
    for (command, file, key) in [
        ("compare arm.csv --models linear,extended", "compare-arm/compare.json", "models"),
        ("diagnose arm.csv --model linear", "diagnose-arm/diagnosis.json", "cause"),
    ] {
        let done = run(folder, &format!("{command} --json"));
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let printed: Value = serde_json::from_slice(&done.stdout).expect("JSON");
        assert_eq!(printed, json(folder, &format!("out/{file}")));
        let joints = printed["joints"].as_array().expect("a list");
        assert_eq!(joints.len(), 2);
        assert!(joints.iter().all(|joint| !joint[key].is_null()), "{command}");
    }
}

#[test]
fn identify_with_one_unusable_joint_names_it_and_writes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    // Joint 2 has only one row.
    let mut text = "run,time_s,joint,velocity_rad_s,torque_nm\n".to_owned();
    for (run, t, v, y) in rows(0) {
        let _ = writeln!(text, "{run},{t:.2},1,{v},{y}");
    }
    text += "2,9,2,1.0,1.0\n";
    std::fs::write(folder.join("arm.csv"), text).expect("written");
    let refused = run(folder, "identify arm.csv --model linear");
    assert_eq!(refused.status.code(), Some(2));
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(
        stderr.lines().last().is_some_and(|line| line.starts_with("error: joint 2: ")),
        "{stderr}"
    );
    assert!(!folder.join("out").exists());
}

#[test]
#[cfg(feature = "papers")]
fn identify_inside_manipulator_fits_all_joints() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let simulated = run(folder, "simulate manipulator --seconds 30 --rate 200 --runs 2 --out .");
    assert!(simulated.status.success(), "{}", String::from_utf8_lossy(&simulated.stderr));
    let how = "data.csv --hold-out run=other-1 --inside manipulator";
    let done = run(folder, &format!("identify {how} --model linear --starts 1"));
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let found = json(folder, "out/identify-data/fit.json");
    assert_eq!(
        (&found["fitted_on"][0], &found["held_out"][0]),
        (&"printed".into(), &"other-1".into())
    );
    let joints = found["models"][0]["joints"].as_array().expect("joints");
    assert_eq!(joints.len(), 3);
    for joint in joints {
        // The arm swings by tens of degrees; without friction it would never come to rest.
        for error in ["fitted_rmse_deg", "held_out_rmse_deg"] {
            assert!(joint[error].as_f64().is_some_and(|deg| deg > 0.0 && deg < 5.0), "{joint}");
        }
        let viscous = joint["params"]["viscous_friction"]["value"].as_f64();
        assert!(viscous.is_some_and(|value| value > 0.01), "{joint}");
        let name = joint["joint"].as_str().expect("a name");
        assert!(folder.join(format!("out/identify-data/joint-{name}/params.toml")).is_file());
    }
    let mut messages = String::new();
    for (arguments, part) in [
        (format!("identify {how} --model dahl"), "linear, extended, atan, lugre"),
        (format!("identify {how} --model linear --where joint=1,2"), "joints 1, 2"),
        (format!("compare {how} --models linear --where joint=1"), "joint"),
    ] {
        let refused = run(folder, &format!("{arguments} --out none"));
        assert_eq!(refused.status.code(), Some(2), "{arguments}");
        let stderr = String::from_utf8_lossy(&refused.stderr);
        let last = stderr.lines().last().expect("an error");
        assert!(last.contains(part), "{stderr}");
        messages += &format!("{last}\n");
    }
    crate::snapshot::check("identify-inside", "bad input", &messages);
    assert!(!folder.join("none").exists());
}
