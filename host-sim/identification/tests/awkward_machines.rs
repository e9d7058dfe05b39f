//! Machines whose logs led the diagnosis astray, drawn anew: what is measured in them, by other equations than the core's.
//!
//! An arm's joint under slow position control rests most of the time, and its torque runs through all that stiction can hold
//! while the encoder stands still. A cylinder's force is the rod's less pressure times a bore's area that is a few
//! percent off: over the pressures of a campaign that is more than the friction, and the pressure on the friction would look
//! a trifle beside it.

use friction_identification::data::{Dataset, SplitRule, split};
use friction_identification::diagnose::{Diagnosis, Question, diagnose};
use friction_identification::log_check::{self, Correct};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

fn asked(names: &[&str], runs: Vec<(String, Vec<Vec<f64>>)>) -> Diagnosis {
    let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
    let data = Dataset::of_columns(&names, runs).expect("columns of a log");
    let checked = log_check::check(data, Correct::default());
    let parts = split(&checked.data, &SplitRule::EachOut, 0).expect("runs to split");
    let question = Question { log_findings: checked.findings, ..Question::default() };
    diagnose(&checked.data, &parts, &question, &|_| {}).expect("an answer")
}

/// Normal numbers, of a standard deviation of one.
fn normal(random: &mut Pcg64) -> f64 {
    (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0
}

/// A joint of 0.25 Nm friction behind an encoder of 14 bits: pushed by a weak controller after a slow reference, it rests until
/// stiction (0.30 Nm) is reached, and moves on for a moment.
fn stick_slip(seed: u64) -> (String, Vec<Vec<f64>>) {
    const STEP_S: f64 = 0.01;
    const ENCODER_RAD: f64 = 3.83e-4;
    let mut random = Pcg64::seed_from_u64(seed);
    let mut columns = vec![Vec::new(); 4];
    let (mut angle, mut velocity) = (0.0f64, 0.0f64);
    let fine = 100;
    for row in 0..3000 {
        let time = row as f64 * STEP_S;
        let wanted = 0.25 * (1.7 * time + seed as f64).sin();
        let mut torque = 0.0;
        for _ in 0..fine {
            torque = 2.0 * (wanted - angle);
            let step_s = STEP_S / f64::from(fine);
            if velocity == 0.0 && torque.abs() < 0.30 {
                continue;
            }
            let direction = if velocity == 0.0 { torque.signum() } else { velocity.signum() };
            let next = velocity + step_s * (torque - 0.25 * direction - 0.05 * velocity) / 0.002;
            // It stops where friction would turn it round.
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
fn a_joint_that_rests_is_judged_by_its_motion() {
    let names = ["time_s", "position_rad", "velocity_rad_s", "torque_nm"];
    let found = asked(&names, (1..=4).map(stick_slip).collect());
    let notes = &found.log.notes;
    assert!(notes.iter().any(|note| note.contains("rows at rest are not judged")), "{notes:?}");
    assert_eq!(found.cause(), "none", "{:?}", found.findings);
    let rmse = found.after.metrics.rmse;
    assert!((0.009..0.03).contains(&rmse), "{rmse} Nm where the noise is 0.01");
}

/// Strokes of a cylinder at one pressure: 8 N of friction and 1 N more per bar, and a bore whose area is 8 % off (4 N per bar).
fn strokes(bar: usize) -> (String, Vec<Vec<f64>>) {
    const STEP_S: f64 = 0.01;
    let mut random = Pcg64::seed_from_u64(bar as u64);
    let mut columns = vec![Vec::new(); 5];
    let mut position = 0.0;
    for row in 0..2400 {
        let time = row as f64 * STEP_S;
        // Ten seconds a stroke, to and fro, the ends rounded.
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
fn friction_is_no_trifle_beside_a_misread_area() {
    let names = ["time_s", "position_m", "velocity_m_s", "force_n", "pressure_diff_pa"];
    let found = asked(&names, [1, 2, 3, 5, 7, 9].map(strokes).into());
    let named: Vec<&str> = found.findings.iter().map(|finding| finding.cause.name()).collect();
    assert_eq!(named.first(), Some(&"pressure-coulomb"), "{named:?}");
    assert!(named.contains(&"unknown"), "the misread area: {named:?}");
    let size = &found.findings[0].size;
    assert!((size.value - 1e-5).abs() < 2e-6, "{size:?}");
    assert!(found.gain.value > 0.7, "{:?}", found.gain);
}
