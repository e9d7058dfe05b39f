//! Levels and viscous part differ by direction.

use super::bounds::Bounds;
use super::interface::{COEFFICIENTS, Term};
use crate::effect::Effects;
use crate::envelope::Envelope;
use crate::number::Real;
use crate::parameter::{ParameterId as Id, Values};
use crate::quantity::{Quantity, Sample};
use crate::refusal::ParameterError;

/// Built for a sample period.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DirectionAsymmetry<T> {
    /// What forwards motion has more, and backwards motion less, as a share of the level.
    coulomb: T,
    /// The same of the viscous coefficient.
    viscous: T,
}

impl<T: Real> Term<T> for DirectionAsymmetry<T> {
    const PARAMETERS: &'static [Id] = &[Id::CoulombAsymmetry, Id::ViscousAsymmetry];

    const READS: Option<Quantity> = None;

    type Memory = ();

    fn build(values: &Values<T::Setting>, _: T::Setting) -> Self {
        Self {
            coulomb: T::from_setting(values.get(Id::CoulombAsymmetry)),
            viscous: T::from_setting(values.get(Id::ViscousAsymmetry)),
        }
    }

    fn rescale_period(&self, _: T) -> Self {
        *self
    }

    #[inline]
    fn act(&self, _: &Sample<T>, _: &mut Self::Memory, effects: &mut Effects<T>) {
        effects.level_asymmetry = effects.level_asymmetry + self.coulomb;
        effects.viscous_asymmetry = effects.viscous_asymmetry + self.viscous;
    }

    fn coefficients(&self) -> [T; COEFFICIENTS] {
        [self.coulomb, self.viscous, T::zero(), T::zero()]
    }

    fn largest_product(&self, _: &Envelope) -> f64 {
        self.coulomb.value().abs().max(self.viscous.value().abs())
    }

    fn widen<S: Real>(values: &Values<S>, _: &Envelope, bounds: &mut Bounds) {
        bounds.scale_level_by_share(values.value(Id::CoulombAsymmetry).abs());
        bounds.viscous_factor *= 1.0 + values.value(Id::ViscousAsymmetry).abs();
    }

    fn validate<S: Real>(_: &Values<S>, _: &Envelope) -> Result<(), ParameterError> {
        Ok(())
    }
}
