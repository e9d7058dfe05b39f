//! What the torque shows of a lost motion: torsion has a torque in all of it, and play has none until the flanks meet.

use super::blocks::{Blocks, Lag, Operator, Positions};
use super::held_out::HeldOut;
use super::regression::{Fit, Regression};

/// Number of dead shares in the grid.
const SHARES: usize = 21;

/// Dead share that a torsion may have, because gears are softer without load.
const SOFT: f64 = 0.3;

/// The share of a lost motion in which the torque of the load is dead.
pub(super) struct Behind {
    /// By the lag as the motion makes it: sharp, and without noise.
    pub by_motion: f64,
    /// By the lag as it is measured.
    pub by_lag: f64,
    /// By the motion, without each fold.
    pub parts: Vec<f64>,
    /// Play beside torsion on held-out blocks, by the measured lag.
    pub seen: HeldOut,
}

impl Behind {
    /// Fits the torque. `lost` is the fit of the lost motion with its operator.
    pub fn new(positions: &Positions, lost: &Fit, operator: Operator, folds: usize) -> Self {
        let dead: Vec<f64> = (0..SHARES).map(|at| at as f64 / (SHARES - 1) as f64).collect();
        let operators = dead.iter().map(|dead| Operator { dead: *dead, ..operator }).collect();
        let (coefficients, lost_motion) = (lost.coefficients.as_slice(), lost.size);
        let lag = Lag { coefficients, lost_motion, dead: dead.clone() };
        let blocks = Blocks::new(positions, operators, Some(&lag));
        let fits = |is_in: &dyn Fn(usize) -> bool| Regression::new(&blocks, is_in).torque_behind();
        let all = fits(&|_| true);
        let parts: Vec<Vec<Fit>> = (0..folds).map(|fold| fits(&|at| at % folds != fold)).collect();
        let soft = SHARES + (SOFT * (SHARES - 1) as f64) as usize + 1;
        let best = |to: usize| -> Vec<Fit> {
            parts
                .iter()
                .map(|fits_of_part| fits_of_part[least(fits_of_part, SHARES, to)].clone())
                .collect()
        };
        Self {
            by_motion: dead[least(&all, 0, SHARES)],
            by_lag: dead[least(&all, SHARES, 2 * SHARES) - SHARES],
            parts: parts.iter().map(|fits_of_part| dead[least(fits_of_part, 0, SHARES)]).collect(),
            seen: HeldOut::new(&blocks, &best(soft), &best(2 * SHARES)),
        }
    }

    /// Returns the share of the lost motion that is play.
    pub fn share(&self) -> f64 {
        0.5 * (self.by_motion + self.by_lag)
    }

    /// Returns the difference of both shares.
    pub fn disagreement(&self) -> f64 {
        (self.by_motion - self.by_lag).abs()
    }
}

/// Returns the fit with the least error among some.
fn least(fits: &[Fit], from: usize, to: usize) -> usize {
    let best = (from..to).min_by(|a, b| fits[*a].error.total_cmp(&fits[*b].error));
    best.unwrap_or(from)
}
