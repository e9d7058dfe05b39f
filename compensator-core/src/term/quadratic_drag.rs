//! `+ c v |v|`: water drag.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct QuadraticDrag<T> {
    /// `c`, Nm s^2/rad^2.
    coefficient: T,
}

impl<T: Real> Term<T> for QuadraticDrag<T> {
    const PARAMETERS: &'static [Id] = &[Id::QuadraticDrag];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self { coefficient: T::from_setting(values.get(Id::QuadraticDrag)) }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.coefficient = of.coefficient * gain;
    }

    #[inline]
    fn act(&self, _: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let velocity = effects.velocity;
        effects.torque = effects.torque + self.coefficient * velocity * velocity.abs();
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.coefficient, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        let speed = envelope.velocity_max_rad_s;
        (self.coefficient.single().abs() * speed).max(1.0) * speed
    }

    fn widen<S: Real>(values: &ParameterValues<S>, envelope: &Envelope, bounds: &mut Bounds) {
        let speed = envelope.velocity_max_rad_s;
        bounds.torque += values.single(Id::QuadraticDrag).abs() * (speed * speed);
    }
}
