//! The diagnosis of real machines: what is known to be in their logs is named, and what it gains.
//!
//! The logs lie beside the project, not in it; see `measured_figures.rs`. Where there are none the test
//! says that it was skipped.

use friction_identification::data::{ReadOptions, SplitRule, read, split};
use friction_identification::diagnose::{Diagnosis, Question, diagnose};
use friction_identification::spec::parse_rigid_body;
use std::path::{Path, PathBuf};

fn folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("MEASURED_DATA").map_or(beside, PathBuf::from);
    if !folder.is_dir() {
        println!("skipped: measured logs, none at {}", folder.display());
        return None;
    }
    Some(folder)
}

struct Case {
    files: &'static [&'static str],
    columns: &'static [(&'static str, &'static str)],
    rigid_body: &'static str,
    skip: usize,
    decimate: usize,
    rule: fn(&[PathBuf]) -> SplitRule,
}

const CASE: Case = Case {
    files: &[],
    columns: &[],
    rigid_body: "",
    skip: 0,
    decimate: 1,
    rule: |_| SplitRule::default(),
};

fn examine(folder: &Path, case: &Case) -> Diagnosis {
    let files: Vec<PathBuf> = case.files.iter().map(|name| folder.join(name)).collect();
    let pair = |(ours, theirs): &(&str, &str)| ((*ours).to_owned(), (*theirs).to_owned());
    let options = ReadOptions { columns: case.columns.iter().map(pair).collect(), skip: case.skip };
    let data = read(&files, &options, &|_, _| {}).expect("a log by the contract");
    let parts = split(&data, &(case.rule)(&files), 0).expect("a split");
    let rigid_body = parse_rigid_body(case.rigid_body).expect("known parts");
    let question = Question { decimate: case.decimate, rigid_body, ..Question::default() };
    diagnose(&data, &parts, &question, &|_| {}).expect("a diagnosis")
}

fn names(found: &Diagnosis) -> Vec<&'static str> {
    found.findings.iter().map(|finding| finding.cause.name()).collect()
}

fn held_out(found: &Diagnosis) -> f64 {
    let rmse = found.after.metrics.rmse;
    println!("{:?}: {} -> {rmse}", names(found), found.before.metrics.rmse);
    rmse
}

#[test]
fn pressure_is_named_on_both_seals_and_its_other_half_called_calibration() {
    let Some(folder) = folder() else { return };
    // The README of the data reaches 1.76 and 0.74 N with pressure terms.
    let seals: [(&'static [&'static str], f64, f64); 2] =
        [(&["seal-oring.csv"], 1.2, 1.76), (&["seal-kdn.csv"], 0.4, 0.74)];
    for (files, least, most) in seals {
        let file = files[0];
        let tail = |_: &[PathBuf]| SplitRule::Tail { share: 0.3 };
        let found = examine(&folder, &Case { files, rule: tail, ..CASE });
        assert_eq!(found.cause(), "pressure-coulomb", "{file}: {:?}", names(&found));
        assert!((least..most).contains(&held_out(&found)), "{file}");
        let other = found.findings.iter().find(|finding| {
            finding.cause.name() == "unknown" && finding.columns == ["pressure_diff_pa"]
        });
        let words = other.map(|finding| finding.in_words.clone()).unwrap_or_default();
        assert!(words.contains("calibration"), "{file}: {words}");
    }
}

#[test]
fn asymmetry_is_named_on_the_positioning_system() {
    let Some(folder) = folder() else { return };
    let found = examine(
        &folder,
        &Case {
            files: &["emps-train.csv", "emps-pulses.csv"],
            columns: &[
                ("time_s", "t_s"),
                ("position_m", "q_m"),
                ("force_n", "motor_force_N"),
                ("velocity_m_s", "vel_m_per_s"),
                ("acceleration_m_s2", "acc_m_per_s2"),
            ],
            rigid_body: "inertia,offset",
            skip: 49,
            decimate: 10,
            rule: |files| SplitRule::Files(vec![files[1].clone()]),
        },
    );
    assert_eq!(found.cause(), "direction-asymmetry", "{:?}", names(&found));
    held_out(&found);
    let relative = found.after.metrics.relative_error_percent;
    assert!((4.5..5.4).contains(&relative), "{relative} % on pulses");
}

#[test]
fn asymmetry_is_named_on_the_worm_drive() {
    let Some(folder) = folder() else { return };
    let found = examine(&folder, &Case { files: &["worm-drive.csv"], ..CASE });
    assert_eq!(found.cause(), "direction-asymmetry", "{:?}", names(&found));
    assert!((1e-4..1.7e-4).contains(&held_out(&found)));
}

#[test]
fn load_is_named_on_the_servo_and_temperature_is_not() {
    let Some(folder) = folder() else { return };
    let found = examine(
        &folder,
        &Case {
            files: &["servo-pendulum.csv"],
            columns: &[("torque_nm", "drive_voltage_v")],
            rigid_body: "load,offset",
            rule: |_| SplitRule::parse_hold_out("kp=400").expect("a rule"),
            ..CASE
        },
    );
    assert!(names(&found).contains(&"load-torque-coulomb"), "{:?}", names(&found));
    let blamed = found.findings.iter().flat_map(|finding| &finding.columns);
    assert!(!blamed.clone().any(|column| column == "temperature_c"), "{:?}", names(&found));
    assert!((0.4..0.6).contains(&held_out(&found)));
}
