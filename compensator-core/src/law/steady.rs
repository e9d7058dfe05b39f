//! The common part of the static laws: Coulomb and viscous friction without a state.
//!
//! Most robots use a static law, so it is the baseline for the bristle laws. Every static law returns 0 at zero
//! velocity, except the atan law, which has an offset. The torque is discontinuous there. A compensator that
//! uses a static law therefore chatters at standstill, unless it uses the reference velocity at low speed
//! ([`crate::compensator::CompensatorParameters::blend_velocity_rad_s`]).

use super::written::LawParameters;
use crate::effect::Effect;
use crate::number::Real;
use crate::parameter::ParameterId as Id;

/// Coefficients of `level sgn v + sigma2 v`.
#[derive(Clone, Copy, Debug)]
pub struct Steady<T> {
    /// `F_C`, Nm.
    pub coulomb: T,
    /// `sigma2`, Nm s/rad.
    pub viscous: T,
    /// Limit of the velocity magnitude, rad/s. The step applies it first.
    pub velocity_limit: T,
}

impl<T: Real> Steady<T> {
    /// Computes the coefficients from the parameters.
    pub(super) fn build(written: &LawParameters<T::Setting>) -> Self {
        let number = |id| T::from_setting(written.values.get(id));
        Self {
            coulomb: number(Id::CoulombTorque),
            viscous: number(Id::ViscousFriction),
            velocity_limit: written.velocity_limit(),
        }
    }

    /// Multiplies the level by `level` and the viscous coefficient by `viscous`.
    pub(super) fn scale_levels(&mut self, level: T, viscous: T) {
        self.coulomb = self.coulomb * level;
        self.viscous = self.viscous * viscous;
    }

    /// Limits a velocity (rad/s) of any bit pattern to the velocity limit; NaN becomes 0.
    #[inline(always)]
    pub(super) fn limited(&self, velocity: T) -> T {
        velocity.or_zero_if_nan().within(self.velocity_limit)
    }

    /// Returns the sliding torque at a limited velocity for a Coulomb level, Nm.
    #[inline(never)]
    pub(super) fn sliding<E: Effect<T>>(&self, level: T, velocity: T, effect: &E) -> T {
        let viscous = effect.viscous(self.viscous, velocity) * velocity;
        effect.level(level, velocity) * velocity.sign() + viscous
    }
}
