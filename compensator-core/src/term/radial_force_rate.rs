//! `dz/dt += eta3 dF_L/dt`: a change of the side load deflects the bristles.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RadialForceRate<T> {
    /// Bristle rate per change of the side load in one sample, rad/(s N).
    per_newton: T,
}

impl<T: Real> Term<T> for RadialForceRate<T> {
    const PARAMETERS: &'static [Id] = &[Id::RadialForceRate];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    const READS: Option<Quantity> = Some(Quantity::RadialForce);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, period_s: T::Setting) -> Self {
        Self { per_newton: T::from_setting(values.get(Id::RadialForceRate) / period_s) }
    }

    fn rescale_period(&self, ratio: T) -> Self {
        Self { per_newton: self.per_newton / ratio }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.per_newton = of.per_newton * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.seal.bristle_rate =
            effects.seal.bristle_rate + self.per_newton * sample.radial_force_change_n;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.per_newton, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        self.per_newton.single().abs() * envelope.radial_force_max_n
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.travel_per_newton += values.single(Id::RadialForceRate);
    }
}
