//! Positions that jump farther than any speed allows: blocks of rows are lost or out of order, or a count slipped.
//!
//! The travel from row to row is compared with the logged velocity and with the travel beside it. A jump contradicts both. What
//! happened in between is unknown, so no computation crosses it: the run continues as another piece ([`crate::Run::pieces`]).
//! This needs no clock. A slip of a joint that sticks has a speed, which the row beside it shows.

use super::LogFindingKind;
use super::finding::LogFinding;
use super::wrap::is_velocity_derived;
use crate::dataset::Place;
use crate::motion::quantum;
use crate::number::figure;
use crate::statistics::{median, quantile, quantile_range};
use crate::{Dataset, Run, segments};
use compensator_core::quantity::Quantity;
use std::ops::Range;

/// Minimum jump, in the 99th percentile of the travel of a row that its velocity explains; and of a log without a velocity.
const MIN_TRAVELS: f64 = 1.5;
const MIN_TRAVELS_ALONE: f64 = 3.0;

/// Minimum jump, in the 90th percentile of what travel and velocity differ by, and in steps of the position.
const MIN_DIFFERENCES: f64 = 10.0;
const MIN_QUANTA: f64 = 4.0;

/// Maximum share of rows with a jump.
const MAX_SHARE: f64 = 0.1;

/// Changes on either side of a change from which its travel is estimated.
const NEIGHBOURS: usize = 3;

/// Minimum share of a jump that stays.
const MIN_STAYING_SHARE: f64 = 0.75;

/// Rows on either side of a jump whose medians show that it stays.
const MEDIAN_ROWS: usize = 5;

/// Maximum number of jumps that are listed.
const LISTED: usize = 5;

/// A row before which the position jumps.
struct Jump {
    place: Place,
    size: f64,
    /// The speed beside it.
    speed: f64,
}

/// Finds jumps of the position, and ends the pieces of the runs there if `correct` is true.
pub fn position_jumps(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let Some(jumps) = jumps(&data) else { return (data, Vec::new()) };
    let largest = jumps.iter().map(|jump| jump.size).fold(0.0, f64::max);
    let listed = jumps.iter().take(LISTED);
    let mut places: Vec<String> = listed.map(|jump| jump.place.in_words(&data)).collect();
    if jumps.len() > LISTED {
        places.push("..".into());
    }
    let (name, unit) = (Quantity::Position.name(data.joint), data.joint.position_unit());
    let done =
        if correct { "The parts between are used separately." } else { "Nothing is changed." };
    let words = format!(
        "{name} jumps at {} rows by up to {} {unit}, farther than any speed of the log allows ({}): rows are lost or out of \
             order there, or the count slipped. {done}",
        jumps.len(),
        figure(largest),
        places.join(", ")
    );
    let finding =
        LogFindingKind::PositionJump.finding(&[name], largest, unit, words).corrected(correct);
    if correct {
        cut(&mut data, &jumps);
    }
    (data, vec![finding])
}

/// Begins a new piece at each jump. A velocity that was derived from the position is derived again.
fn cut(data: &mut Dataset, jumps: &[Jump]) {
    let is_derived = is_velocity_derived(data);
    for (index, run) in data.runs.iter_mut().enumerate() {
        let of_run = jumps.iter().map(|jump| jump.place).filter(|place| place.run == index);
        let rows: Vec<usize> = of_run.map(|place| place.row).collect();
        if rows.is_empty() {
            continue;
        }
        run.pieces =
            (0..run.len()).map(|row| rows.partition_point(|at| *at <= row) as f64).collect();
        if is_derived {
            run.derive_velocity();
        }
    }
}

/// Returns the jumps; `None` if there are none, or too many for single events.
fn jumps(data: &Dataset) -> Option<Vec<Jump>> {
    let positions = data.columns_of(Quantity::Position)?;
    let is_derived = is_velocity_derived(data);
    let gain = if is_derived { None } else { velocity_gain(data, &positions) };
    let (mut all, mut explained, mut changes) = (Vec::new(), Vec::new(), Vec::new());
    for (index, (run, position)) in data.runs.iter().zip(&positions).enumerate() {
        for rows in segments(run) {
            let steps = steps(run, position, rows);
            for (at, step) in steps.iter().enumerate() {
                let expected = match gain {
                    Some(gain) => gain * travel_of_velocity(run, step),
                    None => speed_beside(&steps, at) * step.time_s,
                };
                explained.push(expected.abs() / step.count() as f64);
                let place = Place { run: index, row: step.row };
                all.push(Jump { place, size: step.beyond(expected), speed: 0.0 });
            }
            changes.push(steps);
        }
    }
    let mut sizes: Vec<f64> = all.iter().map(|jump| jump.size).collect();
    let travels = if gain.is_some() { MIN_TRAVELS } else { MIN_TRAVELS_ALONE };
    let least = (travels * quantile(&mut explained, 0.99).unwrap_or_default())
        .max(MIN_DIFFERENCES * quantile(&mut sizes, 0.9).unwrap_or_default())
        .max(MIN_QUANTA * quantum(positions.iter().copied()));
    let rows = all.len();
    // The travel beside a row is needed for the few that differ from their velocity only.
    let mut changes = changes.iter().flat_map(|steps| (0..steps.len()).map(move |at| (steps, at)));
    for jump in &mut all {
        let (steps, at) = changes.next()?;
        if jump.size > least {
            jump.speed = speed_beside(steps, at);
            jump.size = jump.size.min(steps[at].beyond(jump.speed * steps[at].time_s));
        }
    }
    all.retain(|jump| {
        let index = jump.place.run;
        jump.size > least && stays(&data.runs[index], positions[index], jump, gain)
    });
    (!all.is_empty() && all.len() as f64 <= MAX_SHARE * rows as f64).then_some(all)
}

/// Returns true if the position stays where it jumped to: without the travel of the velocity, or else of the speed beside it, the
/// medians of the rows before and after are as far apart. A failed reading returns, and a late stamp is made up for.
fn stays(run: &Run, position: &[f64], jump: &Jump, gain: Option<f64>) -> bool {
    let travel = |from: usize, to: usize| match gain {
        Some(gain) => gain * (from + 1..=to).map(|row| mean_travel(run, row)).sum::<f64>(),
        None => jump.speed * (run.time_s[to] - run.time_s[from]),
    };
    let start = jump.place.row;
    let at = |row: usize| match row < start {
        true => position[row] + travel(row, start),
        false => position[row] - travel(start, row),
    };
    let (first, last) = (start.saturating_sub(MEDIAN_ROWS), (start + MEDIAN_ROWS).min(run.len()));
    let median =
        |rows: Range<usize>| median(&mut rows.map(at).collect::<Vec<_>>()).unwrap_or_default();
    (median(start..last) - median(first..start)).abs() > MIN_STAYING_SHARE * jump.size
}

/// A change of the position, from the last row before which it changed too.
pub struct Step {
    pub from: usize,
    pub row: usize,
    pub travel: f64,
    pub time_s: f64,
}

impl Step {
    /// Returns the number of rows.
    pub fn count(&self) -> usize {
        self.row - self.from
    }

    /// Returns by how much the travel exceeds the expected one. A joint that starts after a rest travels less, which is no jump.
    fn beyond(&self, expected: f64) -> f64 {
        match self.travel * expected < 0.0 {
            true => self.travel.abs(),
            false => (self.travel.abs() - expected.abs()).max(0.0),
        }
    }
}

/// Returns the changes of a position in a segment.
pub fn steps(run: &Run, position: &[f64], rows: Range<usize>) -> Vec<Step> {
    let mut from = rows.start;
    let mut found = Vec::new();
    for row in rows.start + 1..rows.end {
        if position[row] != position[from] {
            let (travel, time_s) =
                (position[row] - position[from], run.time_s[row] - run.time_s[from]);
            found.push(Step { from, row, travel, time_s });
            from = row;
        }
    }
    found
}

/// Returns the median speed of the changes beside one.
pub fn speed_beside(steps: &[Step], at: usize) -> f64 {
    let near = at.saturating_sub(NEIGHBOURS)..(at + NEIGHBOURS + 1).min(steps.len());
    let speed = |near: usize| steps[near].travel / steps[near].time_s;
    let mut speeds: Vec<f64> =
        near.filter(|near| *near != at && steps[*near].time_s > 0.0).map(speed).collect();
    median(&mut speeds).unwrap_or_default()
}

/// Returns the travel of a change by the velocity.
fn travel_of_velocity(run: &Run, step: &Step) -> f64 {
    (step.from + 1..=step.row).map(|row| mean_travel(run, row)).sum()
}

/// Returns the travel of a row by its velocity.
pub fn mean_travel(run: &Run, row: usize) -> f64 {
    0.5 * (run.velocity[row] + run.velocity[row - 1]) * (run.time_s[row] - run.time_s[row - 1])
}

/// Returns the travel of the position per travel of the velocity, by the median of the rows that travel most; `None` if the
/// velocity does not follow the position.
pub fn velocity_gain(data: &Dataset, positions: &[&[f64]]) -> Option<f64> {
    let runs = data.runs.iter().zip(positions);
    let mut pairs: Vec<(f64, f64)> = runs
        .flat_map(|(run, position)| {
            let rows = segments(run).into_iter().flat_map(|rows| rows.start + 1..rows.end);
            rows.map(|row| (mean_travel(run, row), position[row] - position[row - 1]))
        })
        .collect();
    let fast =
        median(&mut pairs.iter().map(|pair| pair.0.abs()).collect::<Vec<_>>()).unwrap_or_default();
    pairs.retain(|(by_velocity, _)| by_velocity.abs() > fast.max(0.0));
    let ratio = |(by_velocity, travel): &(f64, f64)| travel / by_velocity;
    let mut ratios: Vec<f64> = pairs.iter().map(ratio).collect();
    let gain = median(&mut ratios).unwrap_or_default();
    let spread = quantile_range(&mut ratios, 0.25);
    (gain != 0.0 && spread < 0.5 * gain.abs()).then_some(gain)
}
