//! LuGre: friction modelled as elastic bristles that deflect and slip.
//!
//! The state is the bristle torque `y = sigma0 z` (Nm). The law follows the damper paper, eq. 12-13. It is also
//! eq. 1 of Ding et al., with the modulus that the printed equation omits:
//!
//! ```text
//! y' = sigma0 (v - |v| y / g)        F = y + sigma1 z' + sigma2 v
//! g  = F_C + (F_S - F_C) exp(-(v/v_s)^2)
//! ```
//!
//! The step is backward Euler, solved in closed form. With `s = sigma0 dt`:
//!
//! ```text
//! z'    = (g v - |v| y) / (g + s |v|)          the one division
//! y_new = y + s z'      (= g (y + s v) / (g + s |v|))
//! ```
//!
//! `y_new` lies between `y` and `g sgn v` for every `s` and `v`. The step is therefore stable for any bristle
//! stiffness and sample period. Explicit Euler is unstable if `s |v| / g > 2`.
//!
//! The step is computed through the rate `z'`, which is exactly 0 at rest. The bristle torque then does not
//! drift by rounding. The form with `g (y + s v)` in the numerator would drift.
//!
//! The step has no data-dependent branches. `tests/emulator/core-cost.tsv` bounds its instructions.

use super::written::{LawParameters, LawRange};
use crate::effect::{Effect, StribeckAxis};
use crate::fits::{coefficient, product};
use crate::number::Real;
use crate::parameter::ParameterId as Id;
use crate::refusal::ParameterError;
use crate::text;

/// Coefficients of the LuGre bristles for one sample period, shared by all bristle laws.
#[derive(Clone, Copy, Debug)]
pub struct Bristles<T> {
    /// `F_C`, Nm.
    pub coulomb: T,
    /// `F_S`, Nm; at least `coulomb`.
    pub static_level: T,
    /// Axis of the Stribeck table.
    pub stribeck_axis: StribeckAxis<T>,
    /// `sigma0 dt`, Nm s/rad.
    pub stiffness_step: T,
    /// `sigma1` in fast sliding, Nm s/rad.
    pub damping: T,
    /// Increase of `sigma1` from fast sliding to rest, along the Stribeck curve, Nm s/rad; 0 for a constant `sigma1`.
    pub damping_at_rest: T,
    /// `sigma2`, Nm s/rad.
    pub viscous: T,
    /// Limit of the velocity magnitude, rad/s. The step applies it first.
    pub velocity_limit: T,
}

impl<T: Real> Bristles<T> {
    /// Computes the coefficients for a sample period in s.
    #[inline(never)]
    pub(super) fn build(written: &LawParameters<T::Setting>, period_s: T::Setting) -> Self {
        let constant = T::Setting::from_f64;
        let setting = |id| written.values.get(id);
        let number = |id| T::from_setting(setting(id));
        let stiffness_step = setting(Id::BristleStiffness) * period_s;
        let (damping, damping_at_rest) = if written.choices.damping_fades {
            (T::zero(), number(Id::BristleDamping))
        } else {
            (number(Id::BristleDamping), T::zero())
        };
        Self {
            coulomb: number(Id::CoulombTorque),
            static_level: number(Id::StaticTorque),
            stribeck_axis: StribeckAxis::new(setting(Id::StribeckVelocity)),
            stiffness_step: T::from_setting(stiffness_step.at_most(constant(STIFFNESS_STEP_MAX))),
            damping,
            damping_at_rest,
            viscous: number(Id::ViscousFriction),
            velocity_limit: written.velocity_limit(),
        }
    }

    /// Sets the coefficients to those of `of` for a sample period `ratio` times as long.
    pub(super) fn rescale_period(&mut self, of: &Self, ratio: T) {
        self.stiffness_step = of.stiffness_step * ratio;
    }

    /// Multiplies both levels by `level` and the viscous coefficient by `viscous`.
    pub(super) fn scale_levels(&mut self, level: T, viscous: T) {
        self.coulomb = self.coulomb * level;
        self.static_level = self.static_level * level;
        self.viscous = self.viscous * viscous;
    }

    /// Advances the bristle torque by one sample and returns the friction torque, Nm.
    ///
    /// A positive result is the torque that must drive the joint in the positive direction.
    /// `velocity` (rad/s) may have any bit pattern. It is limited to the velocity limit; NaN is
    /// treated as rest. Afterwards `|bristle_torque|` is at most the static level.
    #[inline(always)]
    pub fn step<E: Effect<T>>(&self, bristle_torque: &mut T, velocity: T, effect: &E) -> T {
        self.step_between(bristle_torque, velocity, effect, self.coulomb, self.static_level)
    }

    /// As [`Bristles::step`], with the Coulomb and static levels given as arguments, Nm.
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

        let towards_rest = effect.towards_rest(speed, &self.stribeck_axis);
        let coulomb = effect.coulomb(coulomb);
        let static_level = effect.static_level(static_level);
        let level = coulomb.plus_share(static_level - coulomb, towards_rest);
        let level = effect.level(level, velocity);

        // Side load deflects the bristles at the seal. Play in the drive does not reduce this stiffness.
        let held = effect.carried(*bristle_torque, self.stiffness_step);
        let stiffness_step = effect.stiffness_step(self.stiffness_step);
        let rate = T::difference_of_products(level, velocity, speed, held)
            .ratio(level.plus_product(stiffness_step, speed));
        // The exact result is within the level. The bound removes the rounding error, and the excess
        // if the level decreased since the previous sample.
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

/// Maximum of `sigma0 dt`, Nm s/rad. The step is stable for any value, but the square of a larger `f32` overflows.
const STIFFNESS_STEP_MAX: f64 = 1e15;

/// Checks that the number type `N` can represent every product of a bristle step.
///
/// The bristle torque is at most the largest level plus the contribution of a side-load step. The numerator of
/// the rate is at most the level plus the bristle torque, times the speed. The rate is at most this numerator
/// over the smallest level, or the sum of level and bristle torque over the stiffness step.
///
/// Returns the largest damping torque, Nm, for `sigma1 = damping` in Nm s/rad.
///
/// # Errors
/// Names the first product that `N` cannot represent.
pub(super) fn check<N: Real, S: Real>(
    written: &LawParameters<S>,
    range: &LawRange,
    damping: f32,
) -> Result<f32, ParameterError> {
    let LawRange { period_s, speed_rad_s: speed, largest_level_nm: level, .. } = *range;
    let step = written.values.single(Id::BristleStiffness) * period_s;
    coefficient::<N>(text!("bristle_stiffness * sample_period"), step)?;
    let per_newton = range.bounds.travel_per_newton / period_s;
    coefficient::<N>(text!("radial_force_rate / sample_period"), per_newton)?;
    let bent = per_newton.abs() * written.envelope.radial_force_max_n;
    product::<N>(text!("radial_force_rate * radial_force_max / sample_period"), bent)?;
    product::<N>(text!("bristle_stiffness * radial_force_rate * radial_force_max"), step * bent)?;
    let both = 2.0 * level + step * bent;
    product::<N>(text!("level * velocity_max"), both * speed)?;
    product::<N>(text!("bristle_stiffness * sample_period * velocity_max"), step * speed + level)?;
    let rate = (both * speed / range.smallest_level_nm).min(both / step);
    product::<N>(text!("bristle rate"), rate)?;
    let damped = damping * (rate + bent);
    product::<N>(text!("bristle_damping * bristle rate"), damped)?;
    Ok(damped)
}
