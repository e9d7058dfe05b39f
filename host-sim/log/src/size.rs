//! Units of columns without a unit, by the sizes of their values. They are suggestions only.
//!
//! The derivative of a position is the velocity, so their ratio shows the units of both: a speed in rpm over an angle in
//! degrees is a sixth of the derivative. The time has a unit by its rate.

use crate::statistics::{median, median_step};
use crate::unit::{SizedUnit, conversion, size, sized};

/// Rates of a log, Hz, in a probable unit of its time.
pub(super) const PROBABLE_RATES_HZ: std::ops::Range<f64> = 10.0..1e5;

/// Units of time, the most common first.
const TIME_UNITS: [&str; 4] = ["s", "ms", "us", "ns"];

/// Units of a velocity and a position, the most common first.
const VELOCITY_UNITS: [&str; 4] = ["rad/s", "rpm", "deg/s", "rps"];
const POSITION_UNITS: [&str; 3] = ["rad", "deg", "rev"];

/// Maximum relative difference between the measured and the expected ratio of velocity and derivative.
const MAX_RATIO_ERROR: f64 = 0.02;

/// Rows over which a displacement is compared with the mean velocity.
const DISPLACEMENT_ROWS: usize = 10;

/// Minimum number of displacements.
const MIN_DISPLACEMENTS: usize = 20;

/// Minimum range of an angle that is probably in degrees, in its own unit: two turns in rad.
const MIN_DEGREES: f64 = 12.6;

/// Maximum angle in degrees of a joint. Beyond it, the angle may be of many turns in rad.
const MAX_DEGREES: f64 = 400.0;

/// Maximum speed of a joint without a unit, rad/s: 1,400 rpm.
const MAX_SPEED_RAD_S: f64 = 150.0;

/// Returns the unit of a time column by its rate, if it is not seconds.
pub(super) fn time_unit(time: &[f64]) -> Option<&'static str> {
    step_unit(median_step(time)?)
}

/// Returns the unit of the step between rows by the rate, if it is not seconds.
pub(super) fn step_unit(step: f64) -> Option<&'static str> {
    let is_probable = |unit: &&&str| {
        conversion("time_s", unit)
            .is_ok_and(|of| PROBABLE_RATES_HZ.contains(&(1.0 / of.apply(step))))
    };
    TIME_UNITS.iter().find(is_probable).copied().filter(|unit| *unit != "s")
}

/// Units of a time, the most probable first, and of the motion; `None` for the contract's.
pub(super) struct ClockedUnits {
    pub times: Vec<Option<&'static str>>,
    pub motion: PossibleUnits,
}

/// Returns the units of a time that nothing states, and those of the motion, which `motion_in` returns for a unit of the time.
pub(super) fn clocked_units(
    time: Option<&[f64]>,
    motion_in: impl Fn(&str) -> PossibleUnits,
) -> ClockedUnits {
    let by_rate = time.and_then(time_unit);
    let motion = motion_in(by_rate.unwrap_or("s"));
    if by_rate.is_none() || motion.is_by_ratio {
        return ClockedUnits { times: vec![by_rate], motion };
    }
    // A slow log in seconds has the rate of a fast one in ms. The motion decides, if it can.
    let in_seconds = motion_in("s");
    match in_seconds.is_by_ratio {
        true => ClockedUnits { times: vec![None], motion: in_seconds },
        false => ClockedUnits { times: vec![by_rate, None], motion },
    }
}

/// The columns of a motion, with the units that are known. The time is in seconds.
#[derive(Clone, Copy, Default)]
pub(super) struct MotionSample<'a> {
    pub time_s: Option<&'a [f64]>,
    pub position: Option<&'a [f64]>,
    pub position_unit: Option<&'a str>,
    pub velocity: Option<&'a [f64]>,
    pub velocity_unit: Option<&'a str>,
}

/// Units of a motion; `None` for one that is given or the contract's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct MotionUnits {
    pub velocity: Option<&'static str>,
    pub position: Option<&'static str>,
}

/// Units that a motion may have, by the sizes of its values.
#[derive(Debug, Default, PartialEq)]
pub(super) struct PossibleUnits {
    /// The most probable first; at least one.
    pub all: Vec<MotionUnits>,
    /// True if the ratio of velocity and derivative is that of the units.
    pub is_by_ratio: bool,
    /// True if it is that of no other units.
    pub is_unique: bool,
}

/// Returns the units of velocity and position by their sizes.
pub(super) fn motion_units(of: MotionSample) -> PossibleUnits {
    let new = |unit: &'static str, given: Option<&str>, of_contract: &str| {
        (given.is_none() && unit != of_contract).then_some(unit)
    };
    let known = |fitting: FittingUnits| MotionUnits {
        velocity: new(fitting.velocity, of.velocity_unit, "rad/s"),
        position: new(fitting.position, of.position_unit, "rad"),
    };
    let fitting = ratio(of).map_or_else(Vec::new, |ratio| fitting(of, ratio));
    let turns = of.position.map_or(Turns::Few, turns);
    if let [first, others @ ..] = fitting.as_slice() {
        // One ratio for rad/s and rad, for deg/s and deg, and for turns: the range of the angle decides, if it can.
        let of_degrees = || others.iter().copied().find(|of| of.position == "deg");
        let all = match (others.is_empty(), turns, of_degrees()) {
            (true, ..) | (_, Turns::Few, _) | (_, _, None) => vec![*first],
            (_, Turns::OfDegrees, Some(degrees)) => vec![degrees, *first],
            (_, Turns::Many, Some(degrees)) => vec![*first, degrees],
        };
        let all = all.into_iter().map(known).collect();
        return PossibleUnits { all, is_by_ratio: true, is_unique: others.is_empty() };
    }
    let is_fast = |speeds: &[f64]| speeds.iter().any(|speed| speed.abs() > MAX_SPEED_RAD_S);
    let velocities = match of.velocity.filter(|v| of.velocity_unit.is_none() && is_fast(v)) {
        Some(_) => &[Some("rpm"), None, Some("deg/s")][..],
        None => &[None][..],
    };
    let positions = match (of.position_unit, turns) {
        (None, Turns::OfDegrees) => &[Some("deg"), None][..],
        (None, Turns::Many) => &[None, Some("deg")][..],
        _ => &[None][..],
    };
    let at = |all: &[Option<&'static str>], place: usize| all[place.min(all.len() - 1)];
    let count = velocities.len().max(positions.len());
    let units =
        |place| MotionUnits { velocity: at(velocities, place), position: at(positions, place) };
    let all = (0..count).map(units).collect();
    PossibleUnits { all, is_by_ratio: false, is_unique: false }
}

/// Units of a velocity and a position that fit the ratio of their values.
#[derive(Clone, Copy)]
struct FittingUnits {
    velocity: &'static str,
    position: &'static str,
}

/// Returns the units whose sizes have the ratio of the velocity and the derivative.
fn fitting(of: MotionSample, ratio: f64) -> Vec<FittingUnits> {
    let mut fitting = Vec::new();
    for velocity in candidates("velocity_rad_s", &VELOCITY_UNITS, of.velocity_unit) {
        for position in candidates("position_rad", &POSITION_UNITS, of.position_unit) {
            if (ratio / (velocity.size / position.size) - 1.0).abs() < MAX_RATIO_ERROR {
                fitting.push(FittingUnits { velocity: velocity.unit, position: position.unit });
            }
        }
    }
    fitting
}

/// Returns all units, or the known one.
fn candidates(name: &str, units: &[&'static str], known: Option<&str>) -> Vec<SizedUnit> {
    let mut all = sized(name, units);
    all.retain(|of| known.is_none_or(|known| size(name, known) == Some(of.size)));
    all
}

/// What the range of an angle without a unit shows.
#[derive(Clone, Copy)]
enum Turns {
    /// It is that of a joint in rad.
    Few,
    /// It is that of a joint in degrees, or of a motor with several turns in rad.
    OfDegrees,
    /// It is that of a motor with many turns in rad, or with some turns in degrees.
    Many,
}

fn turns(angles: &[f64]) -> Turns {
    let [least, most] = crate::statistics::extent(angles.iter().copied().filter(|q| !q.is_nan()));
    match (most - least > MIN_DEGREES, most.max(-least) < MAX_DEGREES) {
        (false, _) => Turns::Few,
        (true, true) => Turns::OfDegrees,
        (true, false) => Turns::Many,
    }
}

/// Returns the velocity over the derivative of the position, if enough displacements show it.
fn ratio(of: MotionSample) -> Option<f64> {
    let (time, position, velocity) = (of.time_s?, of.position?, of.velocity?);
    let displacement = |from: usize| {
        let rows = from..from + DISPLACEMENT_ROWS;
        let steps = rows.clone().map(|row| time[row + 1] - time[row]);
        let means = rows.map(|row| 0.5 * (velocity[row + 1] + velocity[row]));
        let travel = steps.zip(means).map(|(step, mean)| step * mean).sum::<f64>();
        (position[from + DISPLACEMENT_ROWS] - position[from], travel)
    };
    let count = time.len().min(position.len()).min(velocity.len());
    let all = (0..count.saturating_sub(DISPLACEMENT_ROWS)).step_by(DISPLACEMENT_ROWS / 2);
    let all: Vec<(f64, f64)> =
        all.map(displacement).filter(|(dq, dv)| dq.is_finite() && dv.is_finite()).collect();
    let usual = median(&mut all.iter().map(|(dq, _)| dq.abs()).collect::<Vec<_>>())?;
    let large = all.iter().filter(|(dq, _)| dq.abs() > 0.0 && dq.abs() >= usual);
    let mut ratios: Vec<f64> = large.map(|(dq, dv)| dv / dq).collect();
    let middle = median(&mut ratios).filter(|_| ratios.len() >= MIN_DISPLACEMENTS)?;
    // The columns describe one motion only if the ratios agree.
    let mut off: Vec<f64> = ratios.iter().map(|ratio| (ratio / middle - 1.0).abs()).collect();
    median(&mut off).filter(|off| *off < MAX_RATIO_ERROR).map(|_| middle)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motion(position_size: f64, velocity_size: f64) -> [Vec<f64>; 3] {
        let time: Vec<f64> = (0..600).map(|row| 0.01 * f64::from(row)).collect();
        let position = time.iter().map(|t| position_size * (1.2 * t).sin()).collect();
        let velocity = time.iter().map(|t| velocity_size * 1.2 * (1.2 * t).cos()).collect();
        [time, position, velocity]
    }

    fn units(position_size: f64, velocity_size: f64) -> Vec<[Option<&'static str>; 2]> {
        let [time, position, velocity] = motion(position_size, velocity_size);
        pairs(motion_units(MotionSample {
            time_s: Some(&time),
            position: Some(&position),
            velocity: Some(&velocity),
            ..MotionSample::default()
        }))
    }

    fn pairs(found: PossibleUnits) -> Vec<[Option<&'static str>; 2]> {
        found.all.iter().map(|of| [of.velocity, of.position]).collect()
    }

    #[test]
    fn motion_units_with_known_ratio_returns_them() {
        let (degree, rpm) = (57.295_78, 9.549_297);
        assert_eq!(units(1.0, 1.0), [[None; 2]]);
        assert_eq!(units(degree, rpm), [[Some("rpm"), Some("deg")]]);
        assert_eq!(units(1.0, rpm), [[Some("rpm"), None]]);
        assert_eq!(units(degree, 1.0), [[None, Some("deg")]]);
        let degrees = [Some("deg/s"), Some("deg")];
        assert_eq!(units(degree, degree), [degrees, [None; 2]], "degrees, or turns in rad");
        assert_eq!(units(4e3, 4e3), [[None; 2], degrees], "hundreds of turns");
        assert_eq!(units(1.0, 3.0), [[None; 2]], "no known ratio");
    }

    #[test]
    fn motion_units_with_a_known_unit_returns_the_other() {
        let [time, position, velocity] = motion(57.295_78, 9.549_297);
        let found = motion_units(MotionSample {
            time_s: Some(&time),
            position: Some(&position),
            position_unit: Some("deg"),
            velocity: Some(&velocity),
            velocity_unit: None,
        });
        assert!(found.is_by_ratio && found.is_unique);
        assert_eq!(pairs(found), [[Some("rpm"), None]]);
    }

    #[test]
    fn motion_units_of_one_column_follow_its_size() {
        let [_, position, velocity] = motion(57.3, 300.0);
        let of = MotionSample { velocity: Some(&velocity), ..MotionSample::default() };
        assert_eq!(
            pairs(motion_units(of)),
            [[Some("rpm"), None], [None; 2], [Some("deg/s"), None]]
        );
        let of = MotionSample { position: Some(&position), ..MotionSample::default() };
        assert_eq!(pairs(motion_units(of)), [[None, Some("deg")], [None; 2]]);
    }

    #[test]
    fn time_unit_follows_the_rate() {
        let time = |step: f64| (0..50).map(|row| step * f64::from(row)).collect::<Vec<_>>();
        assert_eq!(time_unit(&time(0.002)), None);
        assert_eq!(time_unit(&time(5.0)), Some("ms"));
        assert_eq!(time_unit(&time(2000.0)), Some("us"));
        assert_eq!(time_unit(&[]), None);
    }
}
