//! Columns whose unit may differ from the unit in their name.
//!
//! If there is a position, its derivative must be the velocity: a factor of 9.55 indicates revolutions per minute, 57.3
//! degrees, and 1000 millimetres or milliseconds. Without a position, only values that no machine reaches are reported.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::number::figure;
use compensator_core::quantity::{JointKind, Quantity};

/// Probable causes of a ratio between the velocity and the derivative of the position.
const KNOWN_GAINS: [(f64, &str); 8] = [
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

/// Maximum relative difference to a gain of the table.
const MAX_GAIN_DIFFERENCE: f64 = 0.03;

/// Minimum difference of a gain from 1 that is reported.
const MIN_GAIN_ERROR: f64 = 0.05;

/// Plausible rates of a log of friction, Hz. Slow logs of steady speeds have about 4 Hz.
const PLAUSIBLE_RATES_HZ: (f64, f64) = (2.5, 2e5);

/// Probable true rates of a log whose clock has another unit, Hz.
const PROBABLE_RATES_HZ: (f64, f64) = (10.0, 1e5);

/// Units of time that a clock may have, as (units per second, name).
const CLOCK_UNITS: [(f64, &str); 3] = [(1e3, "ms"), (1e6, "us"), (1e9, "ns")];

/// Maximum plausible speed of a joint: rad/s (10,500 rpm) and m/s.
const MAX_SPEEDS: [f64; 2] = [1.1e3, 30.0];

/// Minimum plausible maximum of a pressure difference, Pa: 0.1 m of water, which does not deform a seal.
const MIN_PRESSURE_PA: f64 = 1e3;

/// Maximum plausible temperature, °C. Seals burn above it.
const MAX_TEMPERATURE_C: f64 = 200.0;

pub fn units(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    found.extend(velocity_gain(log));
    found.extend(clock_rate(log));
    found.extend(speed_limit(log));
    found.extend(covariate_limits(log));
    found
}

fn finding(columns: &[&str], value: f64, unit: &str, in_words: String) -> LogFinding {
    LogFinding {
        kind: LogFindingKind::UnitSuspect,
        columns: columns.iter().map(|name| (*name).to_owned()).collect(),
        value,
        unit: unit.into(),
        corrected: false,
        in_words,
    }
}

/// Compares the velocity with the derivative of the position.
fn velocity_gain(log: &Log) -> Option<LogFinding> {
    let gain = log.sensors.agreement.filter(|agreement| agreement.is_clear())?.gain;
    let is_near = |of: f64| (gain.abs() / of - 1.0).abs() < MAX_GAIN_DIFFERENCE;
    let known = KNOWN_GAINS.iter().find(|(of, _)| is_near(*of));
    let cause = match known {
        _ if gain < 0.0 => "one of them has the other sign",
        Some((_, cause)) => cause,
        None if (gain - 1.0).abs() > MIN_GAIN_ERROR => "one of them has another scale",
        None => return None,
    };
    let factor = figure(gain);
    let words = format!(
        "The velocity is {factor} times the derivative of the position: {cause}. Nothing is changed."
    );
    Some(finding(&[log.velocity(), log.position()], gain, "times dq/dt", words))
}

/// Compares the rate of the log with plausible rates.
fn clock_rate(log: &Log) -> Option<LogFinding> {
    let rate = 1.0 / log.sensors.step_s;
    let is_plausible = (PLAUSIBLE_RATES_HZ.0..PLAUSIBLE_RATES_HZ.1).contains(&rate);
    let has_rate = log.sensors.step_s > 0.0;
    if !has_rate || is_plausible {
        return None;
    }
    let is_probable = |(part, _): &&(f64, &str)| {
        (PROBABLE_RATES_HZ.0..PROBABLE_RATES_HZ.1).contains(&(rate * part))
    };
    let hint = match CLOCK_UNITS.iter().find(is_probable) {
        Some((_, unit)) => format!("may be in {unit} (--columns time_s=NAME:{unit})"),
        None => "may not be in seconds".into(),
    };
    let rate_in_words = figure(rate);
    let words = format!(
        "By its stamps the log has {rate_in_words} rows a second: the time {hint}. Nothing is changed."
    );
    Some(finding(&["time_s"], rate, "Hz", words))
}

/// Compares the speed with the maximum plausible one.
fn speed_limit(log: &Log) -> Option<LogFinding> {
    let (velocity, unit) = (log.velocity(), log.data.joint.velocity_unit());
    let (fastest, other) = match log.data.joint {
        JointKind::Revolute => (MAX_SPEEDS[0], "rpm"),
        JointKind::Prismatic => (MAX_SPEEDS[1], "mm/s"),
    };
    let speed = log.sensors.speed;
    if speed.is_nan() || speed <= fastest {
        return None;
    }
    let words = format!(
        "The velocity reaches {} {unit} by its column's unit, which no joint does: it may be in {other} \
         (--columns {velocity}=NAME:{other}). Nothing is changed.",
        figure(speed)
    );
    Some(finding(&[velocity], speed, unit, words))
}

/// Compares pressures and temperatures with plausible values.
fn covariate_limits(log: &Log) -> Vec<LogFinding> {
    let check = |column: &super::column::Column| {
        let largest = column.values().map(f64::abs).fold(0.0, f64::max);
        let (name, figure) = (&column.name, figure(largest));
        match column.quantity {
            Some(Quantity::Pressure) if largest > 0.0 && largest < MIN_PRESSURE_PA => {
                let words = format!(
                    "{name} never exceeds {figure} Pa: it may be in bar or MPa (--columns {name}=NAME:bar). Nothing is \
                     changed."
                );
                Some(finding(&[name], largest, "Pa", words))
            }
            Some(Quantity::Temperature) if largest > MAX_TEMPERATURE_C => {
                let words = format!(
                    "{name} reaches {figure} °C: it may be in kelvin (--columns {name}=NAME:K). Nothing is changed."
                );
                Some(finding(&[name], largest, "°C", words))
            }
            _ => None,
        }
    };
    log.columns.iter().filter_map(check).collect()
}
