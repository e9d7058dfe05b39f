//! Diagnosis of logs of real machines: known causes are named, and the extension reduces the held-out error.
//!
//! The tests call the library as the program does: the log is checked, its motion is reconstructed, and every run is left
//! out once, unless a published figure uses another split. For every log, the proposed extension must not be worse on
//! held-out rows than the base model ([`answer`]).
//!
//! `measured/answers.tsv`, once the command below has written it, stores answers, and the limits are tested on them in every
//! run. The cases in [`SHORT`] are
//! diagnosed in every run, all with `LONG_TESTS=1`, and their answers are compared with the stored ones. The following command writes the answers of all cases:
//!
//! ```text
//! LONG_TESTS=1 UPDATE_TABLES=1 cargo test --release -p friction-diagnose --test all measured_diagnosis::
//! ```
//!
//! The logs are not part of the repository; see `measured_figures.rs`. Without them no log is diagnosed.

use compensator_core::ParameterId;
use friction_diagnose::{Diagnosis, DiagnosisOptions, Finding, diagnose};
use friction_fit::spec::parse_rigid_body;
use joint_log::log_check::{self, Corrections};
use joint_log::{ReadOptions, SplitRule, read, split};
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Cases that every run diagnoses, by files and split.
const SHORT: [&str; 3] =
    ["screw-antibacklash.csv runs", "servo-pendulum.csv runs", "worm-drive.csv runs"];

/// Largest difference of a number from its stored value, relative to values above 1. Another processor or C library changes
/// the last bits of a sine, and a fit then ends elsewhere within its tolerance.
const TOLERANCE: f64 = 1e-3;

/// Held while the file of the answers is read or written, as tests run in parallel.
static FILE: Mutex<()> = Mutex::new(());

fn folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("MEASURED_DATA").map_or(beside, PathBuf::from);
    folder.is_dir().then_some(folder)
}

struct Case {
    files: &'static [&'static str],
    columns: &'static [(&'static str, &'static str)],
    rigid_body: &'static str,
    skip: usize,
    decimate: usize,
    /// Name of the split.
    split: &'static str,
    rule: fn(&[PathBuf]) -> SplitRule,
}

const CASE: Case = Case {
    files: &[],
    columns: &[],
    rigid_body: "",
    skip: 0,
    decimate: 1,
    split: "runs",
    rule: |_| SplitRule::LeaveOneRunOut,
};

/// A finding of an answer.
#[derive(Clone, Debug, PartialEq)]
struct Named {
    cause: String,
    /// Columns, joined by `,`.
    columns: String,
    order: Option<f64>,
    /// The sentence reports an error of a calibration.
    is_calibration: bool,
}

/// What the tests require of a diagnosis.
#[derive(Clone, Debug, PartialEq)]
struct Answer {
    /// Files and split.
    case: String,
    findings: Vec<Named>,
    /// Held-out RMSE of base and extended model, in the unit of the torque.
    before: f64,
    after: f64,
    /// Held-out error of the extended model, 100 norm(e) / norm(y).
    relative_percent: f64,
    gain: f64,
}

impl Named {
    fn of(finding: &Finding) -> Self {
        Self {
            cause: finding.cause.name().to_owned(),
            columns: finding.columns.join(","),
            order: finding.order.map(|(order, _)| order),
            is_calibration: finding.in_words.contains("calibration"),
        }
    }

    fn emit(&self) -> String {
        let order = self.order.map_or(String::new(), |order| format!(" order {order:.4}"));
        let calibration = if self.is_calibration { " calibration" } else { "" };
        format!("{} ({}){order}{calibration}", self.cause, self.columns)
    }

    fn parse(text: &str) -> Option<Self> {
        let (cause, rest) = text.split_once(" (")?;
        let (columns, rest) = rest.split_once(')')?;
        let (rest, is_calibration) =
            rest.strip_suffix(" calibration").map_or((rest, false), |rest| (rest, true));
        let order = rest.strip_prefix(" order ").map(str::parse).transpose().ok()?;
        let (cause, columns) = (cause.to_owned(), columns.to_owned());
        Some(Self { cause, columns, order, is_calibration })
    }
}

impl Answer {
    fn of(case: String, found: &Diagnosis) -> Self {
        Self {
            case,
            findings: found.findings.iter().map(Named::of).collect(),
            before: found.before.metrics.rmse,
            after: found.after.metrics.rmse,
            relative_percent: found.after.metrics.relative_error_percent,
            gain: found.gain.value,
        }
    }

    fn emit(&self) -> String {
        let findings: Vec<String> = self.findings.iter().map(Named::emit).collect();
        let Self { case, before, after, relative_percent, gain, .. } = self;
        let findings = findings.join("; ");
        format!("{case}\t{findings}\t{before:.6e}\t{after:.6e}\t{relative_percent:.4}\t{gain:.6}")
    }

    fn parse(line: &str) -> Option<Self> {
        let cells: Vec<&str> = line.split('\t').collect();
        let [case, findings, before, after, relative_percent, gain] = cells.try_into().ok()?;
        let findings = findings.split("; ").filter(|text| !text.is_empty()).map(Named::parse);
        Some(Self {
            case: case.to_owned(),
            findings: findings.collect::<Option<_>>()?,
            before: before.parse().ok()?,
            after: after.parse().ok()?,
            relative_percent: relative_percent.parse().ok()?,
            gain: gain.parse().ok()?,
        })
    }

    /// Returns the name of the first cause, or `none`.
    fn cause(&self) -> &str {
        self.findings.first().map_or("none", |named| &named.cause)
    }

    /// Returns true if a finding has this cause.
    fn names(&self, cause: &str) -> bool {
        self.findings.iter().any(|named| named.cause == cause)
    }

    /// Returns true if a finding has this column.
    fn uses(&self, column: &str) -> bool {
        self.findings.iter().any(|named| named.columns.split(',').any(|own| own == column))
    }

    /// Asserts that this answer is the stored one, numbers within [`TOLERANCE`].
    fn assert_equals(&self, stored: &Self) {
        let near = |a: f64, b: f64, scale: f64| (a - b).abs() <= TOLERANCE * b.abs().max(scale);
        let equal_findings = self.findings.len() == stored.findings.len()
            && self.findings.iter().zip(&stored.findings).all(|(ours, known)| {
                let is_order = match (ours.order, known.order) {
                    (Some(a), Some(b)) => near(a, b, 1.0),
                    (a, b) => a == b,
                };
                let same = Named { order: known.order, ..ours.clone() };
                same == *known && is_order
            });
        let equal_errors = near(self.before, stored.before, 0.0)
            && near(self.after, stored.after, 0.0)
            && near(self.relative_percent, stored.relative_percent, 1.0)
            && near(self.gain, stored.gain, 1.0);
        assert!(equal_findings && equal_errors, "the diagnosis changed\n{self:?}\n{stored:?}");
    }
}

fn path() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("measured/answers.tsv")
}

fn stored() -> Vec<Answer> {
    let _file = FILE.lock().expect("no test panics while it reads or writes");
    parse_file()
}

fn parse_file() -> Vec<Answer> {
    let text = std::fs::read_to_string(path()).unwrap_or_default();
    text.lines().map(|line| Answer::parse(line).expect("a complete row")).collect()
}

/// Stores an answer in place of the one of the same case.
fn store(answer: &Answer) {
    let _file = FILE.lock().expect("no test panics while it reads or writes");
    let mut all = parse_file();
    all.retain(|own| own.case != answer.case);
    all.push(answer.clone());
    all.sort_by(|a, b| a.case.cmp(&b.case));
    let text: String = all.iter().map(|own| own.emit() + "\n").collect();
    std::fs::write(path(), text).expect("the folder is there");
}

/// Returns the answer of a case and its diagnosis: diagnosed now and compared with the stored answer, or stored and without a
/// diagnosis. Returns `None` if it is neither stored nor diagnosed.
fn answer(case: &Case) -> Option<(Answer, Option<Diagnosis>)> {
    let name = format!("{} {}", case.files.join("+"), case.split);
    let known = || stored().into_iter().find(|own| own.case == name);
    let is_long = std::env::var_os("LONG_TESTS").is_some();
    let is_short = SHORT.contains(&name.as_str());
    let folder = folder();
    if folder.is_none() {
        println!("skipped: the diagnosis of {name}: the measured logs are missing");
    } else if !is_long && !is_short {
        println!("skipped: the diagnosis of {name}: tests/run --all");
    }
    let found = folder.filter(|_| is_long || is_short).map(|folder| examine(&folder, case));
    let now = found.as_ref().map(|found| Answer::of(name.clone(), found));
    if let Some(now) = now.as_ref().filter(|_| std::env::var_os("UPDATE_TABLES").is_some()) {
        store(now);
    }
    if let (Some(now), Some(known)) = (&now, &known()) {
        now.assert_equals(known);
    }
    let answer = now.or_else(known)?;
    println!("{answer:?}");
    assert!(answer.gain >= 0.0, "{answer:?}");
    assert!(answer.gain == 0.0 || answer.cause() != "none", "a gain without a cause: {answer:?}");
    Some((answer, found))
}

fn examine(folder: &Path, case: &Case) -> Diagnosis {
    let files: Vec<PathBuf> = case.files.iter().map(|name| folder.join(name)).collect();
    let pair = |(ours, theirs): &(&str, &str)| ((*ours).to_owned(), (*theirs).to_owned());
    let options = ReadOptions {
        columns: case.columns.iter().map(pair).collect(),
        skip: case.skip,
        ..ReadOptions::default()
    };
    let data = read(&files, &options, &|_, _| {}).expect("a log by the contract");
    let checked = log_check::check(data, Corrections::default());
    let parts = split(&checked.data, &(case.rule)(&files), 0).expect("a split");
    let question = DiagnosisOptions {
        decimate: case.decimate,
        rigid_body: parse_rigid_body(case.rigid_body).expect("known parts"),
        log_findings: checked.findings,
        ..DiagnosisOptions::default()
    };
    let found = diagnose(&checked.data, &parts, &question, &|_| {}).expect("a diagnosis");
    println!("{:?}: {:.0} s, {}", case.files, found.seconds, crate::candidates(&found));
    found
}

#[test]
fn diagnose_seals_with_held_out_tail_names_pressure_and_calibration() {
    // The README of the data reports 1.76 and 0.74 N with pressure terms.
    let seals: [(&'static [&'static str], f64, f64); 2] =
        [(&["seal-oring.csv"], 1.2, 1.76), (&["seal-kdn.csv"], 0.4, 0.74)];
    for (files, least, most) in seals {
        let rule = |_: &[PathBuf]| SplitRule::Tail { share: 0.3 };
        let Some((answer, _)) = answer(&Case { files, split: "tail", rule, ..CASE }) else {
            continue;
        };
        assert_eq!(answer.cause(), "pressure-coulomb", "{answer:?}");
        assert!((least..most).contains(&answer.after), "{answer:?}");
        let is_gain_error = |named: &&Named| {
            let is_unknown = named.cause == "unknown" && named.columns == "pressure_diff_pa";
            is_unknown && named.is_calibration
        };
        assert!(answer.findings.iter().any(|named| is_gain_error(&named)), "{answer:?}");
    }
}

#[test]
fn diagnose_positioning_system_names_direction_asymmetry() {
    let Some((answer, _)) = answer(&Case {
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
        split: "pulses",
        rule: |files| SplitRule::Files(vec![files[1].clone()]),
    }) else {
        return;
    };
    assert_eq!(answer.cause(), "direction-asymmetry", "{answer:?}");
    // Without a spurious drag, Coulomb and viscous friction are those of the authors, 20.4 N and 204 N s/m.
    assert!((4.5..5.5).contains(&answer.relative_percent), "{answer:?}");
    assert!(!answer.names("quadratic-drag"), "{answer:?}");
}

#[test]
fn diagnose_seals_with_held_out_pressure_names_pressure() {
    // Each run has its own pressure, so that each is predicted by a law fitted to the others.
    for files in [&["seal-oring.csv"], &["seal-kdn.csv"]] as [&'static [&'static str]; 2] {
        let Some((answer, _)) = answer(&Case { files, ..CASE }) else { continue };
        assert_eq!(answer.cause(), "pressure-coulomb", "{answer:?}");
    }
}

#[test]
fn diagnose_cogging_motor_names_ripple_of_order_seven() {
    let motor = Case { files: &["bldc-cogging.csv"], rigid_body: "inertia,offset", ..CASE };
    let Some((answer, _)) = answer(&motor) else { return };
    assert_eq!(answer.cause(), "torque-ripple", "{answer:?}");
    let order = answer.findings[0].order.unwrap_or_default();
    assert!((order - 7.0).abs() < 0.05, "order {order}");
    // Every run is left out once, including the only slow one, which limits the accuracy.
    assert!((0.05..0.36).contains(&answer.after), "{answer:?}");
}

#[test]
fn diagnose_second_damper_names_asymmetry_and_backlash() {
    let Some((answer, _)) = answer(&Case { files: &["damper-2.csv"], ..CASE }) else {
        return;
    };
    assert_eq!(answer.cause(), "direction-asymmetry", "{answer:?}");
    assert!(answer.names("backlash"), "{answer:?}");
    assert!(answer.gain >= 0.38, "{answer:?}");
    // The README of the data reports 2210 N with both.
    assert!((2000.0..2320.0).contains(&answer.after), "{answer:?}");
}

#[test]
fn diagnose_damper_names_backlash_and_tension() {
    let Some((answer, _)) = answer(&Case { files: &["damper-1.csv"], ..CASE }) else {
        return;
    };
    // The README of the data reports 1595 N with both. The tension is not a cause of the catalogue: `unknown` names its
    // column.
    assert_eq!(answer.cause(), "backlash", "{answer:?}");
    assert!(answer.uses("tension_n"), "{answer:?}");
    assert!((1200.0..1595.0).contains(&answer.after), "{answer:?}");
}

#[test]
fn diagnose_robot_axis_with_balancer_names_a_cause() {
    let Some((answer, _)) = answer(&Case { files: &["robot-axis2.csv"], ..ROBOT_AXIS }) else {
        return;
    };
    assert_ne!(answer.cause(), "none");
    // The upper limit detects wrong derivatives for a log that starts at rest.
    assert!((0.9..1.45).contains(&answer.after), "{answer:?}");
}

const ROBOT_AXIS: Case = Case { rigid_body: "inertia,load,offset", ..CASE };

#[test]
fn diagnose_third_robot_axis_names_ripple_of_order_eight() {
    let Some((answer, _)) = answer(&Case { files: &["robot-axis3.csv"], ..ROBOT_AXIS }) else {
        return;
    };
    // A law with bristles does not show the direction asymmetry that a law without bristles has.
    assert_eq!(answer.cause(), "position-ripple", "{answer:?}");
    let order = answer.findings[0].order.unwrap_or_default();
    assert!((order - 8.0).abs() < 0.05, "order {order}");
    assert!((0.6..0.85).contains(&answer.after), "{answer:?}");
}

#[test]
fn diagnose_screw_with_varying_zero_finds_ripple_of_order_one_possible() {
    let screw = Case { files: &["screw-antibacklash.csv"], rigid_body: "offset", ..CASE };
    let Some((answer, found)) = answer(&screw) else { return };
    if let Some(found) = &found {
        let ripple = found.candidates.iter().find(|own| own.cause.name() == "torque-ripple");
        let ripple = ripple.expect("a candidate");
        assert!(ripple.probability > 0.3, "{ripple:?}");
        let detail = &ripple.figures.detail;
        assert!(detail.starts_with("order 1.0") && detail.contains("another phase"), "{detail}");
    }
    if answer.cause() != "torque-ripple" {
        assert_eq!(answer.cause(), "unknown", "{answer:?}");
        return;
    }
    assert_eq!(answer.findings[0].order, Some(1.0));
    // The README of the data reports 0.492 mNm.
    assert!((3e-4..4.92e-4).contains(&answer.after), "{answer:?}");
    let Some(found) = found else { return };
    assert_eq!(found.log.aligned_order, Some(1));
    // The phase is unknown on other logs, so that the transferable model has no ripple.
    let (fitted, given) = (&found.extended.parameters, &found.transferable_model().parameters);
    for id in [ParameterId::TorqueRippleSine1, ParameterId::TorqueRippleCosine1] {
        assert_eq!(given.get(id), 0.0);
    }
    assert!(fitted.get(ParameterId::TorqueRippleSine1) != 0.0);
}

#[test]
fn diagnose_first_robot_axis_names_ripple_of_order_eight() {
    let Some((answer, _)) = answer(&Case { files: &["robot-axis1.csv"], ..ROBOT_AXIS }) else {
        return;
    };
    assert_eq!(answer.cause(), "torque-ripple", "{answer:?}");
    assert_eq!(answer.findings[0].order, Some(8.0));
    assert!((0.5..0.64).contains(&answer.after), "{answer:?}");
}

/// The general limits of [`answer`] hold.
#[test]
fn diagnose_other_logs_proposes_no_worse_model() {
    for files in
        [&["damper-1-actuators.csv"], &["damper-quakes.csv"]] as [&'static [&'static str]; 2]
    {
        answer(&Case { files, ..CASE });
    }
}

/// In sliding, a zero error and an asymmetry of the friction have the same columns.
#[test]
fn diagnose_worm_drive_names_direction_asymmetry_or_offset_as_indistinguishable() {
    let worm = Case { files: &["worm-drive.csv"], ..CASE };
    let Some((answer, found)) = answer(&worm) else { return };
    let pair = ["direction-asymmetry", "torque-offset"];
    assert!(pair.contains(&answer.cause()), "{answer:?}");
    assert!((1e-4..1.7e-4).contains(&answer.after), "{answer:?}");
    let Some(found) = found else { return };
    let mut rivals = found.findings[0].confusable_with.iter();
    assert!(rivals.any(|own| pair.contains(&own.cause.name())), "{:?}", found.findings[0]);
}

#[test]
fn diagnose_servo_names_load_and_not_temperature() {
    let servo = Case {
        files: &["servo-pendulum.csv"],
        columns: &[("torque_nm", "drive_voltage_v")],
        rigid_body: "load,offset",
        ..CASE
    };
    // The README's 0.537 V is for the runs with a gain of 400 held out.
    let rule = |_: &[PathBuf]| SplitRule::parse_hold_out("kp=400").expect("a rule");
    for case in [Case { split: "kp=400", rule, ..servo }, Case { ..servo }] {
        let Some((answer, _)) = answer(&case) else { continue };
        assert!(answer.names("load-torque-coulomb"), "{answer:?}");
        assert!(!answer.uses("temperature_c"), "{answer:?}");
        assert!((0.4..0.6).contains(&answer.after), "{answer:?}");
    }
}
