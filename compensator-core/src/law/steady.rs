//! What the static laws have in common: Coulomb and viscous friction, and no state.
//!
//! They are what most robots run, and the yardstick the bristle laws must beat. All are silent at
//! exactly zero velocity; between rest and motion they jump, so a compensator that uses one chatters
//! about standstill unless it is fed the reference velocity there
//! ([`crate::compensator::CompensatorParameters::blend_velocity_rad_s`]).

use super::written::Written;
use crate::effect::Effect;
use crate::number::Real;
use crate::parameter::ParameterId as Id;

/// `level sgn v + sigma2 v`.
#[derive(Clone, Copy, Debug)]
pub struct Steady<T> {
    /// `F_C`, Nm.
    pub coulomb: T,
    /// `sigma2`, Nm s/rad.
    pub viscous: T,
    /// Velocity is limited to this magnitude before anything else, rad/s.
    pub velocity_limit: T,
}

impl<T: Real> Steady<T> {
    /// Built from parameters.
    pub(super) fn build(written: &Written<T::Setting>) -> Self {
        let number = |id| T::from_setting(written.values.get(id));
        Self {
            coulomb: number(Id::CoulombTorque),
            viscous: number(Id::ViscousFriction),
            velocity_limit: written.velocity_limit(),
        }
    }

    /// Velocity made fit, whatever its bits.
    #[inline(always)]
    pub(super) fn limited(&self, velocity: T) -> T {
        velocity.or_zero_if_nan().within(self.velocity_limit)
    }

    /// The torque at a limited velocity for a level, Nm.
    #[inline(never)]
    pub(super) fn sliding<E: Effect<T>>(&self, level: T, velocity: T, effect: &E) -> T {
        let viscous = effect.viscous(self.viscous, velocity) * velocity;
        effect.level(level, velocity) * velocity.sign() + viscous
    }
}
