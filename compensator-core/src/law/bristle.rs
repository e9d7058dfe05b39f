//! LuGre: friction as bristles that bend and slip.
//!
//! With `y = sigma0 z` (Nm) as state, the LuGre law reads (the damper paper, eq. 12-13; Ding et al., eq. 1 with
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

use super::written::{Range, Written, stribeck_axis};
use crate::effect::Effect;
use crate::fits::{coefficient, product};
use crate::number::Real;
use crate::parameter::ParameterId as Id;
use crate::refusal::ParameterError;

/// LuGre's bristles built for a sample period: what all bristle laws step.
#[derive(Clone, Copy, Debug)]
pub struct Bristles<T> {
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

impl<T: Real> Bristles<T> {
    /// Builds them for a sample period in s.
    pub(super) fn build(written: &Written<T::Setting>, period_s: T::Setting) -> Self {
        let constant = T::Setting::from_f64;
        let setting = |id| written.values.get(id);
        let number = |id| T::from_setting(setting(id));
        let stiffness_step = setting(Id::BristleStiffness) * period_s;
        let (damping, damping_at_rest) = if written.choices.damping_fades {
            (T::zero(), number(Id::BristleDamping))
        } else {
            (number(Id::BristleDamping), T::zero())
        };
        let (stribeck_end, cells_per_velocity) = stribeck_axis(written);
        Self {
            coulomb: number(Id::CoulombTorque),
            static_level: number(Id::StaticTorque),
            stribeck_end,
            cells_per_velocity,
            stiffness_step: T::from_setting(stiffness_step.at_most(constant(STIFFNESS_STEP_MAX))),
            damping,
            damping_at_rest,
            viscous: number(Id::ViscousFriction),
            velocity_limit: written.velocity_limit(),
        }
    }

    /// The same for a sample period `ratio` times as long.
    pub(super) fn rescale_period(&mut self, of: &Self, ratio: T) {
        self.stiffness_step = of.stiffness_step * ratio;
    }

    /// Advances the bristle torque by one sample and returns the friction torque, Nm, positive
    /// when it has to be driven towards positive velocity.
    ///
    /// `velocity` (rad/s) may be any bit pattern: beyond the limit it is limited, NaN counts as
    /// rest. `|bristle_torque|` is at most the static level afterwards.
    #[inline(always)]
    pub fn step<E: Effect<T>>(&self, bristle_torque: &mut T, velocity: T, effect: &E) -> T {
        self.step_between(bristle_torque, velocity, effect, self.coulomb, self.static_level)
    }

    /// The same between other levels, Nm, than the built ones.
    #[inline(always)]
    pub(super) fn step_between<E: Effect<T>>(
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

/// Largest `sigma0 dt`; the step is stable for any, but beyond this a float's square overflows.
const STIFFNESS_STEP_MAX: f64 = 1e15;

/// The products of a bristle step, in a number that has to hold them. The held torque is at most the largest
/// level and what a jump of the side load adds to it; the numerator of the rate, level plus held torque times
/// speed; and the rate, that over the smallest level, or over the stiffness step. Returns the largest
/// torque of the damping, Nm, for a law with such a `sigma1`.
pub(super) fn check<N: Real, S: Real>(
    written: &Written<S>,
    range: &Range,
    damping: f64,
) -> Result<f64, ParameterError> {
    let Range { period_s, speed, largest_level: level, .. } = *range;
    let step = written.values.value(Id::BristleStiffness) * period_s;
    coefficient::<N>("bristle_stiffness * sample_period", step)?;
    let per_newton = range.bounds.travel_per_newton / period_s;
    coefficient::<N>("radial_force_rate / sample_period", per_newton)?;
    let bent = per_newton.abs() * f64::from(written.envelope.radial_force_max_n);
    product::<N>("radial_force_rate * radial_force_max / sample_period", bent)?;
    product::<N>("bristle_stiffness * radial_force_rate * radial_force_max", step * bent)?;
    let both = 2.0 * level + step * bent;
    product::<N>("level * velocity_max", both * speed)?;
    product::<N>("bristle_stiffness * sample_period * velocity_max", step * speed + level)?;
    let rate = (both * speed / range.smallest_level).min(both / step);
    product::<N>("bristle rate", rate)?;
    let damped = damping * (rate + bent);
    product::<N>("bristle_damping * bristle rate", damped)?;
    Ok(damped)
}
