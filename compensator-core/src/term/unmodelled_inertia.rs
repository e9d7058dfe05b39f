//! `+ J dv/dt`: an inertia that was not subtracted from the torque.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct UnmodelledInertia<T> {
    /// `J`, kg m^2.
    inertia: T,
}

impl<T: Real> Term<T> for UnmodelledInertia<T> {
    const PARAMETERS: &'static [Id] = &[Id::Inertia];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self { inertia: T::from_setting(values.get(Id::Inertia)) }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.inertia = of.inertia * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.torque = effects.torque + self.inertia * sample.acceleration_rad_s2;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.inertia, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        self.inertia.single().abs() * envelope.acceleration_max_rad_s2
    }

    fn widen<S: Real>(values: &ParameterValues<S>, envelope: &Envelope, bounds: &mut Bounds) {
        let fastest = envelope.acceleration_max_rad_s2;
        bounds.torque += values.single(Id::Inertia).abs() * fastest;
    }
}
