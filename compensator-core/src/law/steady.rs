//! Static laws: a torque for a velocity, no state.
//!
//! They are what most robots run, and the yardstick the bristle laws must beat. All are silent at
//! exactly zero velocity; between rest and motion they jump, so a compensator that uses one chatters
//! about standstill unless it is fed the reference velocity there
//! ([`crate::compensator::CompensatorParameters::blend_velocity_rad_s`]).

use crate::effect::Effect;
use crate::number::Real;

/// `level sgn v + sigma2 v` plus the shape of one of the four laws.
#[derive(Clone, Copy, Debug)]
pub struct Steady<T> {
    /// `F_C`, Nm.
    pub coulomb: T,
    /// `sigma2`, Nm s/rad.
    pub viscous: T,
    /// Velocity is limited to this magnitude before anything else, rad/s.
    pub velocity_limit: T,
    /// What is added to Coulomb and viscous friction.
    pub shape: Shape<T>,
}

/// What a static law adds to Coulomb and viscous friction.
#[derive(Clone, Copy, Debug)]
pub enum Shape<T> {
    /// Nothing (paper 2, eq. 2-4).
    Linear,
    /// `f1 v |v| + f2 v^3` (paper 2, eq. 5), or with `printed` the even `f1 v sgn v = f1 |v|` of
    /// the print, which does not dissipate.
    Extended {
        /// `f1`, Nm s^2/rad^2 (printed form: Nm s/rad).
        quadratic: T,
        /// `f2`, Nm s^3/rad^3.
        cubic: T,
        /// Take eq. 5 as it is printed.
        printed: bool,
    },
    /// `f0 + fa atan(fb v)` (paper 2, eq. 6).
    Atan {
        /// `f0`, Nm.
        offset: T,
        /// `fa`, Nm.
        torque: T,
        /// `fb`, s/rad.
        slope: T,
    },
    /// `(F_S - F_C) exp(-(v/v_s)^2) sgn v`.
    Stribeck {
        /// `F_S`, Nm.
        static_level: T,
        /// `63/16 v_s`, rad/s.
        stribeck_end: T,
        /// `16 / v_s`, cells per rad/s.
        cells_per_velocity: T,
    },
}

impl<T: Real> Steady<T> {
    /// Friction torque, Nm, at `velocity` (rad/s; any bit pattern, as [`super::bristle::Lugre::step`]).
    #[inline(always)]
    pub fn torque<E: Effect<T>>(&self, velocity: T, effect: &E) -> T {
        let velocity = velocity.or_zero_if_nan().within(self.velocity_limit);
        let speed = velocity.abs();
        let coulomb = effect.coulomb(self.coulomb);
        let viscous = effect.viscous(self.viscous, velocity) * velocity;
        let sliding = |level: T| effect.level(level, velocity) * velocity.sign() + viscous;
        match self.shape {
            Shape::Linear => sliding(coulomb),
            Shape::Extended { quadratic, cubic, printed } => {
                // The coefficient goes first: fixed point could not hold the square of a speed.
                let along = if printed { quadratic } else { quadratic * velocity };
                sliding(coulomb) + along * speed + cubic * velocity * speed * speed
            }
            Shape::Atan { offset, torque, slope } => {
                sliding(coulomb) + offset + torque * (slope * velocity).atan()
            }
            Shape::Stribeck { static_level, stribeck_end, cells_per_velocity } => {
                let cells = effect.stribeck_speed(speed, stribeck_end) * cells_per_velocity;
                let towards_rest = effect.stribeck_argument(cells).stribeck_curve();
                let static_level = effect.static_level(static_level);
                sliding(coulomb + (static_level - coulomb) * towards_rest)
            }
        }
    }
}
