//! Guess of the quantities of columns without names, by their values.
//!
//! A clock increases in steps of one size. A velocity follows the derivative of a position, in a ratio of known units.
//! Friction has the sign of the velocity. A guess is only a suggestion of what to type.

use super::clock_fault::is_step_column;
use super::contract::TIME;
use super::guess::Guess;
use super::size::{self, MotionSample};
use super::statistics::{correlation, median};
use super::unit::conversion;
use std::ops::Range;

/// Minimum correlation of a velocity with the derivative of a position.
const MIN_MOTION_FIT: f64 = 0.9;

/// Minimum correlation of a torque with the sign of the velocity.
const MIN_SIGN_FIT: f64 = 0.3;

/// Minimum number of rows of a guess.
const MIN_ROWS: usize = 20;

/// Minimum share of the steps of a clock between half and twice their median.
const MIN_REGULAR_STEPS: f64 = 0.8;

/// Steps of a clock, in any unit of time.
const CLOCK_STEPS: Range<f64> = 1e-5..1e9;

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

/// Returns for each column the quantity that it may hold, in a unit that is to be found ([`size`]).
pub(super) fn guesses(columns: &[&[f64]]) -> Vec<Option<Guess>> {
    let mut found = vec![None; columns.len()];
    if columns.iter().map(|of| of.len()).min().unwrap_or_default() < MIN_ROWS {
        return found;
    }
    let guess = |quantity| Guess { quantity, is_numbered: true, ..Guess::default() };
    let varies = |at: &usize| columns[*at].iter().any(|value| *value != columns[*at][0]);
    let stamps = (0..columns.len()).find(|at| is_clock(columns[*at]));
    // A constant column is a step only beside a motion and a torque.
    let has_others = (0..columns.len()).filter(varies).count() > 1;
    let steps = || (0..columns.len()).find(|at| is_step(columns[*at]));
    if let Some(at) = stamps.or_else(|| has_others.then(steps).flatten()) {
        found[at] = Some(Guess { is_step: stamps.is_none(), ..guess(TIME) });
    }
    let time = stamps.map(|at| columns[at]);
    let mut free: Vec<usize> = (0..columns.len()).collect();
    free.retain(|at| found[*at].is_none() && varies(at));
    let pair = motion_pair(columns, &free, time);
    let motions = match pair {
        Some(pair) => {
            let motion = motion_of_pair(columns, pair, time);
            found[pair.position] = Some(guess("position_rad"));
            free.retain(|at| found[*at].is_none() && *at != pair.velocity);
            vec![motion]
        }
        // Without a pair, any column may be the motion: a velocity itself, or a position.
        None => free.iter().flat_map(|at| alone(columns, *at)).collect(),
    };
    let is_only = pair.is_some() && free.len() == 1;
    let torque = torque(columns, &free, &motions, is_only);
    if let Some((torque, _)) = torque {
        found[torque] = Some(guess("torque_nm"));
    }
    let of_pair = pair.and_then(|_| motions.first());
    if let Some(motion) = torque.map(|(_, motion)| motion).or(of_pair) {
        let quantity = if motion.is_velocity { "velocity_rad_s" } else { "position_rad" };
        found[motion.column] = Some(guess(quantity));
    }
    found
}

/// Returns the motion of a position and a column that follows its derivative. A voltage does so in no known ratio.
fn motion_of_pair(columns: &[&[f64]], pair: MotionPair, time: Option<&[f64]>) -> Motion {
    let (position, velocity) = (columns[pair.position], columns[pair.velocity]);
    let motion_in = |unit: &str| {
        let conversion = conversion(TIME, unit).ok();
        let seconds = |t: &f64| conversion.map_or(*t, |conversion| conversion.apply(*t));
        let time_s: Option<Vec<f64>> = time.map(|time| time.iter().map(seconds).collect());
        size::motion_units(MotionSample {
            time_s: time_s.as_deref(),
            position: Some(position),
            velocity: Some(velocity),
            ..MotionSample::default()
        })
    };
    if time.is_none() || size::clocked_units(time, motion_in).motion.is_by_ratio {
        return Motion { column: pair.velocity, is_velocity: true, velocities: velocity.to_vec() };
    }
    let velocities = derivative(position, time);
    Motion { column: pair.position, is_velocity: false, velocities }
}

/// Returns the motions that a column may be alone.
fn alone(columns: &[&[f64]], column: usize) -> [Motion; 2] {
    let (velocities, slopes) = (columns[column].to_vec(), derivative(columns[column], None));
    [
        Motion { column, is_velocity: true, velocities },
        Motion { column, is_velocity: false, velocities: slopes },
    ]
}

/// Returns the columns of a position and a velocity that follows its derivative best.
fn motion_pair(columns: &[&[f64]], free: &[usize], time: Option<&[f64]>) -> Option<MotionPair> {
    let pairs = free.iter().flat_map(|position| {
        free.iter().map(|velocity| MotionPair { position: *position, velocity: *velocity })
    });
    let rated = pairs
        .filter(|pair| pair.position != pair.velocity)
        .map(|pair| (pair, fit(&derivative(columns[pair.position], time), columns[pair.velocity])));
    let best = rated.max_by(|a, b| a.1.total_cmp(&b.1));
    best.filter(|(_, fit)| *fit >= MIN_MOTION_FIT).map(|(pair, _)| pair)
}

/// Returns the column that follows the sign of a motion best, and that motion. The only free column need not follow it well.
fn torque<'a>(
    columns: &[&[f64]],
    free: &[usize],
    motions: &'a [Motion],
    is_only: bool,
) -> Option<(usize, &'a Motion)> {
    let pairs = free.iter().flat_map(|torque| motions.iter().map(|motion| (*torque, motion)));
    let rated =
        pairs.filter(|(torque, motion)| *torque != motion.column).map(|(torque, motion)| {
            let sign = |v: &f64| if *v == 0.0 { 0.0 } else { v.signum() };
            let signs: Vec<f64> = motion.velocities.iter().map(sign).collect();
            (torque, motion, fit(&signs, columns[torque]))
        });
    let best = rated.max_by(|a, b| a.2.total_cmp(&b.2));
    let (torque, motion, _) = best.filter(|of| is_only || of.2 >= MIN_SIGN_FIT)?;
    Some((torque, motion))
}

/// Returns the correlation of two columns.
fn fit(x: &[f64], y: &[f64]) -> f64 {
    correlation(x.iter().copied().zip(y.iter().copied()))
}

/// Returns true if a column may hold the steps between the rows.
fn is_step(values: &[f64]) -> bool {
    let median = median(&mut values.to_vec());
    is_step_column(values) && median.is_some_and(|step| CLOCK_STEPS.contains(&step))
}

/// Returns true if a column may hold the times.
fn is_clock(values: &[f64]) -> bool {
    let mut steps: Vec<f64> = values.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.iter().any(|step| *step < 0.0) {
        return false;
    }
    let Some(median) = median(&mut steps) else { return false };
    let is_regular = |step: &&f64| (0.5 * median..=2.0 * median).contains(*step);
    let regular = steps.iter().filter(is_regular).count();
    CLOCK_STEPS.contains(&median) && regular as f64 >= MIN_REGULAR_STEPS * steps.len() as f64
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
    use super::guesses;
    use crate::{ColumnPair, ReadOptions, survey};
    use std::io::Write;

    /// Returns the suggestions for the columns of a file without a header; the most probable first.
    fn suggested(of: &[fn(f64) -> f64]) -> Vec<Vec<String>> {
        let mut file = tempfile::NamedTempFile::new().expect("a file");
        for row in 0..400 {
            let cells: Vec<String> =
                of.iter().map(|of| format!("{:?}", of(0.005 * f64::from(row)))).collect();
            writeln!(file, "{}", cells.join(",")).expect("a row");
        }
        let found = survey(file.path(), &ReadOptions::default()).expect("a survey");
        let each = found.columns.iter().map(|of| of.suggestion.iter().chain(&of.alternatives));
        each.map(|pairs| pairs.map(ColumnPair::to_string).collect()).collect()
    }

    /// Returns the most probable suggestion of each column; an empty text for none.
    fn first(of: &[fn(f64) -> f64]) -> Vec<String> {
        let first = |pairs: Vec<String>| pairs.into_iter().next().unwrap_or_default();
        suggested(of).into_iter().map(first).collect()
    }

    const POSITION: fn(f64) -> f64 = |t| 2.0 * (3.0 * t).sin();
    const VELOCITY: fn(f64) -> f64 = |t| 6.0 * (3.0 * t).cos();
    const TORQUE: fn(f64) -> f64 = |t| 0.5 * (3.0 * t).cos().signum() + 0.1 * (40.0 * t).sin();

    #[test]
    fn guesses_with_all_quantities_finds_each_in_any_order() {
        let found = first(&[TORQUE, |_| 3.0, POSITION, |t| 1e3 * t, VELOCITY]);
        assert_eq!(found, ["1=torque_nm", "", "3=position_rad", "4=time_s:ms", "5=velocity_rad_s"]);
    }

    #[test]
    fn guesses_with_other_units_names_them() {
        let found =
            first(&[|t| t, |t| POSITION(t).to_degrees(), |t| VELOCITY(t) * 9.549_297, TORQUE]);
        assert_eq!(
            found,
            ["1=time_s", "2=position_rad:deg", "3=velocity_rad_s:rpm", "4=torque_nm"]
        );
        let found = first(&[|_| 5000.0, VELOCITY, TORQUE]);
        assert_eq!(found, ["1=time_s:us:step", "2=velocity_rad_s", "3=torque_nm"]);
    }

    #[test]
    fn guesses_with_position_and_torque_alone_finds_them() {
        assert_eq!(
            first(&[|t| t, POSITION, TORQUE]),
            ["1=time_s", "2=position_rad", "3=torque_nm"]
        );
        assert!(suggested(&[|_| 1.0, |_| 2.0]).iter().all(Vec::is_empty));
        assert!(guesses(&[&[1.0; 3], &[2.0; 3]]).iter().all(Option::is_none));
    }

    #[test]
    fn guesses_with_a_voltage_in_place_of_the_velocity_names_no_velocity() {
        let voltage: fn(f64) -> f64 = |t| 2.1 * VELOCITY(t) + 3.0 * TORQUE(t);
        let found = first(&[|t| t, POSITION, voltage, TORQUE]);
        assert_eq!(found, ["1=time_s", "2=position_rad", "", "4=torque_nm"]);
    }

    #[test]
    fn guesses_of_many_turns_names_both_units() {
        let found = suggested(&[|t| t, |t| 1e3 * POSITION(t), |t| 1e3 * VELOCITY(t), TORQUE]);
        assert_eq!(found[1], ["2=position_rad", "2=position_rad:deg"]);
        assert_eq!(found[2], ["3=velocity_rad_s", "3=velocity_rad_s:deg/s"]);
    }
}
