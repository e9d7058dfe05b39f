//! The velocity against the motion as it was: noise, noise at rest, lag.

use super::{Kind, Log, LogFinding};
use crate::number::figure;

/// Noise at rest below this share of the 95th percentile of speed does a bristle no harm.
const AT_REST: f64 = 5e-4;

/// Noise in motion below this share is as good as none.
const IN_MOTION: f64 = 5e-3;

/// Rows at rest it takes to speak of rest.
const FEWEST: usize = 20;

pub fn noise(log: &Log) -> Vec<LogFinding> {
    let sensors = &log.sensors;
    if sensors.exact || sensors.speed <= 0.0 {
        return Vec::new();
    }
    let rests = sensors.rows_at_rest >= FEWEST;
    let unit = log.data.joint.velocity_unit();
    let corrected = log.correct.motion && !sensors.steady;
    let from = (log.column(log.position()).is_some() && !sensors.from_velocity_alone)
        .then_some(sensors.from_position_alone);
    let done = match (corrected, from) {
        (false, _) if sensors.steady => {
            "it is taken as logged, as the joint neither rests nor turns and no position tells it from motion"
        }
        (false, _) => "it is taken as logged, as asked",
        (true, Some(true)) => "the motion is reconstructed from the position alone",
        (true, Some(false)) => "the motion is reconstructed from position and velocity together",
        (true, None) => {
            "the motion is reconstructed from the velocity alone, as no position of its own is logged, and stays \
             less certain"
        }
    };
    let (value, words) = if rests && sensors.noise_at_rest > AT_REST * sensors.speed {
        let size = figure(sensors.noise_at_rest);
        (
            sensors.noise_at_rest,
            format!("Where the joint rests the velocity flickers by {size} {unit}: {done}."),
        )
    } else if !sensors.from_position_alone && sensors.velocity_noise > IN_MOTION * sensors.speed {
        let size = figure(sensors.velocity_noise);
        (sensors.velocity_noise, format!("The velocity has a noise of {size} {unit}: {done}."))
    } else {
        return Vec::new();
    };
    vec![LogFinding {
        kind: Kind::VelocityNoise,
        columns: vec![log.velocity().into()],
        value,
        unit: unit.into(),
        corrected,
        in_words: words,
    }]
}

pub fn lag(log: &Log) -> Vec<LogFinding> {
    let Some(agreement) = log.sensors.agreement.filter(|agreement| agreement.lags()) else {
        return Vec::new();
    };
    let sensors = &log.sensors;
    // A velocity that is the position's difference is late by half a row, and nobody logged it.
    let sources = &log.data.sources;
    if !sources.is_empty() && sources.iter().all(|source| source.name != log.velocity()) {
        return Vec::new();
    }
    // A position that was integrated is late or early by how the sum was made.
    if sensors.from_velocity_alone && !agreement.is_merely_late() {
        return Vec::new();
    }
    let lag_s = agreement.lag_rows * log.sensors.step_s;
    let moved = sensors.velocity_late_s().is_some();
    let corrected = log.correct.motion && (sensors.from_position_alone || moved);
    let done = if corrected && moved {
        "the velocity is clean and taken to share the torque's clock, and the position is moved to it"
    } else if corrected {
        "the motion is reconstructed from the position alone"
    } else {
        "it is taken as logged"
    };
    let late = if lag_s > 0.0 { "late" } else { "early" };
    vec![LogFinding {
        kind: Kind::VelocityLag,
        columns: vec![log.velocity().into(), log.position().into()],
        value: lag_s,
        unit: "s".into(),
        corrected,
        in_words: format!(
            "The velocity is {} ms ({} rows) {late} against the derivative of the position: {done}.",
            figure(1e3 * lag_s.abs()),
            figure(agreement.lag_rows.abs())
        ),
    }]
}
