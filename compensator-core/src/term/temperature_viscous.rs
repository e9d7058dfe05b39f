//! `sigma2 *= exp(-b (T - T0))`: the viscosity of the lubricant decreases with temperature.

use super::bounds::TEMPERATURES_C;
use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TemperatureViscous<T> {
    /// `b`, 1/K.
    rate: T,
    /// `T0`, deg C.
    reference: T,
}

impl<T: Real> Term<T> for TemperatureViscous<T> {
    const PARAMETERS: &'static [Id] = &[Id::TemperatureViscosity, Id::TemperatureReference];

    const SIZES: &'static [Id] = &[Id::TemperatureViscosity];

    const READS: Option<Quantity> = Some(Quantity::Temperature);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self {
            rate: T::from_setting(values.get(Id::TemperatureViscosity)),
            reference: T::from_setting(values.get(Id::TemperatureReference)),
        }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.rate = of.rate * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let factor = (-(self.rate * (sample.temperature_c - self.reference))).exp();
        effects.viscous_scale = effects.viscous_scale * factor;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.rate, self.reference, T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        // The exponent. The check of the viscous torque includes the effect on it.
        self.rate.single().abs() * (TEMPERATURES_C[1] - TEMPERATURES_C[0])
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        let (rate, reference) =
            (values.single(Id::TemperatureViscosity), values.single(Id::TemperatureReference));
        let factor = TEMPERATURES_C.map(|end| libm::expf(-rate * (end - reference)));
        bounds.viscous_factor *= factor[0].max(factor[1]);
    }
}
