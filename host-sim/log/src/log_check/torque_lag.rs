//! A torque that is delayed against the motion, by a filter or another bus.
//!
//! At a reversal friction changes its sign. Bristles and backlash need a *travel* for the change, a delayed channel a
//! *time*. A joint that leaves its turning point with acceleration `a` has moved by a travel `L` after `sqrt(2 L / a)`,
//! so over many reversals
//!
//! ```text
//! time from the turn to the middle of the change = lag + sqrt(L) sqrt(2 / a)
//! ```
//!
//! and the intercept is the lag. This needs reversals of different acceleration. A low-pass filter is detected only in
//! part: with soft bristles, most of its delay looks like additional travel.

use super::finding::{LogFinding, LogFindingKind};
use super::log::Log;
use crate::number::figure;
use crate::segments;
use crate::statistics::median;
use std::ops::Range;

/// Minimum number of reversals.
const MIN_REVERSALS: usize = 12;

/// Minimum ratio of the outer deciles of `sqrt(2 / a)`.
const MIN_DECILE_RATIO: f64 = 1.5;

/// Minimum lag that is reported, standard errors.
const MIN_LAG_ERRORS: f64 = 4.0;

/// Minimum lag that is reported, rows.
const MIN_LAG_ROWS: f64 = 1.5;

/// Speed at which a joint has left its turn, as a share of the 95th percentile.
const LEFT_SPEED_SHARE: f64 = 0.1;

/// Rows after a turn over which the level of the torque is averaged. A filter has settled by then.
const LEVEL_ROWS: Range<usize> = 8..16;

/// Maximum duration of a turn on either side, rows.
const MAX_TURN_ROWS: usize = 60;

pub fn torque_lag(log: &Log) -> Vec<LogFinding> {
    let mut turns = turns(log);
    if turns.len() < MIN_REVERSALS {
        return Vec::new();
    }
    turns.sort_by(|a, b| a.slowness.total_cmp(&b.slowness));
    let tenth = turns.len() / 10;
    if turns[turns.len() - 1 - tenth].slowness < MIN_DECILE_RATIO * turns[tenth].slowness {
        return Vec::new();
    }
    let Some(Lag { lag_s, error_s }) = intercept(&turns) else { return Vec::new() };
    if lag_s < MIN_LAG_ERRORS * error_s || lag_s < MIN_LAG_ROWS * log.sensors.step_s {
        return Vec::new();
    }
    let words = format!(
        "At {} reversals the torque changes sides {} ± {} ms after the motion whatever the speed: it is filtered \
             or late. Nothing is changed; a delay is to be a part of the base model.",
        turns.len(),
        figure(1e3 * lag_s),
        figure(1e3 * error_s)
    );
    vec![LogFindingKind::TorqueLag.finding(&[log.torque()], lag_s, "s", words)]
}

/// A reversal.
struct Turn {
    /// `sqrt(2/a)` of its acceleration, s per square root of rad or m.
    slowness: f64,
    /// Time from the turn to the middle of the torque's change, s.
    late_s: f64,
}

/// The lag of the torque with its standard error.
struct Lag {
    lag_s: f64,
    error_s: f64,
}

fn turns(log: &Log) -> Vec<Turn> {
    let left = LEFT_SPEED_SHARE * log.sensors.speed;
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

fn turn(time: &[f64], velocity: &[f64], torque: &[f64], row: usize, left: f64) -> Option<Turn> {
    let side = velocity[row].signum();
    // Rows in which the joint has left the turn, on either side, without turning again.
    let after =
        (row..time.len().min(row + MAX_TURN_ROWS)).find(|at| velocity[*at] * side > left)?;
    let before =
        (row.saturating_sub(MAX_TURN_ROWS)..row).rev().find(|at| -velocity[*at] * side > left)?;
    let one_way = (row..after).all(|at| velocity[at] * side > 0.0)
        && (before..row).all(|at| velocity[at] * side < 0.0);
    if !one_way || before < LEVEL_ROWS.end || after + LEVEL_ROWS.end >= time.len() {
        return None;
    }
    let share = velocity[row - 1] / (velocity[row - 1] - velocity[row]);
    let zero = time[row - 1] + share * (time[row] - time[row - 1]);
    let acceleration = (velocity[after] - velocity[before]) / (time[after] - time[before]);
    let level = |from: usize, to: usize| torque[from..to].iter().sum::<f64>() / (to - from) as f64;
    let Range { start, end } = LEVEL_ROWS;
    let (low, high) = (level(before - end, before - start), level(after + start, after + end));
    // The change of the level must be significant.
    let settled = torque[after + start..after + end].iter();
    let scatter = settled.map(|t| (t - high).abs()).fold(0.0, f64::max);
    if (high - low) * side < 4.0 * scatter {
        return None;
    }
    let middle = 0.5 * (low + high);
    let crossed = (before + 1..after + end).find(|at| {
        (torque[*at] - middle) * side > 0.0 && (torque[at - 1] - middle) * side <= 0.0
    })?;
    let share = (middle - torque[crossed - 1]) / (torque[crossed] - torque[crossed - 1]);
    let then = time[crossed - 1] + share * (time[crossed] - time[crossed - 1]);
    Some(Turn { slowness: (2.0 / acceleration.abs()).sqrt(), late_s: then - zero })
}

/// Fits a robust line and returns its intercept with the standard error.
fn intercept(turns: &[Turn]) -> Option<Lag> {
    let mut weights = vec![1.0; turns.len()];
    let mut result = None;
    for _ in 0..10 {
        let (mut n, mut sx, mut sy, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (Turn { slowness: x, late_s: y }, w) in turns.iter().zip(&weights) {
            n += w;
            sx += w * x;
            sy += w * y;
            xx += w * x * x;
            xy += w * x * y;
        }
        let determinant = n * xx - sx * sx;
        if determinant.is_nan() || determinant <= 1e-9 * n * xx {
            return None;
        }
        let slope = (n * xy - sx * sy) / determinant;
        let start = (sy - slope * sx) / n;
        let sizes: Vec<f64> =
            turns.iter().map(|of| (of.late_s - start - slope * of.slowness).abs()).collect();
        let scale = median(&mut sizes.clone())? / 0.6745 + 1e-12;
        // Huber's weights.
        weights = sizes.iter().map(|size| (1.5 * scale / size).min(1.0)).collect();
        result = Some(Lag { lag_s: start, error_s: scale * (xx / determinant).sqrt() });
    }
    result
}
