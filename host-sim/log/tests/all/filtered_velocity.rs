//! A velocity behind a low-pass is reported with its time constant on every joint, rate and encoder.

use joint_log::Dataset;
use joint_log::log_check::{Corrections, LogFinding, LogFindingKind, check};
use std::f64::consts::TAU;

/// A joint and how it is logged.
#[derive(Clone, Copy, Debug)]
struct Joint {
    step_s: f64,
    /// Frequency of its motion, Hz.
    motion_hz: f64,
    /// Step of its encoder, rad; 0 for an exact position.
    encoder_rad: f64,
    /// Time constant of the velocity's filter, s; 0 for none.
    filter_s: f64,
    /// Delay of the velocity, s.
    delay_s: f64,
}

/// Steps between two rows for the filter.
const STEPS: usize = 20;

fn findings(joint: Joint) -> Vec<LogFinding> {
    let Joint { step_s, motion_hz, encoder_rad, filter_s, delay_s } = joint;
    let angle =
        |t: f64| (TAU * motion_hz * t).sin() + 0.5 * (TAU * 2.3 * motion_hz * t + 1.0).sin();
    let speed = |t: f64| {
        let slow = TAU * motion_hz;
        let fast = 2.3 * slow;
        slow * (slow * t).cos() + 0.5 * fast * (fast * t + 1.0).cos()
    };
    let fine = step_s / STEPS as f64;
    let kept = if filter_s > 0.0 { (-fine / filter_s).exp() } else { 0.0 };
    let mut columns: [Vec<f64>; 4] = Default::default();
    let mut filtered = speed(0.0);
    for row in 0..3000 {
        let time = step_s * f64::from(row);
        for step in (0..STEPS).rev() {
            let now = speed(time - delay_s - fine * step as f64);
            filtered = now + kept * (filtered - now);
        }
        let position = match encoder_rad > 0.0 {
            true => (angle(time) / encoder_rad).round() * encoder_rad,
            false => angle(time),
        };
        let torque =
            speed(time).signum() + 0.1 * speed(time) + 0.01 * f64::from(row * 7919 % 101) / 101.0;
        let values = [time, filtered, torque, position];
        columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
    }
    let names = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"].map(str::to_owned);
    let run = ("a".to_owned(), columns.to_vec());
    let data = Dataset::from_columns(&names, [run]).expect("columns");
    check(data, Corrections::default()).findings
}

/// Joints of several rates, motions and encoders.
fn joints() -> impl Iterator<Item = Joint> {
    [0.001, 0.01].into_iter().flat_map(|step_s| {
        [0.3, 1.0].into_iter().flat_map(move |motion_hz| {
            [0.0, 2e-3].map(|encoder_rad| Joint {
                step_s,
                motion_hz,
                encoder_rad,
                filter_s: 0.0,
                delay_s: 0.0,
            })
        })
    })
}

#[test]
fn check_with_filtered_velocity_reports_its_time_constant() {
    for joint in joints() {
        for filter_s in [0.05, 0.2] {
            let joint = Joint { filter_s, ..joint };
            let found = findings(joint);
            let lag: Vec<&LogFinding> = found
                .iter()
                .filter(|finding| finding.kind == LogFindingKind::VelocityLag)
                .collect();
            assert_eq!(lag.len(), 1, "{joint:?}: {found:?}");
            assert!((lag[0].value / filter_s - 1.0).abs() < 0.1, "{joint:?}: {found:?}");
            assert!(
                lag[0].in_words.contains("low-pass") && lag[0].corrected,
                "{joint:?}: {found:?}"
            );
            assert!(
                found.iter().all(|finding| finding.kind != LogFindingKind::VelocityNoise),
                "{joint:?}: {found:?}"
            );
        }
    }
}

#[test]
fn check_with_late_or_exact_velocity_reports_no_low_pass() {
    for joint in joints() {
        for delay_s in [0.0, 0.5 * joint.step_s, 5.0 * joint.step_s] {
            let found = findings(Joint { delay_s, ..joint });
            assert!(
                found.iter().all(|finding| !finding.in_words.contains("low-pass")),
                "{joint:?}: {found:?}"
            );
        }
    }
}
