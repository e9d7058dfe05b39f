//! Guess of the quantities of columns without names, by their values.
//!
//! A clock increases in steps of one size. A velocity follows the derivative of a position, and the ratio of the two shows
//! their units. Friction has the sign of the velocity. A guess is only a suggestion of what to type.

use super::clock_fault::is_step_column;
use super::column_pair::ColumnPair;
use super::contract::TIME;
use super::size::{self, MotionSample, MotionUnits};
use super::statistics::{correlation, median};

/// Minimum correlation of a velocity with the derivative of a position.
const MIN_MOTION_FIT: f64 = 0.9;

/// Minimum correlation of a torque with the sign of the velocity.
const MIN_SIGN_FIT: f64 = 0.3;

/// Minimum number of rows of a guess.
const MIN_ROWS: usize = 20;

/// Minimum share of the steps of a clock between half and twice their median.
const MIN_REGULAR_STEPS: f64 = 0.8;

/// Units of time, each with its length, s, and the steps that suggest it.
const CLOCK_UNITS: [(Option<&str>, f64, std::ops::Range<f64>); 4] = [
    (None, 1.0, 1e-5..0.15),
    (Some("ms"), 1e-3, 0.15..60.0),
    (Some("us"), 1e-6, 60.0..1e5),
    (Some("ns"), 1e-9, 1e5..1e9),
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

/// Returns for each column the quantities that it may hold; the most probable first.
pub(super) fn guesses(columns: &[Vec<f64>]) -> Vec<Vec<QuantityGuess>> {
    let mut found: Vec<Vec<QuantityGuess>> = vec![Vec::new(); columns.len()];
    if columns.iter().map(Vec::len).min().unwrap_or_default() < MIN_ROWS {
        return found;
    }
    let varies = |at: &usize| columns[*at].iter().any(|value| *value != columns[*at][0]);
    let stamps = (0..columns.len()).find_map(|at| Some((at, clock(&columns[at])?)));
    // A constant column is a step only beside a motion and a torque.
    let has_others = (0..columns.len()).filter(varies).count() > 1;
    let steps = || (0..columns.len()).find_map(|at| Some((at, step(&columns[at])?)));
    let clock = stamps.or_else(|| has_others.then(steps).flatten());
    // The times in s; none for a column of steps, and without a clock.
    let mut times: Vec<Option<Vec<f64>>> = vec![None];
    if let Some((at, (guess, length_s))) = &clock {
        found[*at].push(*guess);
        let scaled = |length_s: f64| -> Option<Vec<f64>> {
            Some(columns[*at].iter().map(|t| t * length_s).collect())
        };
        times = vec![length_s.and_then(scaled)];
        // A slow log in seconds has the rate of a fast one in ms. The motion decides, if it can.
        times.extend(length_s.filter(|length_s| *length_s != 1.0).map(|_| scaled(1.0)));
    }
    let mut free: Vec<usize> = (0..columns.len()).collect();
    free.retain(|at| found[*at].is_empty() && varies(at));
    let motion = motion(columns, &free, times[0].as_deref());
    let signs: Vec<(usize, Vec<f64>)> = match motion {
        Some((q, v)) => {
            let (position, velocity) = (Some(&columns[q][..]), Some(&columns[v][..]));
            let of = MotionSample { position, velocity, ..MotionSample::default() };
            let units = |time: &Option<Vec<f64>>| {
                size::motion_units(MotionSample { time_s: time.as_deref(), ..of })
            };
            let place = times.iter().position(|time| units(time).is_by_ratio).unwrap_or_default();
            let (time, units) = (times[place].as_deref(), units(&times[place]));
            if let (Some((at, _)), 1..) = (&clock, place) {
                found[*at] = vec![QuantityGuess::new(TIME, None)];
            }
            // A voltage follows the velocity in no known ratio.
            let is_velocity = units.is_by_ratio || time.is_none();
            let units = || units.all.iter().copied();
            found[q].extend(units().map(|[_, unit]| QuantityGuess::new("position_rad", unit)));
            if is_velocity {
                found[v]
                    .extend(units().map(|[unit, _]| QuantityGuess::new("velocity_rad_s", unit)));
            }
            free.retain(|at| found[*at].is_empty() && *at != v);
            let of_position = || derivative(&columns[q], time);
            vec![if is_velocity { (v, columns[v].clone()) } else { (q, of_position()) }]
        }
        // Without a pair, any column may be the motion: a velocity itself, or a position.
        None => {
            let both = |at: &usize| [columns[*at].clone(), derivative(&columns[*at], None)];
            free.iter().flat_map(|at| both(at).map(|values| (*at, values))).collect()
        }
    };
    let is_only = motion.is_some() && free.len() == 1;
    let Some((torque, number, of)) = torque(columns, &free, &signs, is_only) else { return found };
    found[torque].push(QuantityGuess::new("torque_nm", None));
    if found[of].is_empty() {
        found[of] = guesses_of_motion(&columns[of], number % 2 == 0);
    }
    found
}

/// Returns a velocity or a position without the other, in its possible units.
fn guesses_of_motion(values: &[f64], is_velocity: bool) -> Vec<QuantityGuess> {
    let (velocity, position) =
        if is_velocity { (Some(values), None) } else { (None, Some(values)) };
    let units = size::motion_units(MotionSample { velocity, position, ..MotionSample::default() });
    let guess = |[v, q]: &MotionUnits| match is_velocity {
        true => QuantityGuess::new("velocity_rad_s", *v),
        false => QuantityGuess::new("position_rad", *q),
    };
    units.all.iter().map(guess).collect()
}

/// Returns the columns of a position and a velocity that follows its derivative best.
fn motion(columns: &[Vec<f64>], free: &[usize], time: Option<&[f64]>) -> Option<(usize, usize)> {
    let pairs = free.iter().flat_map(|q| free.iter().map(|v| (*q, *v))).filter(|(q, v)| q != v);
    let rated = pairs.map(|(q, v)| (q, v, fit(&derivative(&columns[q], time), &columns[v])));
    let best = rated.max_by(|a, b| a.2.total_cmp(&b.2)).filter(|pair| pair.2 >= MIN_MOTION_FIT);
    best.map(|(q, v, _)| (q, v))
}

/// Returns the column that follows the sign of a motion best, the place of that motion among `signs`, and its column. The only free
/// column need not follow it well.
fn torque(
    columns: &[Vec<f64>],
    free: &[usize],
    signs: &[(usize, Vec<f64>)],
    is_only: bool,
) -> Option<(usize, usize, usize)> {
    let pairs = free.iter().flat_map(|torque| signs.iter().enumerate().map(move |s| (*torque, s)));
    let rated =
        pairs.filter(|(torque, (_, (of, _)))| torque != of).map(|(torque, (number, sign))| {
            let signum: Vec<f64> =
                sign.1.iter().map(|v| if *v == 0.0 { 0.0 } else { v.signum() }).collect();
            (torque, number, sign.0, fit(&signum, &columns[torque]))
        });
    let best =
        rated.max_by(|a, b| a.3.total_cmp(&b.3)).filter(|of| is_only || of.3 >= MIN_SIGN_FIT);
    best.map(|(torque, number, of, _)| (torque, number, of))
}

/// Returns the correlation of two columns.
fn fit(x: &[f64], y: &[f64]) -> f64 {
    correlation(x.iter().copied().zip(y.iter().copied()))
}

/// Returns the unit of a column of times and its length, s, by the step of the times.
fn clock_unit(step: f64) -> Option<(Option<&'static str>, f64)> {
    let unit = CLOCK_UNITS.iter().find(|(.., steps)| steps.contains(&step));
    unit.map(|(unit, length_s, _)| (*unit, *length_s))
}

/// Returns the time of a column that holds steps.
fn step(values: &[f64]) -> Option<(QuantityGuess, Option<f64>)> {
    if !is_step_column(values) {
        return None;
    }
    let (unit, _) = clock_unit(median(&mut values.to_vec())?)?;
    Some((QuantityGuess { is_step: true, ..QuantityGuess::new(TIME, unit) }, None))
}

/// Returns the time of a column of times, and the length of its unit, s.
fn clock(values: &[f64]) -> Option<(QuantityGuess, Option<f64>)> {
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
    let (unit, length_s) = clock_unit(median)?;
    Some((QuantityGuess::new(TIME, unit), Some(length_s)))
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
