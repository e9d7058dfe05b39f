//! A torque that is late against the motion: a filter, another bus.
//!
//! At a reversal friction changes sides. Bristles and backlash take a *travel* for it, a late channel takes a
//! *time*: where the joint turns hard the one is short and the other is not. A joint that leaves its turning
//! point with acceleration `a` has gone a travel `L` after `sqrt(2 L / a)`, so over many reversals
//!
//! ```text
//! time from the turn to the middle of the change = lag + sqrt(L) sqrt(2 / a)
//! ```
//!
//! and the intercept is the lag. It takes reversals of different hardness.

use super::{Kind, Log, LogFinding};
use crate::data::segments;
use crate::number::figure;

/// Reversals it takes.
const FEWEST: usize = 12;

/// Hardest over gentlest decile of `sqrt(2 / a)`.
const DIFFERENT: f64 = 1.5;

/// Standard errors, and rows, from which a lag is told.
const TELLS: (f64, f64) = (4.0, 1.5);

/// Speed at which a joint has left its turn, as a share of the 95th percentile.
const LEFT: f64 = 0.1;

/// Rows a turn may take, to either side.
const TURN: usize = 60;

pub fn torque_lag(log: &Log) -> Vec<LogFinding> {
    let mut turns = turns(log);
    if turns.len() < FEWEST {
        return Vec::new();
    }
    turns.sort_by(|a, b| a.0.total_cmp(&b.0));
    let tenth = turns.len() / 10;
    if turns[turns.len() - 1 - tenth].0 < DIFFERENT * turns[tenth].0 {
        return Vec::new();
    }
    let Some((lag, error)) = intercept(&turns) else { return Vec::new() };
    if lag < TELLS.0 * error || lag < TELLS.1 * log.sensors.step_s {
        return Vec::new();
    }
    vec![LogFinding {
        kind: Kind::TorqueLag,
        columns: vec![log.torque().into()],
        value: lag,
        unit: "s".into(),
        corrected: false,
        in_words: format!(
            "At {} reversals the torque changes sides {} ± {} ms after the motion whatever the speed: it is filtered \
             or late. Nothing is changed; a delay is to be a part of the base model.",
            turns.len(),
            figure(1e3 * lag),
            figure(1e3 * error)
        ),
    }]
}

/// Each reversal as (`sqrt(2/a)`, time from the turn to the middle of the torque's change).
fn turns(log: &Log) -> Vec<(f64, f64)> {
    let left = LEFT * log.sensors.speed;
    let mut found = Vec::new();
    for run in &log.smoothed.runs {
        for rows in segments(run) {
            let (time, velocity, torque) =
                (&run.time_s[rows.clone()], &run.velocity[rows.clone()], &run.torque[rows]);
            for row in 1..time.len() {
                if velocity[row - 1] * velocity[row] < 0.0 {
                    found.extend(turn(time, velocity, torque, row, left));
                }
            }
        }
    }
    found
}

fn turn(
    time: &[f64],
    velocity: &[f64],
    torque: &[f64],
    row: usize,
    left: f64,
) -> Option<(f64, f64)> {
    let side = velocity[row].signum();
    // Rows in which it has left the turn, on either side, without turning again.
    let after = (row..time.len().min(row + TURN)).find(|at| velocity[*at] * side > left)?;
    let before = (row.saturating_sub(TURN)..row).rev().find(|at| -velocity[*at] * side > left)?;
    let one_way = (row..after).all(|at| velocity[at] * side > 0.0)
        && (before..row).all(|at| velocity[at] * side < 0.0);
    if !one_way || before < 5 || after + 5 >= time.len() {
        return None;
    }
    let share = velocity[row - 1] / (velocity[row - 1] - velocity[row]);
    let zero = time[row - 1] + share * (time[row] - time[row - 1]);
    let acceleration = (velocity[after] - velocity[before]) / (time[after] - time[before]);
    let level = |from: usize, to: usize| torque[from..to].iter().sum::<f64>() / (to - from) as f64;
    let (low, high) = (level(before - 4, before + 1), level(after, after + 5));
    // Levels before and after, where there is a change to speak of.
    let scatter = torque[after..after + 5].iter().map(|t| (t - high).abs()).fold(0.0, f64::max);
    if (high - low) * side < 4.0 * scatter {
        return None;
    }
    let middle = 0.5 * (low + high);
    let crossed = (before + 1..after + 5).find(|at| {
        (torque[*at] - middle) * side > 0.0 && (torque[at - 1] - middle) * side <= 0.0
    })?;
    let share = (middle - torque[crossed - 1]) / (torque[crossed] - torque[crossed - 1]);
    let then = time[crossed - 1] + share * (time[crossed] - time[crossed - 1]);
    Some(((2.0 / acceleration.abs()).sqrt(), then - zero))
}

/// The intercept of a robust line, with its standard error.
fn intercept(turns: &[(f64, f64)]) -> Option<(f64, f64)> {
    let mut weights = vec![1.0; turns.len()];
    let mut result = None;
    for _ in 0..10 {
        let (mut n, mut sx, mut sy, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for ((x, y), w) in turns.iter().zip(&weights) {
            n += w;
            sx += w * x;
            sy += w * y;
            xx += w * x * x;
            xy += w * x * y;
        }
        let determinant = n * xx - sx * sx;
        if !(determinant > 1e-9 * n * xx) {
            return None;
        }
        let slope = (n * xy - sx * sy) / determinant;
        let start = (sy - slope * sx) / n;
        let mut sizes: Vec<f64> =
            turns.iter().map(|(x, y)| (y - start - slope * x).abs()).collect();
        let sizes_in_order = sizes.clone();
        let middle = sizes.len() / 2;
        let scale = *sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / 0.6745 + 1e-12;
        // Huber's weights.
        weights = sizes_in_order.iter().map(|size| (1.5 * scale / size).min(1.0)).collect();
        result = Some((start, scale * (xx / determinant).sqrt()));
    }
    result
}
