//! Unknowns of the regression.

use super::gains::{Gains, MAX_GAINS};

/// Unknowns of the regression: the gains and a constant torque.
pub const DIMENSIONS: usize = MAX_GAINS + 1;

/// Position of the constant torque among the unknowns, before the gains.
pub const OFFSET: usize = 0;

/// Position of the first gain among the unknowns: that of the level.
pub const GAINS_AT: usize = 1;

/// Returns the gains among the unknowns.
#[inline(never)]
pub fn gains_of(unknowns: &[f32; DIMENSIONS]) -> Gains<f32> {
    let mut gains = [0.0; MAX_GAINS];
    gains.copy_from_slice(&unknowns[GAINS_AT..]);
    Gains::from_array(&gains)
}

/// Returns the unknowns with these gains and no constant torque.
#[inline(never)]
pub fn unknowns_of(gains: &Gains<f32>) -> [f32; DIMENSIONS] {
    let mut unknowns = [0.0; DIMENSIONS];
    unknowns[GAINS_AT..].copy_from_slice(&gains.to_array());
    unknowns
}
