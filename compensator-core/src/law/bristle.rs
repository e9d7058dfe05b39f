//! LuGre: friction as bristles that bend and slip.
//!
//! With `y = sigma0 z` (Nm) as state, the LuGre law reads (paper 1, eq. 12-13; paper 0, eq. 1 with
//! the modulus its print lacks)
//!
//! ```text
//! y' = sigma0 (v - |v| y / g)        F = y + sigma1 z' + sigma2 v
//! g  = F_C + (F_S - F_C) exp(-(v/v_s)^2)
//! ```
//!
//! The step is backward Euler solved in closed form. With `s = sigma0 dt`,
//!
//! ```text
//! z'    = (g v - |v| y) / (g + s |v|)          the one division
//! y_new = y + s z'      (= g (y + s v) / (g + s |v|))
//! ```
//!
//! `y_new` lies between `y` and `g sgn v` for every `s` and `v`, so it cannot leave the friction
//! level however stiff the bristles or slow the loop; explicit Euler does as soon as
//! `s |v| / g > 2`. Written through the *rate*, the step adds nothing at all at rest, so a held
//! torque does not creep by rounding: the form with `g (y + s v)` in the numerator would.
//!
//! One path for every input: on a Cortex-M4F the plain step takes 55 instructions in `f32`, and
//! the improved one 75 as a model (`tests/cost/table.md`).

use crate::curve;
use crate::effect::Effect;
use crate::number::Real;

/// A LuGre law built for a sample period. Dahl is the one with equal levels and no damping.
#[derive(Clone, Copy, Debug)]
pub struct Lugre<T> {
    /// `F_C`, Nm.
    pub coulomb: T,
    /// `F_S`, Nm; at least `coulomb`.
    pub static_level: T,
    /// Largest velocity of the Stribeck table, `63/16 v_s`, rad/s.
    pub stribeck_end: T,
    /// `16 / v_s`, cells per rad/s.
    pub cells_per_velocity: T,
    /// `sigma0 dt`, Nm s/rad.
    pub stiffness_step: T,
    /// `sigma1` in fast sliding, Nm s/rad.
    pub damping: T,
    /// What `sigma1` gains towards rest, along the Stribeck curve; 0 for a constant `sigma1`.
    pub damping_at_rest: T,
    /// `sigma2`, Nm s/rad.
    pub viscous: T,
    /// Velocity is limited to this magnitude before anything else, rad/s.
    pub velocity_limit: T,
}

impl<T: Real> Lugre<T> {
    /// Advances the bristle torque by one sample and returns the friction torque, Nm, positive
    /// when it has to be driven towards positive velocity.
    ///
    /// `velocity` (rad/s) may be any bit pattern: beyond the limit it is limited, NaN counts as
    /// rest. `|bristle_torque|` is at most the static level afterwards.
    #[inline(always)]
    pub fn step<E: Effect<T>>(&self, bristle_torque: &mut T, velocity: T, effect: &E) -> T {
        self.step_between(bristle_torque, velocity, effect, self.coulomb, self.static_level)
    }

    #[inline(always)]
    fn step_between<E: Effect<T>>(
        &self,
        bristle_torque: &mut T,
        velocity: T,
        effect: &E,
        coulomb: T,
        static_level: T,
    ) -> T {
        let (velocity, speed) = velocity.limited_with_magnitude(self.velocity_limit);

        let towards_rest = effect.towards_rest(speed, self.cells_per_velocity, self.stribeck_end);
        let coulomb = effect.coulomb(coulomb);
        let static_level = effect.static_level(static_level);
        let level = coulomb.plus_share(static_level - coulomb, towards_rest);
        let level = effect.level(level, velocity);

        // Side load bends the bristles at the seal: play in the drive does not soften that.
        let held = effect.carried(*bristle_torque, self.stiffness_step);
        let stiffness_step = effect.stiffness_step(self.stiffness_step);
        let rate = T::difference_of_products(level, velocity, speed, held)
            .ratio(level.plus_product(stiffness_step, speed));
        // The exact result is within the level; the bound takes off the last rounding, and what a
        // level that fell since the last sample leaves over.
        let bound = effect.level_bound(static_level);
        *bristle_torque = held.plus_product(stiffness_step, rate).within_level(bound);

        let damping = self.damping.plus_share(self.damping_at_rest, towards_rest);
        let rate = effect.bristle_rate(rate);
        bristle_torque.plus_products(
            damping,
            rate,
            effect.viscous(self.viscous, velocity),
            velocity,
        )
    }
}

/// A LuGre law whose levels depend on the direction it is loaded in (paper 1, eq. 4).
///
/// The print lets `g` depend on the force it is about to give; here the sign of the held torque
/// decides, which is known. A state can thus stand above the level of the side it crosses to by
/// one sample's travel at most.
#[derive(Clone, Copy, Debug)]
pub struct AsymmetricLugre<T> {
    /// The law with the levels of the positive side.
    pub positive: Lugre<T>,
    /// `F_C` where the held torque is not positive, Nm.
    pub coulomb_negative: T,
    /// `F_S` where the held torque is not positive, Nm.
    pub static_level_negative: T,
}

impl<T: Real> AsymmetricLugre<T> {
    /// As [`Lugre::step`].
    #[inline(always)]
    pub fn step<E: Effect<T>>(&self, bristle_torque: &mut T, velocity: T, effect: &E) -> T {
        let positive = *bristle_torque > T::zero();
        let coulomb = if positive { self.positive.coulomb } else { self.coulomb_negative };
        let static_level =
            if positive { self.positive.static_level } else { self.static_level_negative };
        self.positive.step_between(bristle_torque, velocity, effect, coulomb, static_level)
    }
}

/// Largest velocity the Stribeck table reaches, in units of `v_s`.
pub(crate) const STRIBECK_END: f64 = curve::LAST / curve::CELLS_PER_STRIBECK_VELOCITY;
