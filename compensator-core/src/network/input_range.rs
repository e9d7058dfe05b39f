//! The range of an input the network was trained on: what it may be asked.

use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};

/// A range of an input, in its unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputRange<T> {
    /// The middle of the range.
    pub middle: T,
    /// One over half its width.
    pub per_unit: T,
}

impl<T: Real> InputRange<T> {
    /// The range from `least` to `most`, in the input's unit; of a point, one of this half-width around it.
    pub fn new(least: f64, most: f64, at_least_half: f64) -> Self {
        let half = (0.5 * (most - least)).max(at_least_half);
        Self { middle: T::from_f64(0.5 * (least + most)), per_unit: T::from_f64(1.0 / half) }
    }

    /// The input, -1..=1 over the range and held at its ends, and whether it lies outside. What is not a
    /// number lies outside and counts as the middle.
    #[inline]
    pub fn scaled(&self, input: T) -> (T, bool) {
        let number = input.or_zero_if_nan();
        // Not a number differs from itself; fixed point has none.
        let missing = input.partial_cmp(&input).is_none();
        let scaled = if missing { T::zero() } else { (number - self.middle) * self.per_unit };
        let is_outside = missing || scaled.abs() > T::one();
        (scaled.within(T::one()), is_outside)
    }

    /// The same in another number.
    pub fn convert<R: Real>(&self) -> InputRange<R> {
        InputRange {
            middle: R::from_f64(self.middle.value()),
            per_unit: R::from_f64(self.per_unit.value()),
        }
    }

    pub(super) fn validate(&self) -> Result<(), ParameterError> {
        if !self.middle.value().is_finite() {
            refuse("network_input_middle", self.middle.value(), Bound::Finite, "a range has one")?;
        }
        let per_unit = self.per_unit.value();
        if !(per_unit > 0.0 && per_unit.is_finite()) {
            refuse(
                "network_input_per_unit",
                per_unit,
                Bound::MoreThan(0.0),
                "a range has a width",
            )?;
        }
        Ok(())
    }
}
