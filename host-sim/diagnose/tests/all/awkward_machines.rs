//! Regression tests of the diagnosis with simulated machines whose logs are difficult to diagnose.
//!
//! The simulations use other equations than the core. A joint under slow position control rests most of the time, and its
//! torque takes any value up to the stiction while the encoder does not move. The force of a cylinder is the rod force
//! minus pressure times a bore area with an error of a few percent. Over the pressures of a campaign this error
//! exceeds the friction, so that the effect of pressure on the friction is small in comparison.

use friction_diagnose::{Diagnosis, DiagnosisOptions, Finding, diagnose};
use joint_log::log_check::{self, Corrections, LogFindingKind};
use joint_log::{Dataset, SplitRule, split};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn diagnose_columns(names: &[&str], runs: Vec<(String, Vec<Vec<f64>>)>) -> Diagnosis {
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let data = Dataset::from_columns(&names, runs).expect("columns of a log");
    let checked = log_check::check(data, Corrections::default());
    let parts = split(&checked.data, &SplitRule::LeaveOneRunOut, 0).expect("runs to split");
    let question =
        DiagnosisOptions { log_findings: checked.findings, ..DiagnosisOptions::default() };
    diagnose(&checked.data, &parts, &question, &|_| {}).expect("an answer")
}

/// Returns a random number with a standard deviation of 1, approximately normal.
fn normal(random: &mut Pcg64) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// Simulates a joint with 0.25 Nm friction and a 14-bit encoder. A weak controller follows a slow reference: the joint rests
/// until the torque exceeds the stiction (0.30 Nm), and then moves briefly.
fn stick_slip(seed: u64) -> (String, Vec<Vec<f64>>) {
    const STEP_S: f64 = 0.01;
    const ENCODER_RAD: f64 = 3.83e-4;
    let mut random = Pcg64::seed_from_u64(seed);
    let mut columns = vec![Vec::new(); 4];
    let (mut angle, mut velocity) = (0.0f64, 0.0f64);
    let substeps = 100;
    for row in 0..3000 {
        let time = row as f64 * STEP_S;
        let reference = 0.25 * (1.7 * time + seed as f64).sin();
        let mut torque = 0.0;
        for _ in 0..substeps {
            torque = 2.0 * (reference - angle);
            let step_s = STEP_S / f64::from(substeps);
            if velocity == 0.0 && torque.abs() < 0.30 {
                continue;
            }
            let direction = if velocity == 0.0 { torque.signum() } else { velocity.signum() };
            let next = velocity + step_s * (torque - 0.25 * direction - 0.05 * velocity) / 0.002;
            // The joint stops when friction would reverse the velocity.
            velocity = if velocity * next < 0.0 { 0.0 } else { next };
            angle += step_s * velocity;
        }
        let friction =
            if velocity == 0.0 { torque } else { 0.25 * velocity.signum() + 0.05 * velocity };
        let values = [
            time,
            (angle / ENCODER_RAD).round() * ENCODER_RAD,
            velocity + 0.002 * normal(&mut random),
            friction + 0.01 * normal(&mut random),
        ];
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    (seed.to_string(), columns)
}

#[test]
fn diagnose_with_joint_at_rest_evaluates_motion_only() {
    let names = ["time_s", "position_rad", "velocity_rad_s", "torque_nm"];
    let found = diagnose_columns(&names, (1..=4).map(stick_slip).collect());
    let notes = &found.log.notes;
    let at_rest = notes.iter().find(|note| note.contains("rows at rest")).expect("a note");
    crate::message::check("notes", "rows at rest", at_rest, &[]);
    println!("{} Nm, {}", found.after.metrics.rmse, crate::candidates(&found));
    assert_eq!(found.cause(), "none", "{:?}", found.findings);
    let rmse = found.after.metrics.rmse;
    assert!((0.009..0.03).contains(&rmse), "{rmse} Nm where the noise is 0.01");
}

/// Simulates strokes of a cylinder at one pressure, with 8 N of friction plus 1 N per bar, and an error of the bore area of
/// 8 % (4 N per bar).
fn strokes(bar: usize) -> (String, Vec<Vec<f64>>) {
    const STEP_S: f64 = 0.01;
    let mut random = Pcg64::seed_from_u64(bar as u64);
    let mut columns = vec![Vec::new(); 5];
    let mut position = 0.0;
    for row in 0..2400 {
        let time = row as f64 * STEP_S;
        // Strokes in both directions with smooth reversals.
        let velocity = 0.006 * (8.0 * (std::f64::consts::TAU * time / 12.0).sin()).tanh();
        position += STEP_S * velocity;
        let pressure_pa = 1e5 * bar as f64 + 800.0 * normal(&mut random);
        let level_n = 8.0 + 1.0e-5 * pressure_pa;
        let force_n = level_n * (velocity / 2e-4).tanh() + 4e-5 * pressure_pa;
        let values = [
            time,
            position,
            velocity + 2e-5 * normal(&mut random),
            force_n + 0.3 * normal(&mut random),
            pressure_pa,
        ];
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    (bar.to_string(), columns)
}

#[test]
fn diagnose_with_wrong_bore_area_names_pressure_and_an_additive_torque() {
    let names = ["time_s", "position_m", "velocity_m_s", "force_n", "pressure_diff_pa"];
    let found = diagnose_columns(&names, [1, 2, 3, 5, 7, 9].map(strokes).into());
    let named: Vec<&str> = found.findings.iter().map(|finding| finding.cause.name()).collect();
    println!("{named:?}, {}", crate::candidates(&found));
    // The error of the area is additive, and the torque is corrected for it.
    let mut faults = found.log_findings.iter();
    assert!(
        faults.any(|fault| fault.kind == LogFindingKind::ChannelGain),
        "{:?}",
        found.log_findings
    );
    // What the area leaves is an offset of about the same probability.
    assert!(
        named.iter().all(|name| ["pressure-coulomb", "torque-offset"].contains(name)),
        "{named:?}"
    );
    let is_pressure = |finding: &&Finding| finding.cause.name() == "pressure-coulomb";
    let pressure = found.findings.iter().find(is_pressure);
    let pressure = pressure.unwrap_or_else(|| panic!("{named:?}"));
    assert!(pressure.probability > 0.8, "{pressure:?}");
    assert!((pressure.size.value - 1e-5).abs() < 2e-6, "{:?}", pressure.size);
    assert!(found.gain.value > 0.7, "{:?}", found.gain);
}
