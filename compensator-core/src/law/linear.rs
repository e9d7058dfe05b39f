//! Coulomb and viscous friction (the manipulator paper, eq. 2-4).

use super::interface::*;
use super::steady::Steady;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct Linear<T> {
    /// Coulomb and viscous friction.
    pub steady: Steady<T>,
}

impl<T: Real> FrictionLaw<T> for Linear<T> {
    const PARAMETERS: &'static [Id] = &[Id::CoulombTorque, Id::ViscousFriction];

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, _: T::Setting) -> Self {
        Self { steady: Steady::build(written) }
    }

    fn scale_levels(&mut self, level: T, viscous: T) {
        self.steady.scale_levels(level, viscous);
    }

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.steady.velocity_limit
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, _: &mut T, (): &mut (), velocity: T, effect: &E) -> Step<'_, T> {
        let velocity = self.steady.limited(velocity);
        Step::Done(self.steady.sliding(effect.coulomb(self.steady.coulomb), velocity, effect))
    }
}
