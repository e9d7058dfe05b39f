//! Factors of a network on the levels and the stiffness of a law.

use crate::effect::Effect;
use crate::number::Real;

/// Number of factors: on `F_C`, on `F_S`, on `sigma0`.
pub const FACTOR_COUNT: usize = 3;

/// Factors on the parameters of a law. The neutral value is 1. The static factor is never below the Coulomb factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors<T> {
    /// Factor on `F_C`, for both directions.
    pub coulomb: T,
    /// Factor on `F_S`, for both directions.
    pub static_level: T,
    /// Factor on `sigma0`.
    pub stiffness: T,
}

impl<T: Real> Default for Factors<T> {
    fn default() -> Self {
        Self { coulomb: T::one(), static_level: T::one(), stiffness: T::one() }
    }
}

impl<T: Real> Factors<T> {
    /// Returns the factors in the order of the readout.
    pub fn to_array(self) -> [T; FACTOR_COUNT] {
        [self.coulomb, self.static_level, self.stiffness]
    }
}

impl<T: Real> Effect<T> for Factors<T> {
    #[inline(always)]
    fn coulomb(&self, base: T) -> T {
        base * self.coulomb
    }
    #[inline(always)]
    fn static_level(&self, base: T) -> T {
        base * self.static_level
    }
    #[inline(always)]
    fn stiffness_step(&self, base: T) -> T {
        base * self.stiffness
    }
}
