//! `exp(-|v/v_s|^delta)`: the Stribeck curve with another exponent.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct StribeckShape<T> {
    /// Half the exponent.
    half_exponent: T,
}

impl<T: Real> Term<T> for StribeckShape<T> {
    const PARAMETERS: &'static [Id] = &[Id::StribeckExponent];

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        let half = T::Setting::from_f64(0.5);
        Self { half_exponent: T::from_setting(values.get(Id::StribeckExponent) * half) }
    }

    #[inline]
    fn act(&self, _: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.half_exponent = Some(self.half_exponent);
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.half_exponent, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        self.half_exponent.single().abs()
    }

    fn widen<S: Real>(_: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.bends_stribeck_curve = true;
    }
}
