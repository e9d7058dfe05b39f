//! Columns whose unit may differ from the unit in their name.
//!
//! If there is a position, its derivative must be the velocity: a factor of 9.55 indicates revolutions per minute, 57.3
//! degrees, and 1000 millimetres or milliseconds. Without a position, only values that no machine reaches are reported.
//!
//! Where a known unit explains the contradiction, the log is refused ([`suspicion`]) until the unit is given, or confirmed.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use super::position_jump;
use super::suspicion::Suspicion;
use super::{header, rate, typed};
use crate::number::figure;
use crate::setting::shell_word;
use crate::torque_fit::{ACCELERATION, fit, moving_rows};
use crate::unit::{SizedUnit, conversion, sized};
use compensator_core::quantity::{JointKind, Quantity};

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
    sized(Quantity::Velocity.name(joint), VELOCITY_UNITS[joint as usize])
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
    found.extend(inertia_limit(log));
    found
}

fn finding(columns: &[&str], value: f64, unit: &str, in_words: String) -> LogFinding {
    LogFindingKind::UnitSuspect.finding(columns, value, unit, in_words)
}

/// Compares the velocity with the derivative of the position.
fn velocity_gain(log: &Log) -> Option<LogFinding> {
    let gain = clear_gain(log)?;
    let causes = probable_causes(log, gain);
    let cause = if gain < 0.0 {
        let unit = log.data.joint.velocity_unit();
        let pair = typed(log.data, log.velocity(), &format!("-{unit}"));
        format!("one of them has the other sign (--columns {pair} turns the velocity)")
    } else if !causes.is_empty() {
        let words =
            |cause: &UnitCause| format!("{} (--columns {})", cause.in_words, cause.typed(log));
        causes.iter().map(words).collect::<Vec<_>>().join(", or ")
    } else if (gain - 1.0).abs() > MIN_GAIN_ERROR {
        "one of them has another scale".into()
    } else {
        return None;
    };
    let factor = figure(gain);
    let words = format!(
        "The velocity is {factor} times the derivative of the position: {cause}. Nothing is changed."
    );
    Some(finding(&[log.velocity(), log.position()], gain, "times dq/dt", words))
}

/// Returns the ratio of the velocity and the derivative of the position, if both are of one motion.
fn clear_gain(log: &Log) -> Option<f64> {
    log.sensors.agreement.filter(|agreement| agreement.is_clear()).map(|found| found.gain)
}

/// Units that explain a ratio.
struct UnitCause {
    in_words: String,
    /// Columns with their units.
    columns: Vec<(&'static str, String)>,
}

impl UnitCause {
    fn one(what: &str, name: &'static str, unit: &str) -> Self {
        Self { in_words: format!("{what} may be in {unit}"), columns: vec![(name, unit.into())] }
    }

    /// Returns the pairs of `--columns`, as a shell takes them.
    fn typed(&self, log: &Log) -> String {
        shell_word(&self.pairs(log))
    }

    /// Returns the pairs of `--columns`.
    fn pairs(&self, log: &Log) -> String {
        let pair =
            |(name, unit): &(&str, String)| format!("{name}={}:{unit}", header(log.data, name));
        self.columns.iter().map(pair).collect::<Vec<_>>().join(",")
    }
}

/// Returns the units that explain a ratio of velocity and derivative: of one column if possible, else of both.
fn probable_causes(log: &Log, gain: f64) -> Vec<UnitCause> {
    let is_near = |of: f64| (gain / of - 1.0).abs() < MAX_GAIN_DIFFERENCE;
    if is_near(1.0) {
        return Vec::new();
    }
    let joint = log.data.joint;
    let velocities = relative(&velocity_units(joint), log.data.given_unit(log.velocity()));
    let positions = sized(log.position(), POSITION_UNITS[joint as usize]);
    let positions = relative(&positions, log.data.given_unit(log.position()));
    let (velocity, position) = (log.velocity(), log.position());
    let mut causes = Vec::new();
    for of in velocities.iter().filter(|of| is_near(of.size)) {
        causes.push(UnitCause::one("the velocity", velocity, of.unit));
    }
    for of in positions.iter().filter(|of| is_near(1.0 / of.size)) {
        causes.push(UnitCause::one("the position", position, of.unit));
    }
    if is_near(1e3) {
        causes.push(UnitCause::one("the time", "time_s", "ms"));
    }
    if causes.is_empty() {
        let mut pairs = velocities.iter().flat_map(|v| positions.iter().map(move |q| (v, q)));
        let both = pairs.find(|(v, q)| is_near(v.size / q.size)).map(|(v, q)| UnitCause {
            in_words: format!("the velocity may be in {} and the position in {}", v.unit, q.unit),
            columns: vec![(velocity, v.unit.into()), (position, q.unit.into())],
        });
        causes.extend(both);
    }
    causes
}

/// Rates of slow logs, Hz: a row each second may be a slow log, or one with 1000 rows a second and a time in ms.
const SLOW_RATES_HZ: std::ops::Range<f64> = 0.2..2.5;

/// Returns the reason to refuse a log whose units are clearly others: parameters in wrong units look like right ones.
pub fn suspicion(log: &Log) -> Option<Suspicion> {
    of_gain(log).or_else(|| of_rate(log)).or_else(|| of_speed(log))
}

fn suspicion_of(columns: &[&str], found: String, pairs: &[String]) -> Suspicion {
    Suspicion::typed(LogFindingKind::UnitSuspect, columns, found, pairs)
}

/// A velocity and a position in different units, or with a gear or a belt between them.
fn of_gain(log: &Log) -> Option<Suspicion> {
    let gain = clear_gain(log).filter(|gain| *gain > 0.0)?;
    let mut causes = probable_causes(log, gain);
    if causes.is_empty() && (gain - 1.0).abs() > MIN_GAIN_ERROR && is_in_most_rows(log, gain) {
        causes = ratio_causes(log, gain);
    }
    if causes.is_empty() {
        return None;
    }
    let in_words: Vec<&str> = causes.iter().map(|cause| cause.in_words.as_str()).collect();
    let pairs: Vec<String> = causes.iter().map(|cause| cause.pairs(log)).collect();
    let found = format!(
        "a velocity that is {} times the derivative of the position: {}",
        figure(gain),
        in_words.join(", or ")
    );
    Some(suspicion_of(&[log.velocity(), log.position()], found, &pairs))
}

/// Returns true if most single rows have a ratio too. Where rows are lost, only the mean of all rows has.
fn is_in_most_rows(log: &Log, gain: f64) -> bool {
    let positions = log.data.columns_of(Quantity::Position);
    let travel = positions.and_then(|positions| position_jump::velocity_gain(log.data, &positions));
    travel.is_some_and(|travel| (travel * gain - 1.0).abs() < MAX_GAIN_DIFFERENCE)
}

/// Returns the units by which a velocity and a position on two sides of a gear are the motion of one side.
fn ratio_causes(log: &Log, gain: f64) -> Vec<UnitCause> {
    let scaled = |name: &'static str, unit: &str, factor: f64, of: &str| {
        let given = log.data.given_unit(name).and_then(|unit| conversion(name, unit).ok());
        let size = given.map_or(1.0, |given| given.apply(1.0) - given.apply(0.0));
        let unit = format!("{}{unit}", rounded(size * factor));
        let in_words =
            format!("with a gear or belt of this ratio between them, {of} may be the motion");
        UnitCause { in_words, columns: vec![(name, unit)] }
    };
    let joint = log.data.joint;
    vec![
        scaled(log.velocity(), joint.velocity_unit(), 1.0 / gain, "the position"),
        scaled(log.position(), joint.position_unit(), gain, "the velocity"),
    ]
}

/// Returns a factor with four digits.
fn rounded(factor: f64) -> f64 {
    format!("{factor:.3e}").parse().unwrap_or(factor)
}

/// Stamps in another unit.
fn of_rate(log: &Log) -> Option<Suspicion> {
    let rate = rate::implausible_rate(log).filter(|rate| !SLOW_RATES_HZ.contains(rate))?;
    let unit = rate::probable_unit(log, rate)?;
    let column = header(log.data, "time_s");
    let found = format!("{} rows a second by the column {column}", figure(rate));
    Some(suspicion_of(&["time_s"], found, &[format!("time_s={column}:{unit}")]))
}

/// A velocity in another unit.
fn of_speed(log: &Log) -> Option<Suspicion> {
    let unit = unit_of_impossible_speed(log)?;
    let (name, unit_of_contract) = (log.velocity(), log.data.joint.velocity_unit());
    let found = format!(
        "{} {unit_of_contract} in {name}, which no joint reaches",
        figure(log.sensors.speed)
    );
    let pair = format!("{name}={}:{unit}", header(log.data, name));
    Some(suspicion_of(&[name], found, &[pair]))
}

/// Returns the other units of a column with their sizes relative to the given one; none if that is not in the table.
fn relative(units: &[SizedUnit], given: Option<&str>) -> Vec<SizedUnit> {
    let given =
        given.map_or(Some(1.0), |given| units.iter().find(|of| of.unit == given).map(|of| of.size));
    let Some(given) = given else { return Vec::new() };
    let others = units.iter().map(|of| SizedUnit { size: of.size / given, ..*of });
    others.filter(|of| of.size != 1.0).collect()
}

/// Returns the unit that a velocity may be in, if by its column's unit no joint reaches its speed.
fn unit_of_impossible_speed(log: &Log) -> Option<&'static str> {
    let joint = log.data.joint;
    (log.sensors.speed > MAX_SPEEDS[joint as usize]).then(|| joint.choose(["rpm", "mm/s"]))
}

/// Compares the speed with the maximum plausible one.
fn speed_limit(log: &Log) -> Option<LogFinding> {
    let (velocity, unit) = (log.velocity(), log.data.joint.velocity_unit());
    let (speed, other) = (log.sensors.speed, unit_of_impossible_speed(log)?);
    let words = format!(
        "The velocity reaches {} {unit} by its column's unit, which no joint does: it may be in {other} \
         (--columns {}). Nothing is changed.",
        figure(speed),
        typed(log.data, velocity, other)
    );
    Some(finding(&[velocity], speed, unit, words))
}

/// Minimum inertia of a joint that is doubtful, kg m²: that of the first axis of a robot of a tonne.
const MIN_DOUBTFUL_INERTIA: f64 = 100.0;

/// Maximum relative standard error of an inertia that is reported.
const MAX_INERTIA_ERROR: f64 = 0.1;

/// Compares the inertia that the torque implies with plausible ones.
fn inertia_limit(log: &Log) -> Option<LogFinding> {
    if log.data.joint != JointKind::Revolute {
        return None;
    }
    let rows = moving_rows(log.smoothed);
    let law = fit(rows.iter().map(|row| (row.regressors, row.torque)))?;
    let (inertia, error) = (law.coefficients[ACCELERATION], law.errors[ACCELERATION]);
    if inertia < MIN_DOUBTFUL_INERTIA || error > MAX_INERTIA_ERROR * inertia {
        return None;
    }
    let torque = log.torque();
    let words = format!(
        "By {torque} and the acceleration the joint has an inertia of {} kg m². If that is too much, the torque may be in mNm \
         (--columns {}). Nothing is changed.",
        figure(inertia),
        typed(log.data, torque, "mNm")
    );
    Some(finding(&[torque], inertia, "kg m²", words))
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
