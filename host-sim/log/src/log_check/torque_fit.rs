//! The torque against the motion, before any model: a law that is linear in acceleration, direction, velocity, position and 1.
//!
//! Checks compare how well this law follows two readings of one column, so that an imperfect law does no harm: a torque and its
//! magnitude, a torque with and without a sign bit, one offset and one for each run. Rows at rest are left out, because there the
//! direction of friction is unknown.

use crate::dataset::{Dataset, Place, Run};
use crate::statistics::quantile;
use compensator_core::quantity::{JointKind, Quantity};
use nalgebra::{SMatrix, SVector};

/// Minimum speed of a row that moves, as a share of the 95th percentile of speed.
const MIN_MOVING_SHARE: f64 = 0.05;

/// Minimum number of rows for a fit.
pub const MIN_ROWS: usize = 40;

/// Number of regressors; the last is 1.
const REGRESSORS: usize = 6;

/// Regularisation of the normal equations, relative to their diagonal: a regressor may be zero.
const RIDGE: f64 = 1e-9;

/// The regressors of a row.
pub type Regressors = SVector<f64, REGRESSORS>;

/// A row in which the joint moves.
pub struct MovingRow {
    pub place: Place,
    /// True if it moves backwards.
    pub is_back: bool,
    /// Acceleration, direction, velocity, two functions of the position, 1.
    pub regressors: Regressors,
    /// The torque as logged.
    pub torque: f64,
}

/// A law with its error.
pub struct TorqueFit {
    pub coefficients: Regressors,
    /// Root mean square of what it leaves.
    pub scatter: f64,
}

impl TorqueFit {
    /// Returns the torque of the law.
    pub fn torque(&self, row: &MovingRow) -> f64 {
        self.coefficients.dot(&row.regressors)
    }
}

/// Returns the speed above which a row counts as moving.
pub fn least_moving_speed(data: &Dataset) -> f64 {
    let speeds = data.runs.iter().flat_map(|run| run.velocity.iter().map(|v| v.abs()));
    MIN_MOVING_SHARE * quantile(&mut speeds.collect::<Vec<_>>(), 0.95).unwrap_or_default()
}

/// Returns the rows in which the joint moves.
pub fn moving_rows(data: &Dataset) -> Vec<MovingRow> {
    let least = least_moving_speed(data);
    let rows_of = |(index, run): (usize, &Run)| {
        let acceleration = run.acceleration_or_derived().into_owned();
        let position = run.get(Quantity::Position);
        let row = |row: usize| {
            let velocity = run.velocity[row];
            let place = match (position.map(|position| position[row]), data.joint) {
                (None, _) => [0.0; 2],
                (Some(angle), JointKind::Revolute) => [angle.sin(), angle.cos()],
                (Some(position), JointKind::Prismatic) => [position, 0.0],
            };
            let regressors =
                [acceleration[row], velocity.signum(), velocity, place[0], place[1], 1.0];
            let is_back = velocity < 0.0;
            let (regressors, torque) = (Regressors::from(regressors), run.torque[row]);
            MovingRow { place: Place { run: index, row }, is_back, regressors, torque }
        };
        let moves = |row: &usize| run.velocity[*row].abs() > least;
        (0..run.len()).filter(moves).map(row).collect::<Vec<_>>()
    };
    data.runs.iter().enumerate().flat_map(rows_of).collect()
}

/// Fits the law to pairs of regressors and a torque. Returns `None` if there are too few.
pub fn fit(pairs: impl Iterator<Item = (Regressors, f64)>) -> Option<TorqueFit> {
    let (mut normal, mut right) =
        (SMatrix::<f64, REGRESSORS, REGRESSORS>::zeros(), Regressors::zeros());
    let (mut squares, mut count) = (0.0, 0usize);
    for (regressors, torque) in pairs {
        normal += regressors * regressors.transpose();
        right += regressors * torque;
        squares += torque * torque;
        count += 1;
    }
    if count < MIN_ROWS {
        return None;
    }
    let plain = normal;
    for at in 0..REGRESSORS {
        normal[(at, at)] += RIDGE * normal[(at, at)] + f64::MIN_POSITIVE;
    }
    let found = normal.cholesky()?.solve(&right);
    let left = squares - 2.0 * found.dot(&right) + found.dot(&(plain * found));
    Some(TorqueFit { coefficients: found, scatter: (left.max(0.0) / count as f64).sqrt() })
}

/// Returns true if rows move both ways.
pub fn moves_both_ways<'a>(rows: impl Iterator<Item = &'a MovingRow>) -> bool {
    const MIN_BACK_SHARE: f64 = 0.1;
    let (mut back, mut all) = (0.0, 0.0);
    for row in rows {
        back += f64::from(u8::from(row.is_back));
        all += 1.0;
    }
    back.min(all - back) > MIN_BACK_SHARE * all
}
