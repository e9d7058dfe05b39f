//! `F_C += k |tau_L|`, `F_S` likewise: the transmitted torque loads the gear.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LoadTorqueCoulomb<T> {
    /// Increase of the levels per transmitted torque, Nm/Nm.
    coefficient: T,
}

impl<T: Real> Term<T> for LoadTorqueCoulomb<T> {
    const PARAMETERS: &'static [Id] = &[Id::LoadCoulomb];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    const READS: Option<Quantity> = Some(Quantity::LoadTorque);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self { coefficient: T::from_setting(values.get(Id::LoadCoulomb)) }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.coefficient = of.coefficient * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let added = self.coefficient * sample.load_torque_nm.abs();
        effects.seal.coulomb = effects.seal.coulomb + added;
        effects.seal.static_level = effects.seal.static_level + added;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.coefficient, T::zero(), T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        self.coefficient.single().abs() * envelope.load_torque_max_nm
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.per_load_torque.coulomb += values.single(Id::LoadCoulomb);
    }
}
