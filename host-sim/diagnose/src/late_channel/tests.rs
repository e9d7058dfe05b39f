//! Late channels of logs with bristles: a filtered torque, a late velocity, a delay, and none.

use super::*;
use crate::fixtures::{HandMadeLog, PERIOD_S, base, bristle_torque, linear_torque};
use compensator_core::LawKind;

/// Returns the late channel beside a law.
fn found_beside(law: LawKind, log: &HandMadeLog) -> Option<LateChannel> {
    let log = log.train_test();
    found(&log, &base(&log, law).model, &LateChannelKind::ALL).expect("few terms")
}

#[test]
fn found_with_filtered_torque_returns_low_pass_of_its_time() {
    let time_s = 4.0 * PERIOD_S;
    let log = HandMadeLog::new(bristle_torque).with_filtered_torque(time_s);
    let late = found_beside(LawKind::Dahl, &log).expect("a low-pass");
    assert_eq!(late.late, LateChannelKind::LowPassedTorque);
    assert!((late.time_s / time_s - 1.0).abs() < 0.2, "{late:?}");
    assert!(late.share_left < 0.5, "{late:?}");
}

#[test]
fn found_with_late_velocity_returns_its_delay() {
    let log = HandMadeLog::new(bristle_torque).with_delayed_velocity(3);
    let late = found_beside(LawKind::Dahl, &log).expect("a late velocity");
    assert_eq!(late.late, LateChannelKind::Velocity);
    assert!((late.time_s / (3.0 * PERIOD_S) - 1.0).abs() < 0.2, "{late:?}");
}

#[test]
fn found_without_late_channel_returns_none() {
    assert_eq!(found_beside(LawKind::Dahl, &HandMadeLog::new(bristle_torque)), None);
}

#[test]
fn found_with_delayed_torque_returns_no_low_pass() {
    let log = HandMadeLog::new(bristle_torque).with_delayed_torque(4);
    assert_eq!(found_beside(LawKind::Dahl, &log), None);
}

#[test]
fn found_beside_law_without_bristles_returns_none() {
    let log = HandMadeLog::new(linear_torque).with_filtered_torque(4.0 * PERIOD_S);
    assert_eq!(found_beside(LawKind::Linear, &log), None);
}

#[test]
fn lag_compensated_log_has_no_second_late_channel() {
    let log = HandMadeLog::new(bristle_torque).with_delayed_velocity(3).train_test();
    let found = |log: &TrainTest| {
        let base = base(log, LawKind::Dahl).model;
        found(log, &base, &LateChannelKind::ALL).expect("few terms")
    };
    let late = found(&log).expect("a late velocity");
    assert_eq!(found(&late.lag_compensated(log)), None);
}
