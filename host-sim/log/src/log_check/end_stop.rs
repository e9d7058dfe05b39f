//! A joint that is pushed against an end stop: at rest at an end of its travel, with more torque than any motion took.
//!
//! Static friction holds a joint at rest up to the torque at which it breaks away, so the torque of a rest that exceeds all
//! torques of the motion of the same run is held by something else. That motion may be too fast to show how much the friction
//! rises towards rest, so all slow rows of the log count too, but those that push outwards at an end. The stop's torque is no
//! friction. Such rows are left out.
//!
//! Without a position, the integral of the velocity shows the ends of the travel, in each part of a run without gaps.

use super::LogFindingKind;
use super::finding::LogFinding;
use super::position_jump::mean_travel;
use super::rows::{Rows, first_in_words, leave_out};
use crate::dataset::Place;
use crate::number::figure;
use crate::segment::stretches;
use crate::statistics::{extent, quantile};
use crate::torque_fit::least_moving_speed;
use crate::{Dataset, Run, segments};
use compensator_core::quantity::Quantity;
use std::borrow::Cow;
use std::ops::Range;

/// Minimum number of consecutive rows at a stop.
const MIN_CONSECUTIVE_ROWS: usize = 5;

/// Minimum largest torque of a push, in the largest torque of the motion and of the slow rows.
const MIN_TORQUE_RATIO: f64 = 1.3;

/// Quantile of the torques that stands for the largest one: single rows may be outliers.
const LARGEST: f64 = 0.995;

/// Maximum distance from the end of the travel, as a share of it. A stop yields.
const MAX_DISTANCE_SHARE: f64 = 0.03;

/// Maximum share of such rows.
const MAX_SHARE: f64 = 0.5;

/// Minimum share of the rows of a run in which it moves, for its torques to show what motion takes.
const MIN_MOVING_SHARE: f64 = 0.2;

/// Finds rows at an end stop, and leaves them out if `correct` is true.
pub fn end_stop(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let rows = rows_at_stop(&data);
    if rows.is_empty() || rows.len() as f64 > MAX_SHARE * data.rows as f64 {
        return (data, Vec::new());
    }
    let torque = |place: &Place| data.runs[place.run].torque[place.row].abs();
    let torque = rows.iter().map(torque).fold(0.0, f64::max);
    let (count, place) = (rows.len(), first_in_words(&rows, &data));
    let (name, unit) = (Quantity::Torque.name(data.joint), data.joint.torque_unit());
    let done = if correct { "They are left out" } else { "They are left in, as asked" };
    let words = format!(
        "In {count} rows (first in {place}) the joint rests at an end of its travel with up to {} {unit}, more than any motion \
             took: it is pushed against an end stop. {done}.",
        figure(torque)
    );
    let position = data.columns_of(Quantity::Position).map(|_| Quantity::Position);
    let motion = position.unwrap_or(Quantity::Velocity).name(data.joint);
    let finding =
        LogFindingKind::EndStop.finding(&[motion, name], torque, unit, words).corrected(correct);
    if correct {
        leave_out(&mut data, &rows);
    }
    (data, vec![finding])
}

/// Rows of a run with a known travel.
struct Course<'a> {
    run: usize,
    rows: Range<usize>,
    /// Position of each of the rows, rad or m.
    position: Cow<'a, [f64]>,
    /// The ends of the travel.
    ends: [f64; 2],
}

impl Course<'_> {
    /// Returns the end of the travel against which a row pushes, if it rests there.
    fn end(&self, run: &Run, at: usize, slow: f64) -> Option<f64> {
        let row = self.rows.start + at;
        // The torque pushes outwards, at either end.
        let end = self.ends[usize::from(run.torque[row] > 0.0)];
        (run.velocity[row].abs() <= slow && self.is_near(at, end)).then_some(end)
    }

    fn is_near(&self, at: usize, end: f64) -> bool {
        let reach = MAX_DISTANCE_SHARE * (self.ends[1] - self.ends[0]);
        (self.position[at] - end).abs() <= reach
    }
}

/// Returns the courses of all rows, by the position or else by the integral of the velocity.
fn courses(data: &Dataset) -> Vec<Course<'_>> {
    let mut courses = Vec::new();
    if let Some(positions) = data.columns_of(Quantity::Position) {
        let ends = extent(positions.iter().flat_map(|position| position.iter().copied()));
        for (run, position) in positions.into_iter().enumerate() {
            let (rows, position) = (0..position.len(), position.into());
            courses.push(Course { run, rows, position, ends });
        }
        return courses;
    }
    for (run, of) in data.runs.iter().enumerate() {
        for rows in segments(of) {
            let mut travel = 0.0;
            let travels = (rows.start + 1..rows.end).map(|row| {
                travel += mean_travel(of, row);
                travel
            });
            let position: Vec<f64> = std::iter::once(0.0).chain(travels).collect();
            let ends = extent(position.iter().copied());
            courses.push(Course { run, rows, position: position.into(), ends });
        }
    }
    courses
}

/// Returns the rows at a stop.
fn rows_at_stop(data: &Dataset) -> Rows {
    let slow = least_moving_speed(data);
    let usual: Vec<Option<f64>> = data.runs.iter().map(|run| usual_torque(run, slow)).collect();
    let courses = courses(data);
    let ends_of = |course: &Course| -> Vec<Option<f64>> {
        (0..course.rows.len()).map(|at| course.end(&data.runs[course.run], at, slow)).collect()
    };
    let ends: Vec<Vec<Option<f64>>> = courses.iter().map(ends_of).collect();
    let static_torque = largest_slow_torque(data, &courses, &ends, slow);
    let mut found = Rows::new();
    for (course, ends) in courses.iter().zip(&ends) {
        let (run, Some(usual)) = (&data.runs[course.run], usual[course.run]) else { continue };
        let count = course.rows.len();
        for stretch in stretches(ends, |one, next| one == next) {
            let length = stretch.len();
            let end = ends[stretch.start].filter(|_| length >= MIN_CONSECUTIVE_ROWS);
            let Some(end) = end else { continue };
            let torques = &run.torque[course.rows.clone()][stretch.clone()];
            let push = torques.iter().fold(0.0, |most: f64, torque| most.max(torque.abs()));
            if push > MIN_TORQUE_RATIO * usual.max(static_torque) {
                // The stop yields while the joint arrives and leaves.
                let is_near = |at: &usize| course.is_near(*at, end);
                let (before, after) = ((0..stretch.start).rev(), stretch.end..count);
                let beside = before.take(length).take_while(is_near);
                let rows = beside.chain(after.take(length).take_while(is_near)).chain(stretch);
                found.extend(rows.map(|at| Place { run: course.run, row: course.rows.start + at }));
            }
        }
    }
    found
}

/// Returns the largest torque of the slow rows that push against no end; 0 without one.
fn largest_slow_torque(
    data: &Dataset,
    courses: &[Course],
    ends: &[Vec<Option<f64>>],
    slow: f64,
) -> f64 {
    let mut torques = Vec::new();
    for (course, ends) in courses.iter().zip(ends) {
        let run = &data.runs[course.run];
        let free = course.rows.clone().zip(ends).filter(|(_, end)| end.is_none());
        let slow_rows = free.filter(|(row, _)| run.velocity[*row].abs() <= slow);
        torques.extend(slow_rows.map(|(row, _)| run.torque[row].abs()));
    }
    quantile(&mut torques, LARGEST).unwrap_or_default()
}

/// Returns the largest torque of a run's motion; `None` for a run that hardly moves, whose friction may differ from that of others.
fn usual_torque(run: &Run, slow: f64) -> Option<f64> {
    let rows = run.torque.iter().zip(&run.velocity);
    let moving = rows.filter(|(_, velocity)| velocity.abs() > slow);
    let mut torques: Vec<f64> = moving.map(|(torque, _)| torque.abs()).collect();
    let moves = torques.len() as f64 > MIN_MOVING_SHARE * run.len() as f64;
    quantile(&mut torques, LARGEST).filter(|_| moves)
}
