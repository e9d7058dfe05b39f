//! Coulomb and viscous friction plus `(F_S - F_C) exp(-(v/v_s)^2) sgn v`: LuGre in steady sliding.

use super::interface::*;
use super::steady::Steady;
use crate::effect::StribeckAxis;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct Stribeck<T> {
    /// Coulomb and viscous friction.
    pub steady: Steady<T>,
    /// `F_S`, Nm.
    pub static_level: T,
    /// Axis of the Stribeck table.
    pub stribeck_axis: StribeckAxis<T>,
}

impl<T: Real> FrictionLaw<T> for Stribeck<T> {
    const PARAMETERS: &'static [Id] =
        &[Id::CoulombTorque, Id::StaticTorque, Id::StribeckVelocity, Id::ViscousFriction];

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, _: T::Setting) -> Self {
        Self {
            steady: Steady::build(written),
            static_level: T::from_setting(written.values.get(Id::StaticTorque)),
            stribeck_axis: StribeckAxis::new(written.values.get(Id::StribeckVelocity)),
        }
    }

    fn scale_levels(&mut self, level: T, viscous: T) {
        self.steady.scale_levels(level, viscous);
        self.static_level = self.static_level * level;
    }

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.steady.velocity_limit
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, _: &mut T, (): &mut (), velocity: T, effect: &E) -> Step<'_, T> {
        let velocity = self.steady.limited(velocity);
        let coulomb = effect.coulomb(self.steady.coulomb);
        let axis = &self.stribeck_axis;
        let cells = effect.stribeck_speed(velocity.abs(), axis.end_rad_s) * axis.cells_per_rad_s;
        let towards_rest = effect.stribeck_argument(cells).stribeck_curve();
        let static_level = effect.static_level(self.static_level);
        let level = coulomb + (static_level - coulomb) * towards_rest;
        Step::Done(self.steady.sliding(level, velocity, effect))
    }
}
