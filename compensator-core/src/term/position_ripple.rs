//! `g *= 1 + a sin(n q + phi)`: friction depends on the shaft angle.

use super::angle::over_angle;
use super::bounds;
use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PositionRipple<T> {
    /// `n`, angular order, 1/rad.
    order: T,
    /// Factor of `sin(n q)`.
    sine: T,
    /// Factor of `cos(n q)`.
    cosine: T,
}

/// Maximum amplitude, equal to the range limit of its sine and cosine part.
const AMPLITUDE_MAX: f32 = 0.99;

/// Returns the amplitude of the ripple.
fn amplitude<S: Real>(values: &ParameterValues<S>) -> f32 {
    bounds::amplitude(values.single(Id::RippleSine), values.single(Id::RippleCosine))
}

impl<T: Real> Term<T> for PositionRipple<T> {
    const PARAMETERS: &'static [Id] = &[Id::RippleSine, Id::RippleCosine, Id::RippleOrder];

    const SIZES: &'static [Id] = &[Id::RippleSine, Id::RippleCosine];

    const READS: Option<Quantity> = Some(Quantity::Position);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self {
            order: T::from_setting(values.get(Id::RippleOrder)),
            sine: T::from_setting(values.get(Id::RippleSine)),
            cosine: T::from_setting(values.get(Id::RippleCosine)),
        }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.sine = of.sine * gain;
        self.cosine = of.cosine * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let ripple = over_angle(self.order * sample.position_rad, self.sine, self.cosine);
        let ripple = ripple * sample.position_weight;
        effects.level_scale = effects.level_scale * (T::one() + ripple);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.order, self.sine, self.cosine, T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        self.order.single().abs() * envelope.position_max_rad
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.scale_level_by_share(amplitude(values));
    }

    fn validate<S: Real>(values: &ParameterValues<S>, _: &Envelope) -> Result<(), ParameterError> {
        let amplitude = amplitude(values);
        if amplitude > AMPLITUDE_MAX {
            let why = text!("a ripple of 1 or more turns friction round");
            let field = text!("hypot(ripple_sine, ripple_cosine)");
            return refuse(field, amplitude, Bound::AtMost(AMPLITUDE_MAX), why);
        }
        Ok(())
    }
}
