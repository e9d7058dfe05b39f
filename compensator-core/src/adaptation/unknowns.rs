//! Unknowns of the regression, and what is known of them before anything is learnt.

use super::{Gains, InformationRoot, MAX_GAINS};

/// Unknowns of the regression: the gains and a constant torque.
pub const DIMENSIONS: usize = MAX_GAINS + 1;

/// Position of the constant torque among the unknowns, before the gains.
pub const OFFSET: usize = 0;

/// Position of the first gain among the unknowns: that of the level.
pub const GAINS_AT: usize = 1;

/// Standard deviation of the gains before anything is learnt, and of the gains in use around the tuned set.
pub const PRIOR_DEVIATION: f32 = 0.3;

/// Standard deviation of the constant torque before anything is learnt, as a share of the Coulomb level. It is larger than
/// that of the gains: a payload is more likely than a new seal.
const PRIOR_OFFSET_DEVIATION: f32 = 0.6;

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

/// Returns the information before anything is learnt, for this number of unknowns.
pub fn prior_information(count: usize) -> InformationRoot {
    let mut deviations = [PRIOR_DEVIATION; DIMENSIONS];
    deviations[OFFSET] = PRIOR_OFFSET_DEVIATION;
    InformationRoot::of_deviations(&deviations[..count])
}
