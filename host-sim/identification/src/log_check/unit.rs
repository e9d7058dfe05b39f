//! Columns that may be in other units than their names say.
//!
//! Where there is a position, its derivative over time must be the velocity: a factor of 9.55 is revolutions per
//! minute, 57.3 degrees, 1000 a millimetre or a millisecond. Without one, only what no machine does is told.

use super::{Kind, Log, LogFinding};
use crate::number::figure;

/// What a velocity over the derivative of its position says.
const GAINS: [(f64, &str); 8] = [
    (60.0 / std::f64::consts::TAU, "the velocity may be in rpm"),
    (
        std::f64::consts::TAU / 60.0,
        "the position may be in rpm times seconds, or the velocity divided twice",
    ),
    (
        180.0 / std::f64::consts::PI,
        "the velocity may be in degrees/s, or the position not in degrees",
    ),
    (std::f64::consts::PI / 180.0, "the position may be in degrees"),
    (1e3, "the velocity may be in mm/s, or the time in ms"),
    (1e-3, "the position may be in mm, or the time not in s"),
    (1.0 / std::f64::consts::TAU, "the velocity may be in turns/s, or the position not in turns"),
    (std::f64::consts::TAU, "the position may be in turns"),
];

/// A gain this near to one of the table is it; as far from 1 it is another's.
const NEAR: f64 = 0.03;

/// A gain off by more than this is told, whatever it is.
const OFF: f64 = 0.05;

/// Rates at which no one logs a joint, Hz: a clock in other units.
const RATES_HZ: (f64, f64) = (0.02, 2e5);

/// Speeds no joint has, rad/s or m/s.
const FASTEST: f64 = 1e5;

pub fn units(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    let sensors = &log.sensors;
    let mut tell = |columns: &[&str], value: f64, unit: &str, in_words: String| {
        found.push(LogFinding {
            kind: Kind::UnitSuspect,
            columns: columns.iter().map(|name| (*name).to_owned()).collect(),
            value,
            unit: unit.into(),
            corrected: false,
            in_words,
        });
    };
    if let Some(agreement) = sensors.agreement.filter(|agreement| agreement.is_clear()) {
        let gain = agreement.gain;
        let reading = GAINS.iter().find(|(of, _)| (gain.abs() / of - 1.0).abs() < NEAR);
        let columns = [log.velocity(), log.position()];
        let factor = figure(gain);
        if gain < 0.0 {
            let words = format!(
                "The velocity is {factor} times the derivative of the position: one of them has the other sign. \
                 Nothing is changed."
            );
            tell(&columns, gain, "times dq/dt", words);
        } else if let Some((_, reading)) = reading {
            let words = format!(
                "The velocity is {factor} times the derivative of the position: {reading}. Nothing is changed."
            );
            tell(&columns, gain, "times dq/dt", words);
        } else if (gain - 1.0).abs() > OFF {
            let words = format!(
                "The velocity is {factor} times the derivative of the position: one of them has another scale. \
                 Nothing is changed."
            );
            tell(&columns, gain, "times dq/dt", words);
        }
    }
    let rate = 1.0 / sensors.step_s;
    if sensors.step_s > 0.0 && !(RATES_HZ.0..RATES_HZ.1).contains(&rate) {
        let words = format!(
            "By its stamps the log has {} rows a second: the time may not be in seconds. Nothing is changed.",
            figure(rate)
        );
        tell(&["time_s"], rate, "Hz", words);
    }
    if sensors.speed > FASTEST {
        let words = format!(
            "The velocity reaches {} by its column's unit, which no joint does. Nothing is changed.",
            figure(sensors.speed)
        );
        tell(&[log.velocity()], sensors.speed, log.data.joint.velocity_unit(), words);
    }
    found
}
