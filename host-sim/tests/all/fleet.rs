//! `fleet`: one bad log fails alone, a second call computes only what changed, and the pages of all joints are linked.
#![cfg(feature = "cli")]

use crate::drawn_chart::sentences;
use crate::snapshot;
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

/// Runs `fleet` on a folder or table. Returns the rows of its result.
fn fleet(folder: &Path, data: &str) -> Vec<Value> {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let arguments = ["fleet", data, "--out", "out", "--fixed-model", "linear", "--json"];
    let output = command.args(arguments).current_dir(folder).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(!said.contains("panicked"), "{said}");
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
    let rows = fleet(folder.path(), "logs");
    let causes: Vec<(&str, bool)> = rows
        .iter()
        .map(|row| (row["joint"].as_str().expect("a text"), row["error"].is_null()))
        .collect();
    assert_eq!(causes, [("hip", true), ("knee", true), ("wrist", false)]);
    let error = rows[2]["error"].as_str().expect("a text");
    assert!(error.contains("a.csv: ") && error.contains("time_s, torque_nm"), "{error}");
    assert!(error.contains("--columns"), "{error}");
    snapshot::check("fleet", "a log without a velocity", error);
    let level = rows[0]["levels"][0]["value"].as_f64().expect("a number");
    assert!((level / 1.2 - 1.0).abs() < 0.05, "{level}");
    for row in &rows[..2] {
        let report = row["report"].as_str().expect("a text");
        let page = std::fs::read_to_string(path("out").join(report)).expect("read");
        assert!(!page.contains("<script src"), "a report needs another file");
        let folder = path("out").join(report).parent().expect("a folder").to_owned();
        let files = std::fs::read_dir(folder).expect("a folder");
        let sizes = files.map(|file| file.expect("a file").metadata().expect("a size").len());
        let size: u64 = sizes.sum();
        assert!(size < 100_000, "{size} bytes: 200 diagnoses take more than 20 MB");
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
    let again = fleet(folder.path(), "logs");
    assert_eq!(seconds(&again, "hip"), seconds(&rows, "hip"));
    assert_ne!(seconds(&again, "knee"), seconds(&rows, "knee"));
    let level = again[1]["levels"][0]["value"].as_f64().expect("a number");
    assert!((level / 1.6 - 1.0).abs() < 0.05, "{level}");
}

#[test]
fn fleet_of_one_table_has_the_rows_of_the_same_logs_in_folders() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let mut table = String::new();
    for (joint, coulomb_nm) in [("hip", 1.2), ("knee", 1.4)] {
        let log = path(&format!("logs/{joint}/2026-03-01.csv"));
        write_log(&log, coulomb_nm);
        let text = std::fs::read_to_string(log).expect("read");
        let (header, rows) = text.split_once('\n').expect("a header");
        if table.is_empty() {
            table = format!("campaign,{header},joint\n");
        }
        rows.lines().for_each(|row| {
            let _ = writeln!(table, "2026-03-01,{row},{joint}");
        });
    }
    std::fs::write(path("table.csv"), table).expect("written");
    let of_table = fleet(folder.path(), "table.csv");
    assert_eq!(of_table.len(), 2);
    assert_eq!(of_table[1]["files"][0], "table.csv (joint=knee, campaign=2026-03-01)");
    std::fs::remove_dir_all(path("out")).expect("removed");
    let of_folders = fleet(folder.path(), "logs");
    for (one, other) in of_table.iter().zip(&of_folders) {
        for key in ["joint", "campaign", "cause", "test_rmse", "levels", "report"] {
            assert_eq!(one[key], other[key], "{key}");
        }
    }
    let page = std::fs::read_to_string(path("out/fleet.html")).expect("read");
    snapshot::check("fleet", "page of two joints", &sentences(&page));
}

#[test]
fn fleet_with_several_forms_of_paths_reports_them_in_one_line() {
    let folder = tempfile::tempdir().expect("a folder");
    for log in ["logs/hip/1.csv", "logs/knee.csv"] {
        write_log(&folder.path().join(log), 1.2);
    }
    std::fs::write(folder.path().join("logs/hip/2.csv.gz"), "no archive").expect("written");
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let arguments = ["fleet", "logs", "--fixed-model", "linear"];
    let output = command.args(arguments).current_dir(folder.path()).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr);
    let lines: Vec<&str> = said.lines().filter(|line| line.contains("forms of paths")).collect();
    assert_eq!(lines.len(), 1, "{said}");
    assert!(lines[0].contains("JOINT.csv") && lines[0].contains("JOINT/CAMPAIGN.csv"), "{said}");
    let text = String::from_utf8_lossy(&output.stdout);
    let first = text.lines().next().unwrap_or_default();
    assert!(first.contains("of 2 joints "), "{text}");
    snapshot::check("fleet", "paths of several forms", &[lines[0], first].join("\n"));
    assert_eq!(
        text.lines().filter(|line| line.starts_with("failed: joint hip")).count(),
        1,
        "{text}"
    );
}

/// Writes the trend of a learnt level over 140 h that rises by this share.
fn write_trend(file: &Path, rise: f64) {
    let mut text = "learnt_h,level_nm,level_gain,level_std_deviation,viscous_gain,changed_term,changed_term_gain\n".to_owned();
    for entry in 0..41 {
        let noise = 0.02 * (f64::from((entry * 7919) % 1000) / 1000.0 - 0.5);
        let level = 4.0 * (1.0 + rise * f64::from(entry) / 40.0 + noise);
        let _ = writeln!(text, "{},{level:.4},1,0.01,1,,", 3.5 * f64::from(entry));
    }
    std::fs::create_dir_all(file.parent().expect("a folder")).expect("created");
    std::fs::write(file, text).expect("written");
}

/// Runs `fleet` on `logs`. Returns exit code, standard output and standard error.
fn run_fleet(folder: &Path, options: &[&str]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    let arguments = [&["fleet", "logs", "--out", "out"], options].concat();
    let output = command.args(arguments).current_dir(folder).output().expect("it runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn fleet_with_one_ageing_joint_names_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    write_log(&path("logs/joint=hip/campaign=1/a.csv"), 1.2);
    write_trend(&path("logs/joint=hip/trend.csv"), 0.0);
    write_trend(&path("logs/elbow/trend.csv"), 0.01);
    write_trend(&path("logs/knee.trend.csv"), 0.23);
    let (code, text, said) = run_fleet(folder.path(), &["--fixed-model", "linear"]);
    assert_eq!(code, Some(0), "{said}");
    let first: Vec<&str> = text.lines().take(2).collect();
    assert!(first[0].contains("of 3 joints "), "{text}");
    assert!(first[1].starts_with("- knee: ") && first[1].contains(" 140 h"), "{text}");
    snapshot::check("fleet", "one ageing joint", &first.join("\n"));
    let (_, text, _) = run_fleet(folder.path(), &["--fixed-model", "linear", "--json"]);
    let document: Value = serde_json::from_str(&text).expect("JSON");
    let ageing = document["ageing"].as_array().expect("a list");
    let joints: Vec<&str> = ageing.iter().filter_map(|of| of["joint"].as_str()).collect();
    assert_eq!(joints[0], "knee");
    assert!(ageing[0]["ageing"].is_string() && ageing[1]["ageing"].is_null(), "{text}");
    let schema = Path::new(env!("CARGO_MANIFEST_DIR")).join("schemas/fleet.schema.json");
    let schema = std::fs::read_to_string(schema).expect("a schema");
    let schema: Value = serde_json::from_str(&schema).expect("JSON");
    let keys = |value: &Value| value.as_object().map(|of| of.keys().cloned().collect::<Vec<_>>());
    assert_eq!(keys(&document), keys(&schema["properties"]));
    let of_joint = &schema["properties"]["ageing"]["items"]["properties"];
    assert_eq!(keys(&ageing[0]), keys(of_joint));
    let low = ageing[0]["change_per_100h_ci95"][0].as_f64().expect("a number");
    assert!(low > 0.1, "{low}");
    assert!(first[1].contains(ageing[0]["ageing"].as_str().expect("a sentence")), "{text}");
    assert_eq!(document["rows"].as_array().map(Vec::len), Some(1), "a trend is no log");
    let page = std::fs::read_to_string(path("out/fleet.html")).expect("read");
    snapshot::check("fleet", "page with an ageing joint", &sentences(&page));
}

#[test]
fn fleet_without_an_ageing_joint_names_none_and_refuses_bad_trends() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    for (joint, rise) in [("hip", 0.0), ("elbow", 0.01), ("knee", -0.01)] {
        write_trend(&path(&format!("logs/{joint}.trend.csv")), rise);
    }
    let (code, text, said) = run_fleet(folder.path(), &[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(text.starts_with("0 of 3 joints "), "{text}");
    let page = std::fs::read_to_string(path("out/fleet.html")).expect("read");
    snapshot::check("fleet", "page without an ageing joint", &sentences(&page));
    write_trend(&path("logs/knee/trend.csv"), 0.0);
    let (code, _, said) = run_fleet(folder.path(), &[]);
    assert_eq!((code, said.lines().count()), (Some(2), 1), "{said}");
    assert!(said.contains("joint knee") && said.contains("trend.csv"), "{said}");
    let second = said;
    std::fs::write(path("logs/knee/trend.csv"), "a,b\n").expect("written");
    std::fs::remove_file(path("logs/knee.trend.csv")).expect("removed");
    let (code, _, said) = run_fleet(folder.path(), &[]);
    assert_eq!((code, said.lines().count()), (Some(2), 1), "{said}");
    assert!(said.contains("trend.csv") && said.contains("learnt_h"), "{said}");
    snapshot::check("fleet", "bad trends", &(second + &said));
}
