//! `+ m sin(q + phi)`: a torque that depends on the angle, not on the direction of motion.

use super::angle::over_angle;
use super::bounds::amplitude;
use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct GravityImbalance<T> {
    /// Factor of the sine of the position, Nm.
    sine: T,
    /// Factor of the cosine of the position, Nm.
    cosine: T,
}

impl<T: Real> Term<T> for GravityImbalance<T> {
    const PARAMETERS: &'static [Id] = &[Id::GravitySine, Id::GravityCosine];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    const READS: Option<Quantity> = Some(Quantity::Position);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self {
            sine: T::from_setting(values.get(Id::GravitySine)),
            cosine: T::from_setting(values.get(Id::GravityCosine)),
        }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.sine = of.sine * gain;
        self.cosine = of.cosine * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let torque = over_angle(sample.position_rad, self.sine, self.cosine);
        effects.torque = effects.torque + torque * sample.position_weight;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.sine, self.cosine, T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        self.sine.single().abs() + self.cosine.single().abs()
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        let (sine, cosine) = (values.single(Id::GravitySine), values.single(Id::GravityCosine));
        bounds.torque += amplitude(sine, cosine);
    }
}
