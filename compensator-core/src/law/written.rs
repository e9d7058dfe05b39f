//! Input of a law: its parameters and the range of its quantities.

use super::Choices;
use crate::curve;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId, ParameterValues};
use crate::term::bounds::Bounds;

/// Parameters from which a law is built.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LawParameters<'a, S> {
    /// Values of all parameters.
    pub values: &'a ParameterValues<S>,
    /// Options that are not numeric.
    pub choices: Choices,
    /// Operating envelope of the joint.
    pub envelope: &'a Envelope,
}

impl<S: Real> LawParameters<'_, S> {
    /// Returns the limit of the velocity magnitude, rad/s.
    pub fn velocity_limit<T: Real>(&self) -> T {
        T::from_f64(f64::from(self.envelope.velocity_max_rad_s))
    }
}

/// Returns the end of the Stribeck table, rad/s, and its cells per rad/s.
pub(super) fn stribeck_axis<T: Real>(written: &LawParameters<T::Setting>) -> (T, T) {
    let constant = T::Setting::from_f64;
    let velocity = written.values.get(ParameterId::StribeckVelocity);
    let end = velocity * constant(curve::LAST / curve::CELLS_PER_STRIBECK_VELOCITY);
    let cells = constant(curve::CELLS_PER_STRIBECK_VELOCITY) / velocity;
    (T::from_setting(end), T::from_setting(cells))
}

/// Range of the quantities of a law within the envelope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LawRange<'a> {
    /// Sample period, s.
    pub period_s: f32,
    /// Largest speed, rad/s.
    pub speed: f32,
    /// Smallest Coulomb level, Nm. It is the smallest possible divisor of a step.
    pub smallest_level: f32,
    /// Largest static level, Nm. It limits the bristle torque.
    pub largest_level: f32,
    /// Bounds of load and terms.
    pub bounds: &'a Bounds,
}
