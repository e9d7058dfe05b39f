//! Columns that may be in other units than their names say.
//!
//! Where there is a position, its derivative over time must be the velocity: a factor of 9.55 is revolutions per
//! minute, 57.3 degrees, 1000 a millimetre or a millisecond. Without one, only what no machine does is told.

use super::{Kind, Log, LogFinding};
use crate::number::figure;
use compensator_core::quantity::{JointKind, Quantity};

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

/// Rates at which no one logs friction, Hz: a clock in other units. The slowest of the measured logs at hand, steady
/// speeds of a worm drive, has 4 Hz.
const RATES_HZ: (f64, f64) = (2.5, 2e5);

/// Rates that a clock in other units is likely to have in truth, Hz.
const LIKELY_HZ: (f64, f64) = (10.0, 1e5);

/// Units of time a clock may be in, as parts of a second.
const CLOCKS: [(f64, &str); 3] = [(1e3, "ms"), (1e6, "us"), (1e9, "ns")];

/// Speeds no joint has, rad/s (10,500 rpm) and m/s.
const FASTEST: [f64; 2] = [1.1e3, 30.0];

/// A pressure difference that never exceeds this, Pa, is a hand's breadth of water, which bends no seal.
const LEAST_PRESSURE: f64 = 1e3;

/// Seals burn above, °C.
const HOTTEST: f64 = 200.0;

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
        let likely = |(part, _): &&(f64, &str)| (LIKELY_HZ.0..LIKELY_HZ.1).contains(&(rate * part));
        let hint = match CLOCKS.iter().find(likely) {
            Some((_, unit)) => format!("may be in {unit} (--columns time_s=NAME:{unit})"),
            None => "may not be in seconds".into(),
        };
        let rate_in_words = figure(rate);
        let words = format!(
            "By its stamps the log has {rate_in_words} rows a second: the time {hint}. Nothing is changed."
        );
        tell(&["time_s"], rate, "Hz", words);
    }
    let (velocity, unit) = (log.velocity(), log.data.joint.velocity_unit());
    let (fastest, other) = match log.data.joint {
        JointKind::Revolute => (FASTEST[0], "rpm"),
        JointKind::Prismatic => (FASTEST[1], "mm/s"),
    };
    if sensors.speed > fastest {
        let speed = figure(sensors.speed);
        let words = format!(
            "The velocity reaches {speed} {unit} by its column's unit, which no joint does: it may be in {other} \
             (--columns {velocity}=NAME:{other}). Nothing is changed."
        );
        tell(&[velocity], sensors.speed, unit, words);
    }
    for column in &log.columns {
        let largest = column.values().map(f64::abs).fold(0.0, f64::max);
        let (name, figure) = (&column.name, figure(largest));
        match column.quantity {
            Some(Quantity::Pressure) if largest > 0.0 && largest < LEAST_PRESSURE => {
                let words = format!(
                    "{name} never exceeds {figure} Pa: it may be in bar or MPa (--columns {name}=NAME:bar). Nothing is \
                     changed."
                );
                tell(&[name], largest, "Pa", words);
            }
            Some(Quantity::Temperature) if largest > HOTTEST => {
                let words = format!(
                    "{name} reaches {figure} °C: it may be in kelvin (--columns {name}=NAME:K). Nothing is changed."
                );
                tell(&[name], largest, "°C", words);
            }
            _ => {}
        }
    }
    found
}
