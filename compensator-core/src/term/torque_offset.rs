//! `+ c`: the zero error of a torque sensor.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TorqueOffset<T> {
    /// `c`, Nm.
    offset: T,
}

impl<T: Real> Term<T> for TorqueOffset<T> {
    const PARAMETERS: &'static [Id] = &[Id::TorqueOffset];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self { offset: T::from_setting(values.get(Id::TorqueOffset)) }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.offset = of.offset * gain;
    }

    #[inline]
    fn act(&self, _: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.torque = effects.torque + self.offset;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.offset, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        self.offset.single().abs()
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.torque += values.single(Id::TorqueOffset).abs();
    }
}
