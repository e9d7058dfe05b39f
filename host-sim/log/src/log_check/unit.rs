//! Columns whose unit may differ from the unit in their name.
//!
//! If there is a position, its derivative must be the velocity: a factor of 9.55 indicates revolutions per minute, 57.3
//! degrees, and 1000 millimetres or milliseconds. Without a position, only values that no machine reaches are reported.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::{rate, typed};
use crate::number::figure;
use crate::unit::conversion;
use compensator_core::quantity::{JointKind, Quantity};

/// A unit with the number in the column for one unit of the contract.
type SizedUnit = (&'static str, f64);

/// Probable units of the velocity, of a revolute and a prismatic joint.
const VELOCITY_UNITS: [&[&str]; 2] = [
    &["rad/s", "rpm", "deg/s", "rps", "mrad/s"],
    &["m/s", "mm/s", "cm/s", "m/min", "mm/min", "in/s"],
];

/// Probable units of the position.
const POSITION_UNITS: [&[&str]; 2] =
    [&["rad", "deg", "rev", "mrad"], &["m", "mm", "cm", "um", "inch"]];

/// Returns the probable units of the velocity with their sizes.
pub fn velocity_units(joint: JointKind) -> Vec<SizedUnit> {
    sized(Quantity::Velocity, joint, &VELOCITY_UNITS)
}

fn sized(of: Quantity, joint: JointKind, units: &[&'static [&'static str]; 2]) -> Vec<SizedUnit> {
    let size =
        |unit: &&'static str| Some((*unit, conversion(of.name(joint), unit).ok()?.inverse(1.0)));
    units[joint as usize].iter().filter_map(size).collect()
}

/// Maximum relative difference to a gain of the table.
const MAX_GAIN_DIFFERENCE: f64 = 0.03;

/// Minimum difference of a gain from 1 that is reported.
const MIN_GAIN_ERROR: f64 = 0.05;

/// Maximum plausible speed of a joint: rad/s (10,500 rpm) and m/s.
const MAX_SPEEDS: [f64; 2] = [1.1e3, 30.0];

/// Minimum plausible maximum of a pressure difference, Pa: 0.1 m of water, which does not deform a seal.
const MIN_PRESSURE_PA: f64 = 1e3;

/// Maximum plausible temperature, °C. Seals burn above it.
const MAX_TEMPERATURE_C: f64 = 200.0;

pub fn units(log: &Log) -> Vec<LogFinding> {
    let mut found = Vec::new();
    found.extend(velocity_gain(log));
    found.extend(rate::implausible(log));
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
    let cause = match probable_cause(log, gain) {
        _ if gain < 0.0 => {
            let unit = log.data.joint.velocity_unit();
            let pair = typed(log.data, log.velocity(), &format!("-{unit}"));
            format!("one of them has the other sign (--columns {pair} turns the velocity)")
        }
        Some(cause) => cause,
        None if (gain - 1.0).abs() > MIN_GAIN_ERROR => "one of them has another scale".into(),
        None => return None,
    };
    let factor = figure(gain);
    let words = format!(
        "The velocity is {factor} times the derivative of the position: {cause}. Nothing is changed."
    );
    Some(finding(&[log.velocity(), log.position()], gain, "times dq/dt", words))
}

/// Returns the units that explain a gain, with the option to type: of one column if possible, else of both.
fn probable_cause(log: &Log, gain: f64) -> Option<String> {
    let is_near = |of: f64| (gain / of - 1.0).abs() < MAX_GAIN_DIFFERENCE;
    if is_near(1.0) {
        return None;
    }
    let joint = log.data.joint;
    let velocities = relative(&velocity_units(joint), given_unit(log, log.velocity()));
    let positions = sized(Quantity::Position, joint, &POSITION_UNITS);
    let positions = relative(&positions, given_unit(log, log.position()));
    let option = |name: &str, unit: &str| typed(log.data, name, unit);
    let mut causes = Vec::new();
    for (unit, _) in velocities.iter().filter(|(_, size)| is_near(*size)) {
        let pair = option(log.velocity(), unit);
        causes.push(format!("the velocity may be in {unit} (--columns {pair})"));
    }
    for (unit, _) in positions.iter().filter(|(_, size)| is_near(1.0 / size)) {
        let pair = option(log.position(), unit);
        causes.push(format!("the position may be in {unit} (--columns {pair})"));
    }
    if is_near(1e3) {
        let pair = option("time_s", "ms");
        causes.push(format!("the time may be in ms (--columns {pair})"));
    }
    if causes.is_empty() {
        let pairs = velocities.iter().flat_map(|v| positions.iter().map(move |q| (v, q)));
        let (velocity, position) = pairs.into_iter().find(|(v, q)| is_near(v.1 / q.1))?;
        let both = [option(log.velocity(), velocity.0), option(log.position(), position.0)];
        causes.push(format!(
            "the velocity may be in {} and the position in {} (--columns {})",
            velocity.0,
            position.0,
            both.join(",")
        ));
    }
    Some(causes.join(", or "))
}

/// Returns the unit that `--columns` gives for a column.
fn given_unit<'a>(log: &'a Log, name: &str) -> Option<&'a str> {
    let source = log.data.sources.iter().find(|source| source.name == name);
    source.and_then(|source| source.unit.as_deref())
}

/// Returns the other units of a column with their sizes relative to the given one; none if that is not in the table.
fn relative(units: &[SizedUnit], given: Option<&str>) -> Vec<SizedUnit> {
    let given = given.map_or(Some(1.0), |given| {
        units.iter().find(|(unit, _)| *unit == given).map(|(_, size)| *size)
    });
    let Some(given) = given else { return Vec::new() };
    let sizes = units.iter().map(|(unit, size)| (*unit, size / given));
    sizes.filter(|(_, size)| *size != 1.0).collect()
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
         (--columns {}). Nothing is changed.",
        figure(speed),
        typed(log.data, velocity, other)
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
                let pair = typed(log.data, name, "bar");
                let words = format!(
                    "{name} never exceeds {figure} Pa: it may be in bar or MPa (--columns {pair}). Nothing is changed."
                );
                Some(finding(&[name], largest, "Pa", words))
            }
            Some(Quantity::Temperature) if largest > MAX_TEMPERATURE_C => {
                let pair = typed(log.data, name, "K");
                let words = format!(
                    "{name} reaches {figure} °C: it may be in kelvin (--columns {pair}). Nothing is changed."
                );
                Some(finding(&[name], largest, "°C", words))
            }
            _ => None,
        }
    };
    log.columns.iter().filter_map(check).collect()
}
