//! Whether the reconstructed or the logged motion is closer to what the torque follows.
//!
//! A reconstruction assumes a position and a velocity of one joint at one time. Where rows are lost, a clock stands still or a
//! fast motion lasts a few rows only, it is wrong, and the logged velocity is not. Both are compared by what Coulomb and
//! viscous friction, inertia, gravity and an offset leave of the torque. Noise of the velocity makes the logged motion worse,
//! so that the reconstructed one is kept unless the other leaves clearly less.

use crate::statistics::quantile_by_count;
use crate::torque_fit::{FRICTION, LeastSquares};
use crate::{Dataset, JointKind, Quantity};

/// Ratio of the errors below which the logged motion is used.
const MAX_RATIO: f64 = 0.92;

/// Quantile of the speed that stands for the usual fast motion.
const TOP_SPEED: f64 = 0.95;

/// Share of it up to which Coulomb friction has no direction.
const NO_DIRECTION: f64 = 0.01;

/// Returns true if the logged motion leaves clearly less of the torque than the reconstructed one.
pub fn logged_is_better(logged: &Dataset, reconstructed: &Dataset) -> bool {
    match (plain_error(logged), plain_error(reconstructed)) {
        (Some(logged), Some(reconstructed)) => logged < MAX_RATIO * reconstructed,
        _ => false,
    }
}

/// Returns the RMS error of plain friction by least squares; `None` if it has no solution, or too few rows.
fn plain_error(data: &Dataset) -> Option<f64> {
    let speeds: Vec<f64> =
        data.runs.iter().flat_map(|run| run.velocity.iter().map(|v| v.abs())).collect();
    let slowest = NO_DIRECTION * quantile_by_count(speeds, TOP_SPEED)?;
    let mut sums = LeastSquares::default();
    for run in &data.runs {
        let acceleration = run.acceleration_or_derived();
        let angle = run.get(Quantity::Position).filter(|_| data.joint == JointKind::Revolute);
        for row in (0..run.len()).filter(|row| !run.is_spike(*row)) {
            let velocity = run.velocity[row];
            let direction = if velocity.abs() > slowest { velocity.signum() } else { 0.0 };
            let (sine, cosine) = angle.map_or((0.0, 0.0), |angle| angle[row].sin_cos());
            let regressors = [acceleration[row], direction, velocity, sine, cosine, 1.0];
            sums.add(regressors.into(), run.torque[row]);
        }
    }
    // Neither part of friction may be negative: a controller feeds the noise of a velocity back, as friction that drives.
    let [coulomb, viscous] = FRICTION;
    for at_zero in [&[][..], &[viscous], &[coulomb], &FRICTION] {
        let law = sums.solve(at_zero)?;
        if FRICTION.iter().all(|at| at_zero.contains(at) || law.coefficients[*at] >= 0.0) {
            return Some(law.scatter);
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a log of Coulomb and viscous friction whose velocity column is what `logged` makes of the true one.
    fn log(logged: impl Fn(usize, f64) -> f64) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(String::from);
        let speed = |row: usize| (0.05 * row as f64).sin();
        let torque = |row: usize| speed(row).signum() + 0.5 * speed(row);
        let column = |of: &dyn Fn(usize) -> f64| (0..800).map(of).collect::<Vec<f64>>();
        let time = column(&|row| 0.01 * row as f64);
        let columns = vec![time, column(&|row| logged(row, speed(row))), column(&torque)];
        Dataset::from_columns(&names, [("a".to_owned(), columns)]).expect("a log")
    }

    #[test]
    fn logged_is_better_only_where_the_reconstruction_is_wrong() {
        let (exact, late) = (log(|_, v| v), log(|row, _| (0.05 * (row as f64 - 8.0)).sin()));
        assert!(logged_is_better(&exact, &late));
        assert!(!logged_is_better(&late, &exact));
        let noisy = log(|row, v| v + 0.3 * ((row * 7919 % 100) as f64 / 50.0 - 1.0));
        assert!(!logged_is_better(&noisy, &exact));
        assert!(!logged_is_better(&exact, &exact));
    }

    #[test]
    fn plain_error_of_friction_that_drives_is_that_of_the_offset() {
        let error = plain_error(&log(|_, v| -v)).expect("an error");
        assert!((1.0..1.5).contains(&error), "{error}");
    }
}
