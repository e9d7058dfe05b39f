//! `+ m sin(q + phi)`: a torque of the angle, whichever way the joint turns.

use super::angle::over_angle;
use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::ParameterError;

/// Built for a sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct GravityImbalance<T> {
    /// On the sine of the position, Nm.
    sine: T,
    /// On the cosine, Nm.
    cosine: T,
}

impl<T: Real> Term<T> for GravityImbalance<T> {
    const PARAMETERS: &'static [Id] = &[Id::GravitySine, Id::GravityCosine];

    const READS: Option<Quantity> = Some(Quantity::Position);

    type Memory = ();

    fn build(values: &Values<T::Setting>, _: T::Setting) -> Self {
        Self {
            sine: T::from_setting(values.get(Id::GravitySine)),
            cosine: T::from_setting(values.get(Id::GravityCosine)),
        }
    }

    fn rescale_period(&self, _: T) -> Self {
        *self
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let torque = over_angle(sample.position_rad, self.sine, self.cosine);
        effects.torque = effects.torque + torque * sample.position_trust;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.sine, self.cosine, T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f64 {
        self.sine.value().abs() + self.cosine.value().abs()
    }

    fn widen<S: Real>(values: &Values<S>, _: &Envelope, bounds: &mut Bounds) {
        let (sine, cosine) = (values.value(Id::GravitySine), values.value(Id::GravityCosine));
        bounds.torque += libm::hypot(sine, cosine);
    }

    fn validate<S: Real>(_: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        Ok(())
    }
}
