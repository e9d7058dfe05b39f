//! Effects of side load, pressure and extension terms on a friction law in one sample.
//!
//! A law passes every modifiable quantity through its [`Effect`]: the Coulomb and static levels, the
//! stiffness and the viscous coefficient. Each law is written once for three effects:
//!
//! * [`NoEffect`] returns each quantity unchanged. It compiles to nothing, so the plain law has no overhead.
//! * [`SealEffect`] is the fixed set of effects of the improved LuGre law.
//! * [`Effects`] is the general set that the terms fill in.

use crate::curve;
use crate::number::{Real, Share};

/// Axis of the table of the Stribeck curve. The default holds every speed in the first cell.
#[derive(Clone, Copy, Debug, Default)]
pub struct StribeckAxis<T> {
    /// Speed at the end of the table, `63/16 v_s`, rad/s.
    pub end_rad_s: T,
    /// `16 / v_s`, cells per rad/s.
    pub cells_per_rad_s: T,
}

impl<T: Real> StribeckAxis<T> {
    /// Computes the axis for this Stribeck velocity `v_s`, rad/s.
    pub fn new(velocity_rad_s: T::Setting) -> Self {
        let (cells, last) = (curve::CELLS_PER_STRIBECK_VELOCITY, curve::LAST);
        let end = velocity_rad_s * T::Setting::from_f64(last / cells);
        let cells = T::Setting::from_f64(cells) / velocity_rad_s;
        Self { end_rad_s: T::from_setting(end), cells_per_rad_s: T::from_setting(cells) }
    }
}

/// Modifies the quantities of a law. By default, each method returns its argument unchanged.
pub trait Effect<T: Real> {
    /// Returns the Coulomb level, Nm.
    #[inline(always)]
    fn coulomb(&self, base: T) -> T {
        base
    }
    /// Returns the static level, Nm.
    #[inline(always)]
    fn static_level(&self, base: T) -> T {
        base
    }
    /// Returns the level `g` at `velocity`, Nm.
    #[inline(always)]
    fn level(&self, level: T, _velocity: T) -> T {
        level
    }
    /// Returns the largest level in either direction for a static level, Nm. It bounds the bristle torque.
    #[inline(always)]
    fn level_bound(&self, static_level: T) -> T {
        static_level
    }
    /// Returns the viscous coefficient at `velocity`, Nm s/rad.
    #[inline(always)]
    fn viscous(&self, base: T, _velocity: T) -> T {
        base
    }
    /// Returns the bristle stiffness times the sample period, Nm s/rad.
    #[inline(always)]
    fn stiffness_step(&self, base: T) -> T {
        base
    }
    /// Returns the bristle torque after deflection by causes other than shaft motion, Nm.
    #[inline(always)]
    fn carried(&self, bristle_torque: T, _stiffness_step: T) -> T {
        bristle_torque
    }
    /// Returns the bristle deflection rate including these causes, rad/s.
    #[inline(always)]
    fn bristle_rate(&self, rate: T) -> T {
        rate
    }
    /// Returns the Stribeck curve at a speed, rad/s, as [`Real::stribeck_share`] does.
    #[inline(always)]
    fn towards_rest(&self, speed: T, axis: &StribeckAxis<T>) -> Share<T> {
        speed.stribeck_share(axis.cells_per_rad_s, axis.end_rad_s)
    }
    /// Returns the speed for the curve's table, rad/s. The curve is 0 from the speed `end` on.
    #[inline(always)]
    fn stribeck_speed(&self, speed: T, end: T) -> T {
        speed.up_to_curve_end(end)
    }
    /// Returns the argument of the Stribeck curve, in cells of its table.
    #[inline(always)]
    fn stribeck_argument(&self, cells: T) -> T {
        cells
    }
}

/// The effect that changes nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoEffect;

impl<T: Real> Effect<T> for NoEffect {}

/// Effect of side load and pressure on the seal (improved LuGre, Ding et al., eq. 16).
#[derive(Clone, Copy, Debug)]
pub struct SealEffect<T> {
    /// Added to the Coulomb level, Nm.
    pub coulomb: T,
    /// Added to the static level, Nm.
    pub static_level: T,
    /// Bristle deflection rate from the changing side load, rad/s.
    pub bristle_rate: T,
}

impl<T: Real> Effect<T> for SealEffect<T> {
    #[inline(always)]
    fn coulomb(&self, base: T) -> T {
        base + self.coulomb
    }
    #[inline(always)]
    fn static_level(&self, base: T) -> T {
        base + self.static_level
    }
    #[inline(always)]
    fn carried(&self, bristle_torque: T, stiffness_step: T) -> T {
        bristle_torque + stiffness_step * self.bristle_rate
    }
    #[inline(always)]
    fn bristle_rate(&self, rate: T) -> T {
        rate + self.bristle_rate
    }
}

/// The combined effect of all terms.
#[derive(Clone, Copy, Debug)]
pub struct Effects<T> {
    /// Effect of side load and pressure, and all additions to the levels.
    pub seal: SealEffect<T>,
    /// Factor of the level in both directions.
    pub level_scale: T,
    /// Asymmetry of the level: the factor is `1 + level_asymmetry` forwards and `1 - level_asymmetry` backwards.
    pub level_asymmetry: T,
    /// Factor of the viscous coefficient.
    pub viscous_scale: T,
    /// Asymmetry of the viscous coefficient, as `level_asymmetry`.
    pub viscous_asymmetry: T,
    /// Factor of the bristle stiffness.
    pub stiffness_scale: T,
    /// Half the Stribeck exponent; `None` if that half is 1.
    pub half_exponent: Option<T>,
    /// Torque added outside the friction law, Nm.
    pub torque: T,
    /// Velocity for the law, rad/s.
    pub velocity: T,
    /// Bristle torque before this sample, Nm. Terms read it; writing to it has no effect.
    pub held: T,
}

impl<T: Real> Effects<T> {
    /// Returns neutral effects for a velocity, rad/s, and a bristle torque before this sample, Nm.
    #[inline(always)]
    pub fn none(velocity: T, held: T) -> Self {
        let (zero, one) = (T::zero(), T::one());
        Self {
            seal: SealEffect { coulomb: zero, static_level: zero, bristle_rate: zero },
            level_scale: one,
            level_asymmetry: zero,
            viscous_scale: one,
            viscous_asymmetry: zero,
            stiffness_scale: one,
            half_exponent: None,
            torque: zero,
            velocity,
            held,
        }
    }
}

impl<T: Real> Effect<T> for Effects<T> {
    #[inline(always)]
    fn coulomb(&self, base: T) -> T {
        self.seal.coulomb(base)
    }
    #[inline(always)]
    fn static_level(&self, base: T) -> T {
        self.seal.static_level(base)
    }
    #[inline(always)]
    fn level(&self, level: T, velocity: T) -> T {
        level * self.level_scale * (T::one() + self.level_asymmetry * velocity.sign())
    }
    #[inline(always)]
    fn level_bound(&self, static_level: T) -> T {
        static_level * self.level_scale * (T::one() + self.level_asymmetry.abs())
    }
    #[inline(always)]
    fn viscous(&self, base: T, velocity: T) -> T {
        base * self.viscous_scale * (T::one() + self.viscous_asymmetry * velocity.sign())
    }
    #[inline(always)]
    fn stiffness_step(&self, base: T) -> T {
        base * self.stiffness_scale
    }
    #[inline(always)]
    fn carried(&self, bristle_torque: T, stiffness_step: T) -> T {
        self.seal.carried(bristle_torque, stiffness_step)
    }
    #[inline(always)]
    fn bristle_rate(&self, rate: T) -> T {
        self.seal.bristle_rate(rate)
    }
    #[inline(always)]
    fn towards_rest(&self, speed: T, axis: &StribeckAxis<T>) -> Share<T> {
        if self.half_exponent.is_none_or(Real::is_neutral_exponent) {
            return speed.stribeck_share(axis.cells_per_rad_s, axis.end_rad_s);
        }
        let cells = self.stribeck_speed(speed, axis.end_rad_s) * axis.cells_per_rad_s;
        Share::of(self.stribeck_argument(cells).stribeck_curve())
    }
    #[inline(always)]
    fn stribeck_speed(&self, speed: T, end: T) -> T {
        // A curve with a lower exponent extends to higher speeds. Its end applies to the argument instead.
        if self.half_exponent.is_some() { speed } else { speed.up_to_curve_end(end) }
    }
    #[inline(always)]
    fn stribeck_argument(&self, cells: T) -> T {
        match self.half_exponent {
            None => cells,
            Some(half_exponent) => {
                let per_cell = curve::CELLS_PER_STRIBECK_VELOCITY;
                let normalised = cells * T::from_f64(1.0 / per_cell);
                // The limit precedes the scaling, because a high power may exceed the range of fixed point.
                let end = T::from_f64(curve::LAST / per_cell);
                normalised.pow(half_exponent).at_most(end) * T::from_f64(per_cell)
            }
        }
    }
}
