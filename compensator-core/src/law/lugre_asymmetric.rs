//! LuGre with separate levels for the two load directions (the damper paper, eq. 4).
//!
//! In the paper, `g` depends on the force that it determines. Here it depends on the sign of the bristle
//! torque, which is known. After a change of sign, the bristle torque can therefore exceed the level of the
//! new side for one sample, by at most the travel of that sample.

use super::bristle;
use super::interface::*;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct LugreAsymmetric<T> {
    /// The bristles, with the levels of the positive direction.
    pub positive: Bristles<T>,
    /// `F_C` if the bristle torque is not positive, Nm.
    pub coulomb_negative: T,
    /// `F_S` if the bristle torque is not positive, Nm.
    pub static_level_negative: T,
}

impl<T: Real> LugreAsymmetric<T> {
    /// Advances the bristle torque `held` (Nm) by one sample and returns the friction torque, Nm.
    #[inline(always)]
    pub fn step_with_effect<E: Effect<T>>(&self, held: &mut T, velocity: T, effect: &E) -> T {
        self.step(held, &mut (), velocity, effect).finish(held, velocity, effect)
    }
}

impl<T: Real> FrictionLaw<T> for LugreAsymmetric<T> {
    const PARAMETERS: &'static [Id] = &[
        Id::CoulombTorque,
        Id::StaticTorque,
        Id::CoulombTorqueNegative,
        Id::StaticTorqueNegative,
        Id::StribeckVelocity,
        Id::BristleStiffness,
        Id::BristleDamping,
        Id::ViscousFriction,
    ];

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, period_s: T::Setting) -> Self {
        let number = |id| T::from_setting(written.values.get(id));
        Self {
            positive: Bristles::build(written, period_s),
            coulomb_negative: number(Id::CoulombTorqueNegative),
            static_level_negative: number(Id::StaticTorqueNegative),
        }
    }

    fn rescale_period(&mut self, of: &Self, ratio: T) {
        self.positive.rescale_period(&of.positive, ratio);
    }

    fn scale_levels(&mut self, level: T, viscous: T) {
        self.positive.scale_levels(level, viscous);
        self.coulomb_negative = self.coulomb_negative * level;
        self.static_level_negative = self.static_level_negative * level;
    }

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.positive.velocity_limit
    }

    fn sliding_torque(&self) -> T {
        self.positive.coulomb
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, held: &mut T, (): &mut (), _: T, _: &E) -> Step<'_, T> {
        let positive = *held > T::zero();
        let coulomb = if positive { self.positive.coulomb } else { self.coulomb_negative };
        let static_level =
            if positive { self.positive.static_level } else { self.static_level_negative };
        Step::Bristles { bristles: &self.positive, coulomb, static_level }
    }

    fn check<N: Real, S: Real>(
        written: &LawParameters<S>,
        range: &LawRange,
    ) -> Result<f32, ParameterError> {
        bristle::check::<N, S>(written, range, written.values.single(Id::BristleDamping))
    }
}
