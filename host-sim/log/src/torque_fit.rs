//! The torque against the motion, before any model: a law that is linear in acceleration, direction, velocity, position and 1.
//!
//! Checks compare how well this law follows two readings of one column, so that an imperfect law does no harm: a torque and its
//! magnitude, a torque with and without a sign bit, one offset and one for each run, the logged and the reconstructed motion.
//! In the rows of [`moving_rows`] the joint moves, because at rest the direction of friction is unknown.

use crate::dataset::{Dataset, Place, Run};
use crate::statistics::quantile;
use compensator_core::quantity::{JointKind, Quantity};
use nalgebra::{SMatrix, SVector};

/// Minimum speed of a row that moves, as a share of the 95th percentile of speed.
const MIN_MOVING_SHARE: f64 = 0.05;

/// Minimum number of rows for a fit.
pub const MIN_ROWS: usize = 40;

/// Number of regressors.
const REGRESSORS: usize = 6;

/// Place of the acceleration among the regressors.
pub const ACCELERATION: usize = 0;

/// Places of the two parts of friction, Coulomb and viscous.
pub const FRICTION: [usize; 2] = [1, 2];

/// Regularisation of the normal equations, relative to their diagonal: a regressor may be zero.
const RIDGE: f64 = 1e-9;

/// Diagonal of a coefficient that is kept at 0.
const KEPT_AT_ZERO: f64 = 1e150;

/// The regressors of a row: acceleration, direction of the friction (-1, 0 or 1), velocity, two functions of the position, and 1.
pub type Regressors = SVector<f64, REGRESSORS>;

/// A row in which the joint moves.
pub struct MovingRow {
    pub place: Place,
    /// True if it moves backwards.
    pub is_back: bool,
    pub regressors: Regressors,
    /// The torque as logged.
    pub torque: f64,
}

/// A law with its error.
pub struct TorqueFit {
    pub coefficients: Regressors,
    /// Standard errors of the coefficients.
    pub errors: Regressors,
    /// Root mean square of what it leaves.
    pub scatter: f64,
}

impl TorqueFit {
    /// Returns the torque of the law.
    pub fn torque(&self, row: &MovingRow) -> f64 {
        self.coefficients.dot(&row.regressors)
    }
}

/// The normal equations of a fit.
#[derive(Default)]
pub struct LeastSquares {
    products: SMatrix<f64, REGRESSORS, REGRESSORS>,
    right: Regressors,
    squares: f64,
    rows: usize,
}

impl LeastSquares {
    /// Adds a row.
    pub fn add(&mut self, regressors: Regressors, torque: f64) {
        self.products += regressors * regressors.transpose();
        self.right += regressors * torque;
        self.squares += torque * torque;
        self.rows += 1;
    }

    /// Returns the law whose coefficients at the places `at_zero` are 0; `None` if there are too few rows.
    pub fn solve(&self, at_zero: &[usize]) -> Option<TorqueFit> {
        if self.rows < MIN_ROWS {
            return None;
        }
        let mut products = self.products;
        for at in 0..REGRESSORS {
            products[(at, at)] += RIDGE * products[(at, at)] + f64::MIN_POSITIVE;
        }
        for at in at_zero {
            products.row_mut(*at).fill(0.0);
            products.column_mut(*at).fill(0.0);
            products[(*at, *at)] = KEPT_AT_ZERO;
        }
        let solved = products.cholesky()?;
        let found = solved.solve(&self.right);
        let left =
            self.squares - 2.0 * found.dot(&self.right) + found.dot(&(self.products * found));
        let scatter = (left.max(0.0) / self.rows as f64).sqrt();
        let errors = solved.inverse().diagonal().map(|variance| scatter * variance.sqrt());
        Some(TorqueFit { coefficients: found, errors, scatter })
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
            let [one, other] = match (position.map(|position| position[row]), data.joint) {
                (None, _) => [0.0; 2],
                (Some(angle), JointKind::Revolute) => [angle.sin(), angle.cos()],
                (Some(position), JointKind::Prismatic) => [position, 0.0],
            };
            let direction = velocity.signum();
            MovingRow {
                place: Place { run: index, row },
                is_back: velocity < 0.0,
                regressors: [acceleration[row], direction, velocity, one, other, 1.0].into(),
                torque: run.torque[row],
            }
        };
        let moves = |row: &usize| run.velocity[*row].abs() > least;
        (0..run.len()).filter(moves).map(row).collect::<Vec<_>>()
    };
    data.runs.iter().enumerate().flat_map(rows_of).collect()
}

/// Fits the law to pairs of regressors and a torque. Returns `None` if there are too few.
pub fn fit(pairs: impl Iterator<Item = (Regressors, f64)>) -> Option<TorqueFit> {
    let mut sums = LeastSquares::default();
    pairs.for_each(|(regressors, torque)| sums.add(regressors, torque));
    sums.solve(&[])
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
