//! The factors a network puts on a law's levels and stiffness, and how far they may go.

use super::activation::sigmoid;
use crate::effect::Effect;
use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};

/// How many there are: on `F_C`, on `F_S`, on `sigma0`.
pub const FACTORS: usize = 3;

/// Factors on a law's parameters, 1 for none. The static one is never below the Coulomb one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factors<T> {
    /// On `F_C` of either direction.
    pub coulomb: T,
    /// On `F_S` of either direction.
    pub static_level: T,
    /// On `sigma0`.
    pub stiffness: T,
}

impl<T: Real> Default for Factors<T> {
    fn default() -> Self {
        Self { coulomb: T::one(), static_level: T::one(), stiffness: T::one() }
    }
}

/// Between what a factor may lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactorBounds<T> {
    /// The least, more than 0 and at most 1.
    pub least: T,
    /// The most, at least 1.
    pub most: T,
}

impl<T: Real> FactorBounds<T> {
    /// The factor for a sum of the readout.
    #[inline]
    fn factor(&self, sum: T) -> T {
        self.least + (self.most - self.least) * sigmoid(sum)
    }

    /// The same in another number.
    pub fn convert<R: Real>(&self) -> FactorBounds<R> {
        FactorBounds {
            least: R::from_f64(self.least.value()),
            most: R::from_f64(self.most.value()),
        }
    }

    pub(super) fn validate(&self) -> Result<(), ParameterError> {
        let (least, most) = (self.least.value(), self.most.value());
        let why = "the constants, a factor of 1, are among them";
        if least.is_nan() || least <= 0.0 {
            refuse("network_factor_least", least, Bound::MoreThan(0.0), "bristles hold something")?;
        }
        if least > 1.0 {
            refuse("network_factor_least", least, Bound::AtMost(1.0), why)?;
        }
        if most.is_nan() || most < 1.0 {
            refuse("network_factor_most", most, Bound::AtLeast(1.0), why)?;
        }
        if most > LARGEST_FACTOR {
            let why = "more than that the law was not fitted for";
            refuse("network_factor_most", most, Bound::AtMost(LARGEST_FACTOR), why)?;
        }
        Ok(())
    }
}

/// The most any factor may be.
const LARGEST_FACTOR: f64 = 100.0;

impl<T: Real> Factors<T> {
    /// The factors of the readout's sums, within their bounds.
    #[inline]
    pub fn within(sums: [T; FACTORS], bounds: &[FactorBounds<T>; FACTORS]) -> Self {
        let [coulomb, static_level, stiffness] = bounds;
        let [of_coulomb, of_static, of_stiffness] = sums;
        let coulomb = coulomb.factor(of_coulomb);
        Self {
            coulomb,
            static_level: static_level.factor(of_static).at_least(coulomb),
            stiffness: stiffness.factor(of_stiffness),
        }
    }

    /// The same with a share, 0..=1, of what differs from 1.
    #[inline]
    #[must_use]
    pub fn faded(self, share: T) -> Self {
        let one = T::one();
        self.map(|factor| one + (factor - one) * share)
    }

    /// From here towards others, each by at most `slew`.
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

    /// In the order of the readout.
    pub fn to_array(self) -> [T; FACTORS] {
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
