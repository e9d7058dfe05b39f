//! Input of a law: its parameters and the range of its quantities.

use super::Choices;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::ParameterValues;
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

/// Range of the quantities of a law within the envelope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LawRange<'a> {
    /// Sample period, s.
    pub period_s: f32,
    /// Largest speed, rad/s.
    pub speed_rad_s: f32,
    /// Smallest Coulomb level, Nm. It is the smallest possible divisor of a step.
    pub smallest_level_nm: f32,
    /// Largest static level, Nm. It limits the bristle torque.
    pub largest_level_nm: f32,
    /// Bounds of load and terms.
    pub bounds: &'a Bounds,
}
