//! What a law is built from, and how far its quantities can go.

use super::Choices;
use crate::curve;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId, Values};
use crate::term::bounds::Bounds;

/// What a law is built from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Written<'a, S> {
    /// The values of its parameters.
    pub values: &'a Values<S>,
    /// What is not a number.
    pub choices: Choices,
    /// Where it is to work.
    pub envelope: &'a Envelope,
}

impl<S: Real> Written<'_, S> {
    /// The speed that velocity is limited to, rad/s.
    pub fn velocity_limit<T: Real>(&self) -> T {
        T::from_f64(f64::from(self.envelope.velocity_max_rad_s))
    }
}

/// The end of the Stribeck curve's table, rad/s, and its cells per rad/s.
pub(super) fn stribeck_axis<T: Real>(written: &Written<T::Setting>) -> (T, T) {
    let constant = T::Setting::from_f64;
    let velocity = written.values.get(ParameterId::StribeckVelocity);
    let end = velocity * constant(curve::LAST / curve::CELLS_PER_STRIBECK_VELOCITY);
    let cells = constant(curve::CELLS_PER_STRIBECK_VELOCITY) / velocity;
    (T::from_setting(end), T::from_setting(cells))
}

/// How far the quantities of a law can go within the envelope.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Range<'a> {
    /// Sample period, s.
    pub period_s: f64,
    /// Largest speed, rad/s.
    pub speed: f64,
    /// The lowest level the step can divide by, Nm.
    pub smallest_level: f64,
    /// The highest static level, Nm: no bristle torque is larger.
    pub largest_level: f64,
    /// What load and terms do.
    pub bounds: &'a Bounds,
}
