//! Factors of a network on the levels and the stiffness of a law, and their bounds.

use super::activation::sigmoid;
use crate::effect::Effect;
use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::text;

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

/// Bounds of a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorBounds<T> {
    /// Lower bound, more than 0 and at most 1.
    pub least: T,
    /// Upper bound, at least 1.
    pub most: T,
}

impl<T: Real> FactorBounds<T> {
    /// Returns the factor for an output sum of the readout.
    #[inline]
    fn factor(&self, sum: T) -> T {
        self.least + (self.most - self.least) * sigmoid(sum)
    }

    /// Converts the bounds to another number type.
    pub fn convert<R: Real>(&self) -> FactorBounds<R> {
        FactorBounds {
            least: R::from_f64(self.least.value()),
            most: R::from_f64(self.most.value()),
        }
    }

    pub(super) fn validate(&self) -> Result<(), ParameterError> {
        let (least, most) = (self.least.single(), self.most.single());
        let why = text!("the bounds must contain the factor 1");
        if least.is_nan() || least <= 0.0 {
            refuse(
                text!("network_factor_least"),
                least,
                Bound::MoreThan(0.0),
                text!("a factor is positive"),
            )?;
        }
        if least > 1.0 {
            refuse(text!("network_factor_least"), least, Bound::AtMost(1.0), why)?;
        }
        if most.is_nan() || most < 1.0 {
            refuse(text!("network_factor_most"), most, Bound::AtLeast(1.0), why)?;
        }
        if most > LARGEST_FACTOR {
            let why = text!("the law is not fitted beyond it");
            refuse(text!("network_factor_most"), most, Bound::AtMost(LARGEST_FACTOR), why)?;
        }
        Ok(())
    }
}

/// Maximum value of any factor.
const LARGEST_FACTOR: f32 = 100.0;

impl<T: Real> Factors<T> {
    /// Maps the output sums of the readout to factors within their bounds.
    #[inline]
    pub fn within(sums: [T; FACTOR_COUNT], bounds: &[FactorBounds<T>; FACTOR_COUNT]) -> Self {
        let [coulomb, static_level, stiffness] = bounds;
        let [of_coulomb, of_static, of_stiffness] = sums;
        let coulomb = coulomb.factor(of_coulomb);
        Self {
            coulomb,
            static_level: static_level.factor(of_static).at_least(coulomb),
            stiffness: stiffness.factor(of_stiffness),
        }
    }

    /// Scales the difference of each factor from 1 by `share`, 0..=1.
    #[inline]
    #[must_use]
    pub fn faded(self, share: T) -> Self {
        let one = T::one();
        self.map(|factor| one + (factor - one) * share)
    }

    /// Moves each factor towards `others` by at most `slew`.
    #[inline]
    #[must_use]
    pub fn towards(self, others: Self, slew: T) -> Self {
        let step = |from: T, to: T| from + (to - from).within(slew);
        Self {
            coulomb: step(self.coulomb, others.coulomb),
            static_level: step(self.static_level, others.static_level),
            stiffness: step(self.stiffness, others.stiffness),
        }
    }

    fn map(self, f: impl Fn(T) -> T) -> Self {
        Self {
            coulomb: f(self.coulomb),
            static_level: f(self.static_level),
            stiffness: f(self.stiffness),
        }
    }

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
