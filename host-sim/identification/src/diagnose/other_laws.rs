//! What a law of another shape would do: columns that no cause may live on.
//!
//! No joint is its law. Where a seal gives way in several steps, or its friction falls with speed by another curve, or late,
//! the residual holds that wherever the joint reverses, slows down or speeds up; and whatever goes with the motion too (a
//! load that swings with it, an acceleration, a drag) explains a part. So every finding is asked in the review what it
//! still gains where bristles of other stiffnesses, levels that fall off at other speeds, and those a moment late, have taken
//! theirs. On 78 drawn worlds true causes kept 0.37 to 1.2 of their gain; of what was named wrongly a third, an inertia, drags,
//! loads and curves over the speed, kept -0.1 to 0.13, the rest 0.6 and more.

use super::candidate::{Beside, Regressor, Row, row};
use super::sensitivities::Exact;
use super::train_test::TrainTest;
use compensator_core::{ParameterId as Id, TermKind};

/// Bristles of these multiples of the model's stiffness.
const STIFFNESSES: [f64; 2] = [4.0, 0.25];

/// Levels that fall off above these shares of the log's top speed. At 0.4 the curve is nearly that of a drag, and a true one
/// would lose to it.
const SPEEDS: [f64; 2] = [0.05, 0.15];

/// Of the speeds of a log, so many percent lie below its top speed.
const TOP_PERCENT: usize = 95;

/// The columns of other laws beside a model.
pub fn columns(beside: &Beside) -> Vec<Regressor> {
    let stiffness = beside.at.parameters.get(Id::BristleStiffness);
    let bristles = |times: f64| {
        let settings = vec![(Id::BacklashTravel, 0.0), (Id::BristleStiffness, times * stiffness)];
        Regressor::Exact(Exact { kind: TermKind::Backlash, settings, derivative: None })
    };
    let falls_off = |speed: f64| {
        row(move |r: &Row| {
            let share = r.sample.velocity_rad_s / speed;
            r.level * (-share * share).exp()
        })
    };
    // The same, later by a moment, less itself: friction remembers the speed it had.
    let remembers = |speed: f64| {
        row(move |r: &Row| {
            let share = r.sample.velocity_rad_s / speed;
            let rate = -2.0 * share * r.sample.acceleration_rad_s2 / speed;
            r.level * (-share * share).exp() * rate
        })
    };
    let bristles_of = STIFFNESSES.into_iter().filter(|_| beside.spec.law.has_bristles());
    let top = top_speed(beside.log);
    let speeds = SPEEDS.into_iter().map(|share| share * top).filter(|speed| *speed > 0.0);
    let of_speed = speeds.flat_map(|speed| [falls_off(speed), remembers(speed)]);
    bristles_of.map(bristles).chain(of_speed).collect()
}

fn top_speed(log: &TrainTest) -> f64 {
    let samples = log.train_tracks.iter().flat_map(|track| &track.samples);
    let mut speeds: Vec<f64> = samples.map(|sample| sample.velocity_rad_s.abs()).collect();
    if speeds.is_empty() {
        return 0.0;
    }
    let at = (speeds.len() - 1) * TOP_PERCENT / 100;
    *speeds.select_nth_unstable_by(at, f64::total_cmp).1
}
