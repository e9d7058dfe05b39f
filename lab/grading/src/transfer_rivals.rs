//! What the product must surpass on the test rows of a [`TransferLog`], and a bound of what can be explained there.
//!
//! *Plain* is Coulomb and viscous friction, an offset and the rigid-body columns by least squares. *Trees* see all columns of the
//! log and a short history of the motion. Both are fitted to the training rows.

use crate::regression_trees::RegressionTrees;
use crate::statistics::quantile;
use crate::transfer_log::TransferLog;
use compensator_core::TermKind;
use nalgebra::{DMatrix, DVector};

/// Most rows that the trees are fitted to.
const TREE_ROWS: usize = 60_000;

/// Ages of the history that the trees see, in rows.
const HISTORY: [usize; 7] = [1, 2, 4, 8, 16, 32, 64];

/// Rows over which a velocity is averaged before its derivative.
const SMOOTHED_ROWS: usize = 7;

/// Largest step of the time in an integrated velocity, in median steps.
const MAX_STEP: f64 = 5.0;

/// Returns the predictions of Coulomb and viscous friction and an offset, with other parts of the rigid body: inertia, gravity
/// and load.
pub fn plain(log: &TransferLog, rigid_body: &[TermKind]) -> Vec<f64> {
    let rows = log.time.len();
    let direction = (0..rows).map(|row| log.direction(row)).collect();
    let mut columns: Vec<Vec<f64>> = vec![direction, log.velocity.clone(), vec![1.0; rows]];
    if rigid_body.contains(&TermKind::UnmodelledInertia) {
        columns.push(acceleration(log));
    }
    if rigid_body.contains(&TermKind::GravityImbalance) {
        let position = position(log);
        columns.push(position.iter().map(|q| q.sin()).collect());
        columns.push(position.iter().map(|q| q.cos()).collect());
    }
    if rigid_body.contains(&TermKind::LoadGain) {
        columns.extend(log.column("load_torque_nm"));
    }
    let training: Vec<usize> = (0..rows).filter(|row| !log.is_test[*row]).collect();
    // Scaled, because the singular values of columns in other units differ by many decades.
    let scale = |column: &Vec<f64>| {
        let square: f64 = training.iter().map(|row| column[*row] * column[*row]).sum();
        if square > 0.0 { square.sqrt() } else { 1.0 }
    };
    let scales: Vec<f64> = columns.iter().map(scale).collect();
    let values = |row: usize, at: usize| columns[at][row] / scales[at];
    let matrix =
        DMatrix::from_fn(training.len(), columns.len(), |row, at| values(training[row], at));
    let torque = DVector::from_fn(training.len(), |row, _| log.torque[training[row]]);
    let found = matrix.svd(true, true).solve(&torque, 1e-9);
    let found = found.unwrap_or_else(|_| DVector::zeros(columns.len()));
    let predict = |row| (0..columns.len()).map(|at| found[at] * values(row, at)).sum();
    (0..rows).map(predict).collect()
}

/// Returns the predictions of boosted trees for some rows; NaN in the others.
pub fn trees(log: &TransferLog, rows: &[usize]) -> Vec<f64> {
    let columns = tree_columns(log);
    let training: Vec<usize> = (0..log.time.len()).filter(|row| !log.is_test[*row]).collect();
    let step = training.len().div_ceil(TREE_ROWS).max(1);
    let training: Vec<usize> = training.into_iter().step_by(step).collect();
    let of = |column: &Vec<f64>| training.iter().map(|row| column[*row]).collect();
    let trained: Vec<Vec<f64>> = columns.iter().map(of).collect();
    let trees = RegressionTrees::fit(&trained, &of(&log.torque));
    let mut predicted = vec![f64::NAN; log.time.len()];
    rows.iter().for_each(|row| predicted[*row] = trees.predict(&columns, *row));
    predicted
}

/// Returns the columns that the trees see: motion, its history, and all other columns of the log.
fn tree_columns(log: &TransferLog) -> Vec<Vec<f64>> {
    let (position, velocity) = (position(log), &log.velocity);
    let map = |column: &[f64], of: fn(f64) -> f64| column.iter().map(|x| of(*x)).collect();
    let sign = |x: f64| if x == 0.0 { 0.0 } else { x.signum() };
    let mut columns = vec![
        velocity.clone(),
        map(velocity, sign),
        acceleration(log),
        position.clone(),
        map(&position, f64::sin),
        map(&position, f64::cos),
        since_reversal(log, &position),
    ];
    for age in HISTORY {
        let (mut before, mut travelled) = (velocity.clone(), vec![0.0; velocity.len()]);
        for run in log.runs() {
            for row in run.clone() {
                let past = row.saturating_sub(age).max(run.start);
                before[row] = velocity[past];
                travelled[row] = position[row] - position[past];
            }
        }
        columns.extend([before, travelled]);
    }
    columns.extend(log.covariates());
    columns
}

/// Returns the displacement of each row since the last reversal of its run.
fn since_reversal(log: &TransferLog, position: &[f64]) -> Vec<f64> {
    let mut displacement = vec![0.0; position.len()];
    for run in log.runs() {
        let (mut turn, mut way) = (position[run.start], 0.0);
        for row in run.start + 1..run.end {
            let step = position[row] - position[row - 1];
            if step != 0.0 && step.signum() != way {
                (turn, way) = (position[row - 1], step.signum());
            }
            displacement[row] = position[row] - turn;
        }
    }
    displacement
}

/// Returns the position of the log, or the integral of its velocity from the start of each run.
fn position(log: &TransferLog) -> Vec<f64> {
    if let Some(position) = log.starting(&["position"]) {
        return position;
    }
    let longest = MAX_STEP * median_step(log);
    let mut position = vec![0.0; log.time.len()];
    for run in log.runs() {
        for row in run.start + 1..run.end {
            let step = (log.time[row] - log.time[row - 1]).clamp(0.0, longest);
            position[row] = position[row - 1] + log.velocity[row] * step;
        }
    }
    position
}

/// Returns the acceleration of the log, or the derivative of its smoothed velocity.
fn acceleration(log: &TransferLog) -> Vec<f64> {
    if let Some(acceleration) = log.starting(&["acceleration"]) {
        return acceleration;
    }
    let period = median_step(log);
    let mut acceleration = vec![0.0; log.time.len()];
    for run in log.runs() {
        let velocity = &log.velocity[run.clone()];
        let smooth = |at: usize| {
            let half = SMOOTHED_ROWS / 2;
            let window = &velocity[at.saturating_sub(half)..(at + half + 1).min(velocity.len())];
            window.iter().sum::<f64>() / window.len() as f64
        };
        let smoothed: Vec<f64> = (0..velocity.len()).map(smooth).collect();
        for at in 0..smoothed.len() {
            let (from, to) = (at.saturating_sub(1), (at + 1).min(smoothed.len() - 1));
            let seconds = (to - from) as f64 * period;
            acceleration[run.start + at] =
                if seconds > 0.0 { (smoothed[to] - smoothed[from]) / seconds } else { 0.0 };
        }
    }
    acceleration
}

/// Returns the median step of the time within runs, s.
fn median_step(log: &TransferLog) -> f64 {
    let runs = log.runs().into_iter();
    let steps = runs.flat_map(|run| (run.start + 1..run.end).map(|at| (at, at - 1)));
    let median_s = quantile(steps.map(|(at, last)| log.time[at] - log.time[last]), 0.5);
    if median_s.is_nan() { 1.0 } else { median_s }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer_log::tests::log_of;

    /// Returns a log of three runs with this torque, a function of direction, velocity, acceleration and position.
    fn log_with(torque: fn(f64, f64, f64, f64) -> f64) -> TransferLog {
        let mut text =
            "run,time_s,position_rad,velocity_rad_s,acceleration_rad_s2,torque_nm\n".to_owned();
        for row in 0..1500 {
            let t = 0.01 * f64::from(row % 500);
            let (q, v, a) = ((2.0 * t).sin(), 2.0 * (2.0 * t).cos(), -4.0 * (2.0 * t).sin());
            let direction = if v.abs() > 0.02 { v.signum() } else { 0.0 };
            let torque = torque(direction, v, a, q);
            text += &format!("{},{t},{q},{v},{a},{torque}\n", row / 500);
        }
        log_of(&text)
    }

    #[test]
    fn plain_of_hand_made_log_predicts_its_torque() {
        let log = log_with(|s, v, a, q| 0.7 * s + 0.2 * v + 0.1 + 0.05 * a + 3.0 * q.sin());
        let rows = log.judging_rows();
        let error = |rigid_body: &[TermKind]| {
            let predicted = plain(&log, rigid_body);
            log.rmse(&rows, |row| predicted[row])
        };
        let known = error(&[TermKind::UnmodelledInertia, TermKind::GravityImbalance]);
        assert!(known < 1e-9, "{known}");
        assert!(error(&[]) > 1.0);
    }

    #[test]
    fn trees_explain_what_plain_has_no_column_for() {
        let log = log_with(|s, v, _, q| s * (1.0 + q) + 0.2 * v);
        let rows = log.judging_rows();
        let (ours, plain) = (trees(&log, &rows), plain(&log, &[]));
        let error = log.rmse(&rows, |row| ours[row]);
        assert!(error < 0.2 * log.rmse(&rows, |row| plain[row]), "{error}");
    }
}
