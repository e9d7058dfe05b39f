//! Comparison of the logged velocity with the reconstructed motion: noise, noise at rest, and lag.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::wrap::is_velocity_derived;
use crate::motion::Agreement;
use crate::number::figure;
use std::f64::consts::TAU;

/// Maximum negligible noise at rest, as a share of the 95th percentile of speed. It does not disturb a bristle.
const MAX_REST_NOISE: f64 = 5e-4;

/// Maximum negligible noise in motion, as a share of the 95th percentile of speed.
const MAX_MOTION_NOISE: f64 = 5e-3;

/// Minimum number of rows at rest for an estimate of the noise at rest.
const MIN_REST_ROWS: usize = 20;

pub fn noise(log: &Log) -> Vec<LogFinding> {
    let sensors = &log.sensors;
    let is_filtered = sensors.agreement.is_some_and(|found| found.low_pass_rows.is_some());
    // The error of a filtered velocity is its lag, at rest too.
    if sensors.exact || sensors.speed <= 0.0 || is_filtered {
        return Vec::new();
    }
    let rests = sensors.rows_at_rest >= MIN_REST_ROWS;
    let unit = log.data.joint.velocity_unit();
    let corrected = log.correct.motion && !sensors.steady;
    let from = (log.column(log.position()).is_some() && !sensors.from_velocity_alone)
        .then_some(sensors.from_position_alone);
    let done = match (corrected, from) {
        (false, _) if sensors.steady => {
            "it is used as logged: the joint neither rests nor reverses, and without a position noise and motion \
             cannot be separated"
        }
        (false, _) => "it is taken as logged, as asked",
        (true, Some(true)) => "the motion is reconstructed from the position alone",
        (true, Some(false)) => "the motion is reconstructed from position and velocity together",
        (true, None) => {
            "the motion is reconstructed from the velocity alone, as no position of its own is logged, and stays \
             less certain"
        }
    };
    let (value, words) = if rests && sensors.noise_at_rest > MAX_REST_NOISE * sensors.speed {
        let size = figure(sensors.noise_at_rest);
        (
            sensors.noise_at_rest,
            format!("Where the joint rests the velocity has a noise of {size} {unit}: {done}."),
        )
    } else if !sensors.from_position_alone
        && sensors.velocity_noise > MAX_MOTION_NOISE * sensors.speed
    {
        let size = figure(sensors.velocity_noise);
        (sensors.velocity_noise, format!("The velocity has a noise of {size} {unit}: {done}."))
    } else if let Some(found) = log.sensors.agreement.filter(|found| is_replaced(log, found)) {
        let size = found.scatter / sensors.step_s;
        let words = format!(
            "The velocity contradicts the position: it is {} {unit} RMS from the derivative, which neither noise nor a short \
             delay explains: {done}.",
            figure(size)
        );
        (size, words)
    } else {
        return Vec::new();
    };
    vec![
        LogFindingKind::VelocityNoise
            .finding(&[log.velocity()], value, unit, words)
            .corrected(corrected),
    ]
}

/// Returns true if the velocity is replaced by the derivative of the position, and [`lag`] does not say why.
fn is_replaced(log: &Log, found: &Agreement) -> bool {
    log.sensors.from_position_alone && !found.lags() && found.low_pass_rows.is_none()
}

pub fn lag(log: &Log) -> Vec<LogFinding> {
    let is_late = |found: &Agreement| found.lags() || found.low_pass_rows.is_some();
    let Some(agreement) = log.sensors.agreement.filter(is_late) else { return Vec::new() };
    let sensors = &log.sensors;
    // A velocity that was derived from the position is late by half a row, but it was not logged.
    if is_velocity_derived(log.data) {
        return Vec::new();
    }
    // The lag of an integrated position depends on the method of integration.
    if sensors.from_velocity_alone && !agreement.is_pure_delay() {
        return Vec::new();
    }
    let lag_rows = agreement.low_pass_rows.unwrap_or(agreement.lag_rows);
    let lag_s = lag_rows * log.sensors.step_s;
    let moved = sensors.velocity_late_s().is_some();
    let corrected = log.correct.motion && (sensors.from_position_alone || moved);
    let done = if corrected && moved {
        "the velocity is clean and assumed to share the torque's clock, and the position is shifted to it"
    } else if corrected {
        "the motion is reconstructed from the position alone"
    } else {
        "it is taken as logged"
    };
    let how = match agreement.low_pass_rows {
        Some(_) => format!(
            "The velocity is the derivative of the position behind a low-pass with a time constant of {} ms ({} Hz)",
            figure(1e3 * lag_s),
            figure(1.0 / (TAU * lag_s))
        ),
        None => format!(
            "The velocity is {} ms ({} rows) {} against the derivative of the position",
            figure(1e3 * lag_s.abs()),
            figure(lag_rows.abs()),
            if lag_s > 0.0 { "late" } else { "early" }
        ),
    };
    let words = format!("{how}: {done}.");
    vec![
        LogFindingKind::VelocityLag
            .finding(&[log.velocity(), log.position()], lag_s, "s", words)
            .corrected(corrected),
    ]
}
