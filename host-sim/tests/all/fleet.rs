//! `fleet`: one bad log fails alone, a second call computes only what changed, and the pages of all joints are linked.
#![cfg(feature = "cli")]

use serde_json::Value;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;

/// Writes a log of a joint with this Coulomb torque, Nm.
fn write_log(file: &Path, coulomb_nm: f64) {
    let mut text = "run,time_s,velocity_rad_s,torque_nm\n".to_owned();
    for run in 0..2 {
        for row in 0..300 {
            let t = 0.01 * f64::from(row);
            let v = (1.0 + f64::from(run)) * (4.0 * t).sin();
            let noise = 0.01 * (f64::from((row * 7919 + run * 31) % 1000) / 1000.0 - 0.5);
            let y = coulomb_nm * v.signum() + 0.3 * v + noise;
            let _ = writeln!(text, "{run},{t:.2},{v:.6},{y:.6}");
        }
    }
    std::fs::create_dir_all(file.parent().expect("a folder")).expect("created");
    std::fs::write(file, text).expect("written");
}

/// Runs `fleet` in a folder. Returns the rows of its result.
fn fleet(folder: &Path) -> Vec<Value> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let arguments = ["fleet", "logs", "--out", "out", "--fixed-model", "linear", "--json"];
    let output = command.args(arguments).current_dir(folder).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    let document: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    document["rows"].as_array().expect("rows").clone()
}

fn seconds(rows: &[Value], joint: &str) -> f64 {
    let row = rows.iter().find(|row| row["joint"] == joint).expect("a row");
    row["seconds"].as_f64().expect("a number")
}

#[test]
fn fleet_with_bad_log_keeps_the_others_and_resumes() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    write_log(&path("logs/joint=hip/campaign=2026-03-01/a.csv"), 1.2);
    write_log(&path("logs/joint=knee/campaign=2026-03-01/a.csv"), 1.4);
    std::fs::create_dir_all(path("logs/joint=wrist")).expect("created");
    std::fs::write(path("logs/joint=wrist/a.csv"), "time_s,torque_nm\n0,1\n").expect("written");
    let rows = fleet(folder.path());
    let causes: Vec<(&str, bool)> = rows
        .iter()
        .map(|row| (row["joint"].as_str().expect("a text"), row["error"].is_null()))
        .collect();
    assert_eq!(causes, [("hip", true), ("knee", true), ("wrist", false)]);
    let error = rows[2]["error"].as_str().expect("a text");
    assert!(error.contains("a.csv: found only the columns time_s, torque_nm"), "{error}");
    assert!(error.contains("--columns"), "{error}");
    let level = rows[0]["levels"][0]["value"].as_f64().expect("a number");
    assert!((level / 1.2 - 1.0).abs() < 0.05, "{level}");
    for row in &rows[..2] {
        let report = row["report"].as_str().expect("a text");
        let page = std::fs::read_to_string(path("out").join(report)).expect("read");
        assert!(!page.contains("<script src"), "a report needs another file");
        assert!(page.len() < 600_000, "{} bytes", page.len());
    }
    let page = std::fs::read_to_string(path("out/fleet.html")).expect("read");
    assert!(page.contains("joint=hip/campaign=2026-03-01/report.html"));
    assert!(!path("out/joint=wrist").exists(), "a folder of a failed log");
    let left: Vec<String> = std::fs::read_dir(path("out"))
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .filter(|name| name.starts_with('.'))
        .collect();
    assert!(left.is_empty(), "unfinished: {left:?}");

    // Only the changed log is computed again; the stored duration is that of the first call.
    write_log(&path("logs/joint=knee/campaign=2026-03-01/a.csv"), 1.6);
    let again = fleet(folder.path());
    assert_eq!(seconds(&again, "hip"), seconds(&rows, "hip"));
    assert_ne!(seconds(&again, "knee"), seconds(&rows, "knee"));
    let level = again[1]["levels"][0]["value"].as_f64().expect("a number");
    assert!((level / 1.6 - 1.0).abs() < 0.05, "{level}");
}
