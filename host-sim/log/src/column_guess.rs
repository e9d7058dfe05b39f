//! Guess of the quantities of columns without names, by their values.
//!
//! A clock increases in steps of one size. A velocity follows the derivative of a position, and the ratio of the two shows
//! their units. Friction has the sign of the velocity. A guess is only a suggestion of what to type.

use super::clock_fault::is_step_column;
use super::column_pair::ColumnPair;
use super::contract::TIME;
use super::size::{self, MotionSample, MotionUnits};
use super::statistics::{correlation, median};
use std::ops::Range;

/// Minimum correlation of a velocity with the derivative of a position.
const MIN_MOTION_FIT: f64 = 0.9;

/// Minimum correlation of a torque with the sign of the velocity.
const MIN_SIGN_FIT: f64 = 0.3;

/// Minimum number of rows of a guess.
const MIN_ROWS: usize = 20;

/// Minimum share of the steps of a clock between half and twice their median.
const MIN_REGULAR_STEPS: f64 = 0.8;

/// A unit of time.
struct ClockUnit {
    /// `None` for that of the contract.
    unit: Option<&'static str>,
    length_s: f64,
    /// The steps that suggest it.
    steps: Range<f64>,
}

const CLOCK_UNITS: [ClockUnit; 4] = [
    ClockUnit { unit: None, length_s: 1.0, steps: 1e-5..0.15 },
    ClockUnit { unit: Some("ms"), length_s: 1e-3, steps: 0.15..60.0 },
    ClockUnit { unit: Some("us"), length_s: 1e-6, steps: 60.0..1e5 },
    ClockUnit { unit: Some("ns"), length_s: 1e-9, steps: 1e5..1e9 },
];

/// A quantity that a column may hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct QuantityGuess {
    /// Its contract name.
    pub quantity: &'static str,
    /// Unit of the values; `None` for that of the contract.
    pub unit: Option<&'static str>,
    /// True if the values are the steps between the rows.
    pub is_step: bool,
}

impl QuantityGuess {
    const fn new(quantity: &'static str, unit: Option<&'static str>) -> Self {
        Self { quantity, unit, is_step: false }
    }

    /// Returns the pair of a column by its number.
    pub fn pair(self, number: &str) -> ColumnPair {
        let pair = ColumnPair::new(self.quantity, number, self.unit);
        ColumnPair { is_step: self.is_step, is_numbered: true, ..pair }
    }
}

/// A column that may hold the times, or the steps between them.
struct ClockColumn {
    column: usize,
    guess: QuantityGuess,
    /// Length of its unit, s; `None` for steps.
    length_s: Option<f64>,
}

/// The columns of a position and of a velocity.
#[derive(Clone, Copy)]
struct MotionPair {
    position: usize,
    velocity: usize,
}

/// A motion whose sign a torque may follow.
struct Motion {
    column: usize,
    /// True if the column is taken as a velocity, false if as a position.
    is_velocity: bool,
    /// The velocities.
    velocities: Vec<f64>,
}

/// Returns for each column the quantities that it may hold; the most probable first.
pub(super) fn guesses(columns: &[Vec<f64>]) -> Vec<Vec<QuantityGuess>> {
    let mut found: Vec<Vec<QuantityGuess>> = vec![Vec::new(); columns.len()];
    if columns.iter().map(Vec::len).min().unwrap_or_default() < MIN_ROWS {
        return found;
    }
    let varies = |at: &usize| columns[*at].iter().any(|value| *value != columns[*at][0]);
    let stamps = (0..columns.len()).find_map(|at| clock(at, &columns[at]));
    // A constant column is a step only beside a motion and a torque.
    let has_others = (0..columns.len()).filter(varies).count() > 1;
    let steps = || (0..columns.len()).find_map(|at| step(at, &columns[at]));
    let clock = stamps.or_else(|| has_others.then(steps).flatten());
    if let Some(clock) = &clock {
        found[clock.column].push(clock.guess);
    }
    let times = possible_times(columns, clock.as_ref());
    let mut free: Vec<usize> = (0..columns.len()).collect();
    free.retain(|at| found[*at].is_empty() && varies(at));
    let pair = motion_pair(columns, &free, times[0].as_deref());
    let motions = match pair {
        Some(pair) => {
            let motion = guess_pair(columns, pair, clock.as_ref(), &times, &mut found);
            free.retain(|at| found[*at].is_empty() && *at != pair.velocity);
            vec![motion]
        }
        // Without a pair, any column may be the motion: a velocity itself, or a position.
        None => free.iter().flat_map(|at| alone(columns, *at)).collect(),
    };
    let is_only = pair.is_some() && free.len() == 1;
    let Some((torque, motion)) = torque(columns, &free, &motions, is_only) else { return found };
    found[torque].push(QuantityGuess::new("torque_nm", None));
    if found[motion.column].is_empty() {
        found[motion.column] = guesses_of_motion(&columns[motion.column], motion.is_velocity);
    }
    found
}

/// Returns the times in s that a clock may have, the most probable first; `None` for steps, and without a clock.
fn possible_times(columns: &[Vec<f64>], clock: Option<&ClockColumn>) -> Vec<Option<Vec<f64>>> {
    let Some(ClockColumn { column, length_s: Some(length_s), .. }) = clock else {
        return vec![None];
    };
    let in_unit = |length_s: f64| Some(columns[*column].iter().map(|t| t * length_s).collect());
    // A slow log in seconds has the rate of a fast one in ms. The motion decides, if it can.
    let units = if *length_s == 1.0 { vec![1.0] } else { vec![*length_s, 1.0] };
    units.into_iter().map(in_unit).collect()
}

/// Adds the guesses of a position and a velocity, and returns the motion. Corrects that of the clock, if the motion shows that
/// it is in seconds.
fn guess_pair(
    columns: &[Vec<f64>],
    pair: MotionPair,
    clock: Option<&ClockColumn>,
    times: &[Option<Vec<f64>>],
    found: &mut [Vec<QuantityGuess>],
) -> Motion {
    let position = Some(&columns[pair.position][..]);
    let velocity = Some(&columns[pair.velocity][..]);
    let units = |time: &Option<Vec<f64>>| {
        let time_s = time.as_deref();
        size::motion_units(MotionSample { time_s, position, velocity, ..MotionSample::default() })
    };
    let place = times.iter().position(|time| units(time).is_by_ratio).unwrap_or_default();
    if let (Some(clock), 1..) = (clock, place) {
        found[clock.column] = vec![QuantityGuess::new(TIME, None)];
    }
    let (time, units) = (times[place].as_deref(), units(&times[place]));
    let position_guess = |of: &MotionUnits| QuantityGuess::new("position_rad", of.position);
    found[pair.position].extend(units.all.iter().map(position_guess));
    // A voltage follows the velocity in no known ratio.
    if units.is_by_ratio || time.is_none() {
        let velocity_guess = |of: &MotionUnits| QuantityGuess::new("velocity_rad_s", of.velocity);
        found[pair.velocity].extend(units.all.iter().map(velocity_guess));
        let (column, velocities) = (pair.velocity, columns[pair.velocity].clone());
        return Motion { column, is_velocity: true, velocities };
    }
    let velocities = derivative(&columns[pair.position], time);
    Motion { column: pair.position, is_velocity: false, velocities }
}

/// Returns the motions that a column may be alone.
fn alone(columns: &[Vec<f64>], column: usize) -> [Motion; 2] {
    let (velocities, slopes) = (columns[column].clone(), derivative(&columns[column], None));
    [
        Motion { column, is_velocity: true, velocities },
        Motion { column, is_velocity: false, velocities: slopes },
    ]
}

/// Returns a velocity or a position without the other, in its possible units.
fn guesses_of_motion(values: &[f64], is_velocity: bool) -> Vec<QuantityGuess> {
    let (velocity, position) =
        if is_velocity { (Some(values), None) } else { (None, Some(values)) };
    let units = size::motion_units(MotionSample { velocity, position, ..MotionSample::default() });
    let guess = |of: &MotionUnits| match is_velocity {
        true => QuantityGuess::new("velocity_rad_s", of.velocity),
        false => QuantityGuess::new("position_rad", of.position),
    };
    units.all.iter().map(guess).collect()
}

/// Returns the columns of a position and a velocity that follows its derivative best.
fn motion_pair(columns: &[Vec<f64>], free: &[usize], time: Option<&[f64]>) -> Option<MotionPair> {
    let pairs = free.iter().flat_map(|position| {
        free.iter().map(|velocity| MotionPair { position: *position, velocity: *velocity })
    });
    let rated = pairs.filter(|pair| pair.position != pair.velocity).map(|pair| {
        (pair, fit(&derivative(&columns[pair.position], time), &columns[pair.velocity]))
    });
    let best = rated.max_by(|a, b| a.1.total_cmp(&b.1));
    best.filter(|(_, fit)| *fit >= MIN_MOTION_FIT).map(|(pair, _)| pair)
}

/// Returns the column that follows the sign of a motion best, and that motion. The only free column need not follow it well.
fn torque<'a>(
    columns: &[Vec<f64>],
    free: &[usize],
    motions: &'a [Motion],
    is_only: bool,
) -> Option<(usize, &'a Motion)> {
    let pairs = free.iter().flat_map(|torque| motions.iter().map(|motion| (*torque, motion)));
    let rated =
        pairs.filter(|(torque, motion)| *torque != motion.column).map(|(torque, motion)| {
            let sign = |v: &f64| if *v == 0.0 { 0.0 } else { v.signum() };
            let signs: Vec<f64> = motion.velocities.iter().map(sign).collect();
            (torque, motion, fit(&signs, &columns[torque]))
        });
    let best = rated.max_by(|a, b| a.2.total_cmp(&b.2));
    let (torque, motion, _) = best.filter(|of| is_only || of.2 >= MIN_SIGN_FIT)?;
    Some((torque, motion))
}

/// Returns the correlation of two columns.
fn fit(x: &[f64], y: &[f64]) -> f64 {
    correlation(x.iter().copied().zip(y.iter().copied()))
}

/// Returns the unit of a column of times by the step of the times.
fn clock_unit(step: f64) -> Option<&'static ClockUnit> {
    CLOCK_UNITS.iter().find(|unit| unit.steps.contains(&step))
}

/// Returns the clock of a column that holds steps.
fn step(column: usize, values: &[f64]) -> Option<ClockColumn> {
    if !is_step_column(values) {
        return None;
    }
    let ClockUnit { unit, .. } = clock_unit(median(&mut values.to_vec())?)?;
    let guess = QuantityGuess { is_step: true, ..QuantityGuess::new(TIME, *unit) };
    Some(ClockColumn { column, guess, length_s: None })
}

/// Returns the clock of a column of times.
fn clock(column: usize, values: &[f64]) -> Option<ClockColumn> {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.iter().any(|step| *step < 0.0) {
        return None;
    }
    let median = median(&mut steps)?;
    let is_regular = |step: &&f64| (0.5 * median..=2.0 * median).contains(*step);
    let regular = steps.iter().filter(is_regular).count();
    if median <= 0.0 || (regular as f64) < MIN_REGULAR_STEPS * steps.len() as f64 {
        return None;
    }
    let ClockUnit { unit, length_s, .. } = clock_unit(median)?;
    let guess = QuantityGuess::new(TIME, *unit);
    Some(ClockColumn { column, guess, length_s: Some(*length_s) })
}

/// Returns the derivative of a column over two rows, in units per second, or per row without a time.
fn derivative(values: &[f64], time: Option<&[f64]>) -> Vec<f64> {
    let last = values.len() - 1;
    let slope = |row: usize| {
        let (before, after) = (row.saturating_sub(1), (row + 1).min(last));
        let length = time.map_or((after - before) as f64, |time| time[after] - time[before]);
        (values[after] - values[before]) / if length > 0.0 { length } else { f64::INFINITY }
    };
    (0..=last).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns(of: &[fn(f64) -> f64]) -> Vec<Vec<QuantityGuess>> {
        let columns: Vec<Vec<f64>> =
            of.iter().map(|of| (0..400).map(|row| of(0.005 * f64::from(row))).collect()).collect();
        guesses(&columns)
    }

    /// Returns the most probable quantity and unit of each column; empty texts for none.
    fn first(found: &[Vec<QuantityGuess>]) -> Vec<(&'static str, &'static str)> {
        let first = |guesses: &Vec<QuantityGuess>| {
            guesses.first().map_or(("", ""), |of| (of.quantity, of.unit.unwrap_or_default()))
        };
        found.iter().map(first).collect()
    }

    const POSITION: fn(f64) -> f64 = |t| 2.0 * (3.0 * t).sin();
    const VELOCITY: fn(f64) -> f64 = |t| 6.0 * (3.0 * t).cos();
    const TORQUE: fn(f64) -> f64 = |t| 0.5 * (3.0 * t).cos().signum() + 0.1 * (40.0 * t).sin();

    #[test]
    fn guesses_with_all_quantities_finds_each_in_any_order() {
        let found = columns(&[TORQUE, |_| 3.0, POSITION, |t| 1e3 * t, VELOCITY]);
        let expected = [
            ("torque_nm", ""),
            ("", ""),
            ("position_rad", ""),
            ("time_s", "ms"),
            ("velocity_rad_s", ""),
        ];
        assert_eq!(first(&found), expected);
        assert!(!found[3][0].is_step);
    }

    #[test]
    fn guesses_with_other_units_names_them() {
        let found =
            columns(&[|t| t, |t| POSITION(t).to_degrees(), |t| VELOCITY(t) * 9.549_297, TORQUE]);
        let expected =
            [("time_s", ""), ("position_rad", "deg"), ("velocity_rad_s", "rpm"), ("torque_nm", "")];
        assert_eq!(first(&found), expected);
        let found = columns(&[|_| 5000.0, VELOCITY, TORQUE]);
        let expected = [("time_s", "us"), ("velocity_rad_s", ""), ("torque_nm", "")];
        assert_eq!(first(&found), expected);
        assert_eq!(
            found.concat().iter().map(|of| of.is_step).collect::<Vec<_>>(),
            [true, false, false]
        );
    }

    #[test]
    fn guesses_with_position_and_torque_alone_finds_them() {
        let expected = [("time_s", ""), ("position_rad", ""), ("torque_nm", "")];
        assert_eq!(first(&columns(&[|t| t, POSITION, TORQUE])), expected);
        assert!(columns(&[|_| 1.0, |_| 2.0]).iter().all(Vec::is_empty));
        assert!(guesses(&[vec![1.0; 3], vec![2.0; 3]]).iter().all(Vec::is_empty));
    }

    #[test]
    fn guesses_with_a_voltage_in_place_of_the_velocity_names_no_velocity() {
        let voltage: fn(f64) -> f64 = |t| 2.1 * VELOCITY(t) + 3.0 * TORQUE(t);
        let found = columns(&[|t| t, POSITION, voltage, TORQUE]);
        let expected = [("time_s", ""), ("position_rad", ""), ("", ""), ("torque_nm", "")];
        assert_eq!(first(&found), expected);
    }

    #[test]
    fn guesses_of_many_turns_names_both_units() {
        let found = columns(&[|t| t, |t| 1e3 * POSITION(t), |t| 1e3 * VELOCITY(t), TORQUE]);
        let both = |quantity, unit| [None, Some(unit)].map(|of| QuantityGuess::new(quantity, of));
        assert_eq!(found[1], both("position_rad", "deg"));
        assert_eq!(found[2], both("velocity_rad_s", "deg/s"));
    }
}
