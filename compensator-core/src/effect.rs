//! What load, pressure and the extension terms do to a friction law in one sample.
//!
//! A law asks its [`Effect`] for every quantity something may have changed: the Coulomb and static
//! levels, the stiffness, the viscous coefficient. [`NoEffect`] answers each question with what it
//! was given and compiles to nothing, so the plain law costs, and gives the bits, as if effects did
//! not exist. [`SealEffect`] is the fixed set of the improved LuGre law. [`Effects`] is the general
//! set the term list fills in. The law itself is written once for the three.

use crate::curve;
use crate::number::{Real, Share};

/// Changes to a law's quantities; each method returns its argument unless something acts on it.
pub trait Effect<T: Real> {
    /// Coulomb level, Nm.
    #[inline(always)]
    fn coulomb(&self, base: T) -> T {
        base
    }
    /// Static level, Nm.
    #[inline(always)]
    fn static_level(&self, base: T) -> T {
        base
    }
    /// Level `g` when moving at `velocity`, Nm.
    #[inline(always)]
    fn level(&self, level: T, _velocity: T) -> T {
        level
    }
    /// The largest level in either direction, from the static level; the bound of the state, Nm.
    #[inline(always)]
    fn level_bound(&self, static_level: T) -> T {
        static_level
    }
    /// Viscous coefficient when moving at `velocity`, Nm s/rad.
    #[inline(always)]
    fn viscous(&self, base: T, _velocity: T) -> T {
        base
    }
    /// Bristle stiffness times the sample period, Nm s/rad.
    #[inline(always)]
    fn stiffness_step(&self, base: T) -> T {
        base
    }
    /// The bristle torque after motion other than the shaft's own turning has bent it, Nm.
    #[inline(always)]
    fn carried(&self, bristle_torque: T, _stiffness_step: T) -> T {
        bristle_torque
    }
    /// The bristle's rate with that motion counted in, rad/s.
    #[inline(always)]
    fn bristle_rate(&self, rate: T) -> T {
        rate
    }
    /// The Stribeck curve at this speed, rad/s, as [`Real::stribeck_share`].
    #[inline(always)]
    fn towards_rest(&self, speed: T, cells_per_velocity: T, end: T) -> Share<T> {
        speed.stribeck_share(cells_per_velocity, end)
    }
    /// The speed that is looked up, rad/s: beyond `end` the table's curve has ended.
    #[inline(always)]
    fn stribeck_speed(&self, speed: T, end: T) -> T {
        speed.up_to_curve_end(end)
    }
    /// Argument of the Stribeck curve, in cells.
    #[inline(always)]
    fn stribeck_argument(&self, cells: T) -> T {
        cells
    }
}

/// Nothing acts.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoEffect;

impl<T: Real> Effect<T> for NoEffect {}

/// Side load and pressure on the seal (improved LuGre, Ding et al., eq. 16).
#[derive(Clone, Copy, Debug)]
pub struct SealEffect<T> {
    /// Added to the Coulomb level, Nm.
    pub coulomb: T,
    /// Added to the static level, Nm.
    pub static_level: T,
    /// Bristle bending by the changing side load, rad/s.
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

/// Everything a list of terms can change.
#[derive(Clone, Copy, Debug)]
pub struct Effects<T> {
    /// Side load and pressure, and whatever else adds to the levels.
    pub seal: SealEffect<T>,
    /// Factor on the level in both directions.
    pub level_scale: T,
    /// The level is scaled by `1 + level_asymmetry` forwards, `1 - level_asymmetry` backwards.
    pub level_asymmetry: T,
    /// Factor on the viscous coefficient.
    pub viscous_scale: T,
    /// As `level_asymmetry`, for the viscous coefficient.
    pub viscous_asymmetry: T,
    /// Factor on the bristle stiffness.
    pub stiffness_scale: T,
    /// Half the Stribeck exponent, where it is not 1.
    pub half_exponent: Option<T>,
    /// Torque added outside the friction law, Nm.
    pub torque: T,
    /// The velocity the law is to see, rad/s.
    pub velocity: T,
    /// What the bristles hold before this sample, Nm. Terms read it; nothing they write to it counts.
    pub held: T,
}

impl<T: Real> Effects<T> {
    /// Nothing acts yet on a law moving at `velocity` whose bristles hold `held`.
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
    fn towards_rest(&self, speed: T, cells_per_velocity: T, end: T) -> Share<T> {
        if self.half_exponent.is_none_or(Real::is_neutral_exponent) {
            return speed.stribeck_share(cells_per_velocity, end);
        }
        let cells = self.stribeck_speed(speed, end) * cells_per_velocity;
        Share::of(self.stribeck_argument(cells).stribeck_curve())
    }
    #[inline(always)]
    fn stribeck_speed(&self, speed: T, end: T) -> T {
        // A curve of lower exponent reaches farther: it ends after its argument is formed.
        if self.half_exponent.is_some() { speed } else { speed.up_to_curve_end(end) }
    }
    #[inline(always)]
    fn stribeck_argument(&self, cells: T) -> T {
        match self.half_exponent {
            None => cells,
            Some(half_exponent) => {
                let per_cell = curve::CELLS_PER_STRIBECK_VELOCITY;
                let normalised = cells * T::from_f64(1.0 / per_cell);
                // Limited before it is scaled back: fixed point has no room for a high power.
                let end = T::from_f64(curve::LAST / per_cell);
                normalised.pow(half_exponent).at_most(end) * T::from_f64(per_cell)
            }
        }
    }
}
