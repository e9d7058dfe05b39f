//! Makes levels and viscous coefficient depend on the direction of motion.

use super::interface::*;

/// Coefficients of the term for one sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DirectionAsymmetry<T> {
    /// Relative increase of the level in positive direction, and decrease in negative direction.
    coulomb: T,
    /// The same for the viscous coefficient.
    viscous: T,
}

impl<T: Real> Term<T> for DirectionAsymmetry<T> {
    const PARAMETERS: &'static [Id] = &[Id::CoulombAsymmetry, Id::ViscousAsymmetry];

    const SIZES: &'static [Id] = Self::PARAMETERS;

    type Memory = ();

    fn build(values: &ParameterValues<T::Setting>, _: T::Setting) -> Self {
        Self {
            coulomb: T::from_setting(values.get(Id::CoulombAsymmetry)),
            viscous: T::from_setting(values.get(Id::ViscousAsymmetry)),
        }
    }

    fn set_gain(&mut self, of: &Self, gain: T) {
        self.coulomb = of.coulomb * gain;
        self.viscous = of.viscous * gain;
    }

    #[inline]
    fn act(&self, _: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.level_asymmetry = effects.level_asymmetry + self.coulomb;
        effects.viscous_asymmetry = effects.viscous_asymmetry + self.viscous;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.coulomb, self.viscous, T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f32 {
        self.coulomb.single().abs().max(self.viscous.single().abs())
    }

    fn widen<S: Real>(values: &ParameterValues<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.scale_level_by_share(values.single(Id::CoulombAsymmetry).abs());
        bounds.viscous_factor *= 1.0 + values.single(Id::ViscousAsymmetry).abs();
    }
}
