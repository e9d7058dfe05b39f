//! `g *= exp(-b (T - T0))`: the seal stiffens at low temperature.

use super::bounds::{LEAST_SHARE, TEMPERATURES_C};
use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TemperatureCoulomb<T> {
    /// `b`, 1/K.
    rate: T,
    /// `T0`, deg C.
    reference: T,
}

/// Returns the exponent at both ends of the valid temperature range.
#[inline(never)]
fn exponents<S: Real>(values: &ParameterValues<S>) -> [f32; 2] {
    let rate = values.single(Id::TemperatureCoulomb);
    let reference = values.single(Id::TemperatureReference);
    TEMPERATURES_C.map(|end| -rate * (end - reference))
}

impl<T: Real> Term<T> for TemperatureCoulomb<T> {
    const PARAMETERS: &'static [Id] = &[Id::TemperatureCoulomb, Id::TemperatureReference];

    const SIZES: &'static [Id] = &[Id::TemperatureCoulomb];

    const READS: Option<Quantity> = Some(Quantity::Temperature);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self {
            rate: T::from_setting(values.get(Id::TemperatureCoulomb)),
            reference: T::from_setting(values.get(Id::TemperatureReference)),
        }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.rate = of.rate * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let factor = (-(self.rate * (sample.temperature_c - self.reference))).exp();
        effects.level_scale = effects.level_scale * factor;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.rate, self.reference, T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        // The exponent. The check of the level includes the effect on the level.
        self.rate.single().abs() * (TEMPERATURES_C[1] - TEMPERATURES_C[0])
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        let [cold, hot] = exponents(values).map(libm::expf);
        bounds.scale_level(cold.min(hot), cold.max(hot));
    }

    fn validate<S: Real>(values: &ParameterValues<S>, _: &Envelope) -> Result<(), ParameterError> {
        let steepest = exponents(values).into_iter().map(f32::abs).fold(0.0, f32::max);
        let most = -libm::logf(LEAST_SHARE);
        if steepest > most {
            let rate = values.single(Id::TemperatureCoulomb);
            let why = text!("the level must stay positive, and sane, from -50 to 150 deg C");
            let bound = rate * most / steepest;
            let bound = if rate > 0.0 { Bound::AtMost(bound) } else { Bound::AtLeast(bound) };
            return refuse(Id::TemperatureCoulomb.text(), rate, bound, why);
        }
        Ok(())
    }
}
