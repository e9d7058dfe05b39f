//! Bounds of the factors, and the way from the sums of the readout to factors within them.

use super::activation::sigmoid;
use super::{FACTOR_COUNT, Factors};
use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::text;

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
}
