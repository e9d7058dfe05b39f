//! Positions that cannot be compared, and those of an encoder of one turn.

use super::{IncomparableReason, TwoPositions};
use joint_log::{Dataset, Quantity};
use std::f64::consts::TAU;

/// Returns the log of a motion over two turns, with the second position of each angle.
fn log(rows: usize, second: impl Fn(f64) -> f64) -> Dataset {
    let names = ["time_s", "position_rad", "velocity_rad_s", "torque_nm", "joint_position_rad"];
    let row = |row: usize| {
        let time = 0.005 * row as f64;
        let (position, velocity) = (6.0 * (2.0 * time).sin(), 12.0 * (2.0 * time).cos());
        let noise = 1e-5 * ((row * 7919 % 1000) as f64 / 500.0 - 1.0);
        [time, position, velocity, velocity.signum() + 0.01 * velocity, second(position) + noise]
    };
    let columns = (0..5).map(|column| (0..rows).map(|at| row(at)[column]).collect()).collect();
    Dataset::from_columns(&names.map(String::from), [("a".to_owned(), columns)]).expect("columns")
}

#[test]
fn of_positions_of_joint_at_rest_tells_that_nothing_moves() {
    let mut rests = log(4000, |q| q);
    rests.runs[0].set(Quantity::Position, vec![0.25; 4000]);
    let why = TwoPositions::of(&rests).expect("two positions").expect_err("no motion");
    assert_eq!(why.why, IncomparableReason::NoMotion);
}

fn note(rows: usize, second: impl Fn(f64) -> f64) -> String {
    TwoPositions::of(&log(rows, second))
        .expect("two positions")
        .err()
        .map(|why| why.to_string())
        .unwrap_or_default()
}

#[test]
fn of_positions_that_are_not_of_one_joint_tells_the_ratio() {
    assert!(note(4000, |q| -q).contains("-1.0000 times position_rad"), "{}", note(4000, |q| -q));
    assert!(note(4000, |q| 5.0 * q).contains("5.000 times position_rad"));
    assert!(note(500, |q| q + 0.001 * q.sin()).contains("reversals"));
}

#[test]
fn of_encoder_of_one_turn_without_play_finds_none() {
    let found = TwoPositions::of(&log(6000, |q| (q + 0.003 * q.sin()).rem_euclid(TAU)));
    let found = found.expect("two positions").expect("enough reversals");
    assert!(found.lost_motion < 1e-4 && found.probability < 0.1, "{found:?}");
    assert!(found.note().is_some());
}
