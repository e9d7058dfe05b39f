//! A joint that is pushed against an end stop: at rest at an end of its travel, with more torque than any motion took.
//!
//! Static friction holds a joint at rest up to the torque at which it breaks away, so the torque of a rest that exceeds all
//! torques of the motion of the same run is held by something else. The stop's torque is no friction. Such rows are left out.

use super::LogFindingKind;
use super::finding::LogFinding;
use super::rows::{Rows, first_in_words, leave_out};
use crate::dataset::Place;
use crate::number::figure;
use crate::statistics::{extent, quantile};
use crate::torque_fit::least_moving_speed;
use crate::{Dataset, Run};
use compensator_core::quantity::Quantity;
use std::collections::BTreeSet;

/// Minimum number of consecutive rows at a stop.
const MIN_CONSECUTIVE_ROWS: usize = 5;

/// Minimum largest torque of a push, in the 99.5th percentile of the torques of the motion.
const MIN_TORQUE_RATIO: f64 = 1.3;

/// Maximum distance from the end of the travel, as a share of it. A stop yields.
const MAX_DISTANCE_SHARE: f64 = 0.03;

/// Maximum share of such rows.
const MAX_SHARE: f64 = 0.5;

/// Minimum share of the rows of a run in which it moves, for its torques to show what motion takes.
const MIN_MOVING_SHARE: f64 = 0.2;

/// Finds rows at an end stop, and leaves them out if `correct` is true.
pub fn end_stop(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let Some((rows, torque)) = rows_at_stop(&data) else { return (data, Vec::new()) };
    let places =
        |(run, rows): (usize, BTreeSet<usize>)| rows.into_iter().map(move |row| Place { run, row });
    let rows: Rows = rows.into_iter().enumerate().flat_map(places).collect();
    let (count, place) = (rows.len(), first_in_words(&rows, &data));
    let (name, unit) = (Quantity::Torque.name(data.joint), data.joint.torque_unit());
    let done = if correct { "They are left out" } else { "They are left in, as asked" };
    let words = format!(
        "In {count} rows (first in {place}) the joint rests at an end of its travel with up to {} {unit}, more than any motion \
             took: it is pushed against an end stop. {done}.",
        figure(torque)
    );
    let finding = LogFindingKind::EndStop
        .finding(&[Quantity::Position.name(data.joint), name], torque, unit, words)
        .corrected(correct);
    if correct {
        leave_out(&mut data, &rows);
    }
    (data, vec![finding])
}

/// Returns the rows of each run at a stop, and the largest torque there.
fn rows_at_stop(data: &Dataset) -> Option<(Vec<BTreeSet<usize>>, f64)> {
    let positions = data.columns_of(Quantity::Position)?;
    let [least, most] = extent(positions.iter().flat_map(|run| run.iter().copied()));
    let reach = MAX_DISTANCE_SHARE * (most - least);
    let slow = least_moving_speed(data);
    let side = |run: &Run, position: f64, row: usize| {
        let rests = run.velocity[row].abs() <= slow;
        let is_end = |end: f64| rests && (position - end).abs() <= reach;
        // The torque pushes outwards, at either end.
        match (is_end(least), is_end(most), run.torque[row] > 0.0) {
            (true, _, false) => -1,
            (_, true, true) => 1,
            _ => 0,
        }
    };
    let (mut found, mut largest) = (Vec::new(), 0.0f64);
    for (run, position) in data.runs.iter().zip(&positions) {
        let Some(usual) = usual_torque(run, slow) else {
            found.push(BTreeSet::new());
            continue;
        };
        let sides: Vec<i32> = (0..run.len()).map(|row| side(run, position[row], row)).collect();
        let (mut rows, mut at) = (BTreeSet::new(), 0);
        for same in sides.chunk_by(|one, next| one == next) {
            let stretch = at..at + same.len();
            at = stretch.end;
            let push =
                run.torque[stretch.clone()].iter().fold(0.0, |most: f64, t| most.max(t.abs()));
            let is_push = same[0] != 0 && same.len() >= MIN_CONSECUTIVE_ROWS;
            if is_push && push > MIN_TORQUE_RATIO * usual {
                largest = largest.max(push);
                // The stop yields while the joint arrives and leaves.
                let end = if same[0] < 0 { least } else { most };
                let is_near = |row: &usize| (position[*row] - end).abs() <= reach;
                let most_beside = stretch.len();
                rows.extend((0..stretch.start).rev().take(most_beside).take_while(is_near));
                rows.extend((stretch.end..run.len()).take(most_beside).take_while(is_near));
                rows.extend(stretch);
            }
        }
        found.push(rows);
    }
    let count: usize = found.iter().map(BTreeSet::len).sum();
    (count > 0 && count as f64 <= MAX_SHARE * data.rows as f64).then_some((found, largest))
}

/// Returns the largest torque of a run's motion; `None` for a run that hardly moves, whose friction may differ from that of others.
fn usual_torque(run: &Run, slow: f64) -> Option<f64> {
    let rows = run.torque.iter().zip(&run.velocity);
    let moving = rows.filter(|(_, velocity)| velocity.abs() > slow);
    let mut torques: Vec<f64> = moving.map(|(torque, _)| torque.abs()).collect();
    let moves = torques.len() as f64 > MIN_MOVING_SHARE * run.len() as f64;
    quantile(&mut torques, 0.995).filter(|_| moves)
}
