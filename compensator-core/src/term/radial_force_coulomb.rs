//! `F_C += k F_L`, `F_S` likewise: side load compresses the seal.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct RadialForceCoulomb<T> {
    /// Increase of `F_C`, Nm/N.
    coulomb: T,
    /// Increase of `F_S`, Nm/N.
    static_level: T,
}

impl<T: Real> Term<T> for RadialForceCoulomb<T> {
    const PARAMETERS: &'static [Id] = &[Id::RadialForceCoulomb, Id::RadialForceStaticExcess];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    const READS: Option<Quantity> = Some(Quantity::RadialForce);

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        let (coulomb, excess) =
            (values.get(Id::RadialForceCoulomb), values.get(Id::RadialForceStaticExcess));
        Self { coulomb: T::from_setting(coulomb), static_level: T::from_setting(coulomb + excess) }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.coulomb = of.coulomb * gain;
        self.static_level = of.static_level * gain;
    }

    #[inline]
    fn act(&self, sample: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        let force = sample.radial_force_n;
        effects.seal.coulomb = effects.seal.coulomb + self.coulomb * force;
        effects.seal.static_level = effects.seal.static_level + self.static_level * force;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.coulomb, self.static_level, T::zero(), T::zero()]
    }

    fn largest_product(&self, envelope: &Envelope) -> f32 {
        let steeper = self.coulomb.single().abs().max(self.static_level.single().abs());
        steeper * envelope.radial_force_max_n
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.per_newton.coulomb += values.single(Id::RadialForceCoulomb);
        bounds.per_newton.excess += values.single(Id::RadialForceStaticExcess);
    }
}
