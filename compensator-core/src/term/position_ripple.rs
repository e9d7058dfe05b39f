//! `g *= 1 + a sin(n q + phi)`: friction follows the shaft angle.

use super::angle::over_angle;
use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::{Bound, ParameterError, refuse};

/// Built for a sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PositionRipple<T> {
    /// `n`, periods in one turn, 1/rad.
    order: T,
    /// Factor on the sine.
    sine: T,
    /// Factor on the cosine.
    cosine: T,
}

/// Largest amplitude, as the range of each of its two parts.
const AMPLITUDE_MAX: f64 = 0.99;

fn amplitude<S: Real>(values: &Values<S>) -> f64 {
    libm::hypot(values.value(Id::RippleSine), values.value(Id::RippleCosine))
}

impl<T: Real> Term<T> for PositionRipple<T> {
    const PARAMETERS: &'static [Id] = &[Id::RippleSine, Id::RippleCosine, Id::RippleOrder];

    const READS: Option<Quantity> = Some(Quantity::Position);

    type Memory = ();

    fn build(values: &Values<T::Setting>, _: T::Setting) -> Self {
        Self {
            order: T::from_setting(values.get(Id::RippleOrder)),
            sine: T::from_setting(values.get(Id::RippleSine)),
            cosine: T::from_setting(values.get(Id::RippleCosine)),
        }
    }

    fn rescale_period(&self, _: T) -> Self {
        *self
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let ripple = over_angle(self.order * sample.position_rad, self.sine, self.cosine);
        let ripple = ripple * sample.position_trust;
        effects.level_scale = effects.level_scale * (T::one() + ripple);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.order, self.sine, self.cosine, T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f64 {
        self.order.value().abs() * f64::from(envelope.position_max_rad)
    }

    fn widen<S: Real>(values: &Values<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.scale_level_by_share(amplitude(values));
    }

    fn validate<S: Real>(values: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        let amplitude = amplitude(values);
        if amplitude > AMPLITUDE_MAX {
            let why = "a ripple of 1 or more turns friction round";
            let field = "hypot(ripple_sine, ripple_cosine)";
            return refuse(field, amplitude, Bound::AtMost(AMPLITUDE_MAX), why);
        }
        Ok(())
    }
}
