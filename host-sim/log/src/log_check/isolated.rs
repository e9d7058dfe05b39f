//! Single rows far off their neighbours: a wrap of an encoder that lasts for one row, a failed reading inside the range.
//!
//! A joint has inertia, so its position and velocity cannot leave their course for one row and return. Such a row is far from
//! the line between its neighbours, measured in usual steps from row to row, while the neighbours agree. It is left out. A
//! velocity must also be off by a part of its range, and must not be a slip of a joint that sticks. A torque, which a shock does
//! change for one row, must be off by twice its range. A single position of a log without a velocity is also found in fast motion:
//! both its neighbours are half as far off the lines through them, to the other side.

use super::finding::{LogFinding, LogFindingKind};
use super::rows::{Rows, leave_out};
use super::spike;
use super::wrap::is_velocity_derived;
use crate::dataset::Place;
use crate::motion::quantum;
use crate::number::figure;
use crate::statistics::{quantile, quantile_range};
use crate::{Dataset, Run, segments};
use compensator_core::quantity::Quantity;
use std::ops::Range;

/// Minimum distance from the line between the neighbours, in large steps of the column from row to row.
const MIN_STEPS: f64 = 8.0;

/// Quantile of the steps that counts as large.
const LARGE_STEP: f64 = 0.9;

/// Minimum distance of a quantised column, in its quanta.
const MIN_QUANTA: f64 = 24.0;

/// Minimum distance of a velocity and of a torque, in ranges of the middle 98 %.
const MIN_VELOCITY_RANGES: f64 = 0.25;
const MIN_TORQUE_RANGES: f64 = 2.0;

/// Maximum speed of rest, as a share of the 95th percentile of speed.
const MAX_REST_SHARE: f64 = 0.05;

/// Minimum share of a single velocity's travel in the position that confirms it.
const MIN_CONFIRMED_SHARE: f64 = 0.5;

/// Maximum difference of the neighbours, as a share of the distance.
const MAX_NEIGHBOUR_SHARE: f64 = 0.25;

/// Maximum number of consecutive rows.
const MAX_CONSECUTIVE_ROWS: usize = 3;

/// Maximum share of such rows. A column with more has another fault.
const MAX_SHARE: f64 = 0.02;

/// Finds single rows far off their neighbours, and leaves them out if `correct` is true.
pub fn isolated(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let mut findings = Vec::new();
    for quantity in [Quantity::Position, Quantity::Velocity, Quantity::Torque] {
        let Some(found) = Isolated::find(&data, quantity) else { continue };
        findings.push(found.finding(&data, quantity, correct));
        if correct {
            found.leave_out(&mut data, quantity);
        }
    }
    (data, findings)
}

/// A row with its distance from the course of its neighbours, in the unit of the column.
struct OffRow {
    row: usize,
    distance: f64,
}

/// The rows of a column that are far off their neighbours.
struct Isolated {
    rows: Rows,
    /// The row with the largest distance.
    farthest: Place,
    distance: f64,
}

impl Isolated {
    fn find(data: &Dataset, quantity: Quantity) -> Option<Self> {
        let columns = data.columns_of(quantity)?;
        let least = least_distance(data, &columns, quantity)?;
        let (is_alone, bend) = (is_velocity_derived(data), least_bend(data, &columns));
        let mut speeds: Vec<f64> =
            columns.iter().flat_map(|run| run.iter().map(|v| v.abs())).collect();
        let slow = MAX_REST_SHARE * quantile(&mut speeds, 0.95).unwrap_or_default();
        let mut found = Self { rows: Rows::new(), farthest: Place::default(), distance: 0.0 };
        for (index, (run, values)) in data.runs.iter().zip(&columns).enumerate() {
            for segment in segments(run) {
                let mut found_here = isolated_rows(&run.time_s, values, segment.clone(), least);
                if quantity == Quantity::Position && is_alone {
                    found_here.extend(bent_rows(&run.time_s, values, segment, bend));
                }
                for OffRow { row, distance } in found_here {
                    if quantity == Quantity::Velocity && may_be_slip(run, row, slow) {
                        continue;
                    }
                    let place = Place { run: index, row };
                    found.rows.insert(place);
                    if distance > found.distance {
                        (found.farthest, found.distance) = (place, distance);
                    }
                }
            }
        }
        // Many spikes of the torque keep their motion (`spike`).
        let most = if quantity == Quantity::Torque { spike::MIN_SHARE } else { MAX_SHARE };
        let share = found.rows.len() as f64 / data.rows.max(1) as f64;
        (!found.rows.is_empty() && share < most).then_some(found)
    }

    fn finding(&self, data: &Dataset, quantity: Quantity, correct: bool) -> LogFinding {
        let name = quantity.name(data.joint);
        let Place { run, row } = self.farthest;
        let value = data.runs[run].get(quantity).map_or(f64::NAN, |values| values[row]);
        let unit = quantity.unit(data.joint);
        let (rows, done) = match (self.rows.len(), correct) {
            (1, true) => ("1 row".to_owned(), "it is left out"),
            (count, true) => (format!("{count} rows"), "they are left out"),
            (1, false) => ("1 row".to_owned(), "left in, as asked"),
            (count, false) => (format!("{count} rows"), "left in, as asked"),
        };
        let words = format!(
            "{rows} of {name} cannot be: each leaves the course of its neighbours and returns at once (the farthest is \
                 {} {unit} off, in {}): {done}.",
            figure(self.distance),
            self.farthest.in_words(data)
        );
        LogFindingKind::Outlier.finding(&[name], value, unit, words).corrected(correct)
    }

    /// Leaves the rows out. A velocity that was derived from the position is derived again.
    fn leave_out(&self, data: &mut Dataset, quantity: Quantity) {
        let is_derived = quantity == Quantity::Position && is_velocity_derived(data);
        leave_out(data, &self.rows);
        if is_derived {
            data.runs.iter_mut().for_each(Run::derive_velocity);
        }
    }
}

/// Returns true if a single velocity may be a slip of a joint that sticks: the position confirms it, or, without a position,
/// the joint rests before and after. `slow` is the maximum speed of rest.
fn may_be_slip(run: &Run, row: usize, slow: f64) -> bool {
    let (before, after) = (row - 1, (row + 1).min(run.len() - 1));
    let ends = [run.velocity[before], run.velocity[after]];
    let Some(position) = run.get(Quantity::Position) else {
        return ends.iter().all(|velocity| velocity.abs() < slow);
    };
    let step = run.time_s[after] - run.time_s[before];
    let mean = 0.5 * (ends[0] + ends[1]);
    let travel = position[after] - position[before] - step * mean;
    travel.abs() > MIN_CONFIRMED_SHARE * 0.5 * step * (run.velocity[row] - mean).abs()
}

/// Returns the minimum distance of a row from the line between its neighbours; `None` for a constant column.
fn least_distance(data: &Dataset, columns: &[&[f64]], quantity: Quantity) -> Option<f64> {
    let steps = columns.iter().flat_map(|values| values.windows(2).map(|w| (w[1] - w[0]).abs()));
    // A joint at rest would make the steps of its motion look large.
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    let large = quantile(&mut steps, LARGE_STEP).unwrap_or_default();
    let least = (MIN_STEPS * large).max(MIN_QUANTA * quantum(columns.iter().copied()));
    let ranges = match quantity {
        Quantity::Velocity => MIN_VELOCITY_RANGES,
        Quantity::Torque => MIN_TORQUE_RANGES,
        _ => 0.0,
    };
    let mut all: Vec<f64> = columns.iter().flat_map(|values| values.iter().copied()).collect();
    let range = quantile_range(&mut all, 0.01);
    let has_rows = data.rows > MAX_CONSECUTIVE_ROWS + 2;
    (has_rows && large > 0.0).then_some(least.max(ranges * range))
}

/// Returns the rows of a segment that leave the line between their neighbours by `least` and return, with their distances.
fn isolated_rows(time: &[f64], values: &[f64], segment: Range<usize>, least: f64) -> Vec<OffRow> {
    let mut found = Vec::new();
    let mut row = segment.start + 1;
    while row < segment.end {
        let group = (1..=MAX_CONSECUTIVE_ROWS).find_map(|count| {
            let (before, after) = (row - 1, row + count);
            if after >= segment.end {
                return None;
            }
            let off = |row: usize| {
                let distance = off_line(time, values, [before, row, after]).abs();
                OffRow { row, distance }
            };
            let off: Vec<OffRow> = (row..after).map(off).collect();
            let nearest = off.iter().map(|of| of.distance).fold(f64::INFINITY, f64::min);
            let rise = values[after] - values[before];
            let returns = rise.abs() < MAX_NEIGHBOUR_SHARE * nearest;
            (nearest > least && returns).then_some(off)
        });
        match group {
            Some(rows) => {
                row += rows.len() + 1;
                found.extend(rows);
            }
            None => row += 1,
        }
    }
    found
}

/// Returns the distance of the middle of three rows from the line through the outer ones.
fn off_line(time: &[f64], values: &[f64], [before, row, after]: [usize; 3]) -> f64 {
    let step = time[after] - time[before];
    let share = if step > 0.0 { (time[row] - time[before]) / step } else { 0.5 };
    values[row] - values[before] - share * (values[after] - values[before])
}

fn bend(time: &[f64], values: &[f64], row: usize) -> f64 {
    off_line(time, values, [row - 1, row, row + 1])
}

/// Returns the minimum distance of a single position from the line through its neighbours.
fn least_bend(data: &Dataset, columns: &[&[f64]]) -> f64 {
    let runs = data.runs.iter().zip(columns);
    let bends = runs.flat_map(|(run, values)| {
        let rows = 1..values.len().saturating_sub(1).max(1);
        rows.map(|row| bend(&run.time_s, values, row).abs())
    });
    let usual = quantile(&mut bends.collect::<Vec<_>>(), LARGE_STEP).unwrap_or_default();
    (MIN_STEPS * usual).max(MIN_QUANTA * quantum(columns.iter().copied()))
}

/// Returns the single rows of a segment by which both neighbours are off their lines by half as much, with their distances.
fn bent_rows(time: &[f64], values: &[f64], segment: Range<usize>, least: f64) -> Vec<OffRow> {
    let inner = segment.start + 2..segment.end.saturating_sub(2);
    let bent = |row: usize| {
        let bend_here = bend(time, values, row);
        let is_half = |near: usize| (0.3..0.7).contains(&(-bend(time, values, near) / bend_here));
        (bend_here.abs() > least && is_half(row - 1) && is_half(row + 1))
            .then_some(OffRow { row, distance: bend_here.abs() })
    };
    inner.filter_map(bent).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 2000;

    /// A swing of several turns, with noise, in which `spoil` changes rows.
    fn log(spoil: impl Fn(usize, &mut [f64; 3])) -> Dataset {
        let names = ["time_s", "position_rad", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let mut columns = vec![Vec::new(); 4];
        for row in 0..ROWS {
            let t = 0.01 * row as f64;
            let noise = 1e-3 * ((row * 7919 % 101) as f64 / 50.0 - 1.0);
            let velocity = 9.0 * (1.3 * t).cos() + noise;
            let position = 9.0 / 1.3 * (1.3 * t).sin() + noise;
            let mut cells = [position, velocity, 1.2 * velocity.signum() + 0.35 * velocity + noise];
            spoil(row, &mut cells);
            columns[0].push(t);
            columns[1..].iter_mut().zip(cells).for_each(|(column, cell)| column.push(cell));
        }
        Dataset::from_columns(&names, [("a".to_owned(), columns)]).expect("columns")
    }

    #[test]
    fn isolated_rows_inside_the_range_are_left_out() {
        let sizes = [
            (0, "position_rad", std::f64::consts::TAU),
            (1, "velocity_rad_s", 6.0),
            (2, "torque_nm", 30.0),
        ];
        for (column, name, size) in sizes {
            let spoil = |row: usize, cells: &mut [f64; 3]| {
                if row % 400 == 150 {
                    cells[column] += size;
                }
            };
            let (data, findings) = isolated(log(spoil), true);
            assert_eq!(findings.len(), 1, "{name}: {findings:?}");
            assert_eq!((findings[0].columns[0].as_str(), data.rows), (name, ROWS - 5));
            assert!(findings[0].in_words.contains("5 rows"), "{}", findings[0].in_words);
            let (kept, findings) = isolated(log(spoil), false);
            assert_eq!((kept.rows, findings[0].corrected), (ROWS, false));
        }
    }

    #[test]
    fn isolated_with_clean_log_steps_or_shocks_returns_log_unchanged() {
        let step = |row: usize, cells: &mut [f64; 3]| {
            if row > 700 {
                cells[0] += 3.0;
            }
        };
        let shock = |row: usize, cells: &mut [f64; 3]| {
            if row % 500 == 20 {
                cells[2] += 3.0;
            }
        };
        // A slip of one row, which the position confirms.
        let slip = |row: usize, cells: &mut [f64; 3]| {
            let is_slip = row > 0 && row.is_multiple_of(500);
            cells[0] += 0.05 * (row / 500) as f64 - if is_slip { 0.025 } else { 0.0 };
            cells[1] += if is_slip { 5.0 } else { 0.0 };
        };
        assert_eq!(isolated(log(slip), true).1, Vec::new());
        for spoil in
            [&(|_: usize, _: &mut [f64; 3]| {}) as &dyn Fn(usize, &mut [f64; 3]), &step, &shock]
        {
            let (data, findings) = isolated(log(spoil), true);
            assert_eq!((data.rows, findings), (ROWS, Vec::new()));
        }
    }
}
