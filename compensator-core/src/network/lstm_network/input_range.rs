//! The range of a network input during training. Outside this range the network must not be trusted.

use crate::number::Real;
use crate::refusal::{Bound, ParameterError, refuse};
use crate::text;

/// Range of an input, in the input's unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputRange<T> {
    /// Middle of the range.
    pub middle: T,
    /// Reciprocal of half the width.
    pub per_unit: T,
}

impl<T: Real> InputRange<T> {
    /// Builds the range from `least` to `most`, in the input's unit. Its half-width is `at_least_half` or more.
    pub fn new(least: f64, most: f64, at_least_half: f64) -> Self {
        let half = (0.5 * (most - least)).max(at_least_half);
        Self { middle: T::from_f64(0.5 * (least + most)), per_unit: T::from_f64(1.0 / half) }
    }

    /// Scales the input to -1..=1 over the range and clamps it. Returns true as second value if it is outside.
    ///
    /// NaN counts as outside and returns the middle, 0.
    #[inline]
    pub fn scaled(&self, input: T) -> (T, bool) {
        let number = input.or_zero_if_nan();
        // Only NaN does not compare with itself. Fixed point has no NaN.
        let missing = input.partial_cmp(&input).is_none();
        let scaled = if missing { T::zero() } else { (number - self.middle) * self.per_unit };
        let is_outside = missing || scaled.abs() > T::one();
        (scaled.within(T::one()), is_outside)
    }

    /// Converts the range to another number type.
    pub fn convert<R: Real>(&self) -> InputRange<R> {
        InputRange {
            middle: R::from_f64(self.middle.value()),
            per_unit: R::from_f64(self.per_unit.value()),
        }
    }

    pub(super) fn validate(&self) -> Result<(), ParameterError> {
        if !self.middle.single().is_finite() {
            refuse(
                text!("network_input_middle"),
                self.middle.single(),
                Bound::Finite,
                text!("the range needs it"),
            )?;
        }
        let per_unit = self.per_unit.single();
        if !(per_unit > 0.0 && per_unit.is_finite()) {
            refuse(
                text!("network_input_per_unit"),
                per_unit,
                Bound::MoreThan(0.0),
                text!("a range has a width"),
            )?;
        }
        Ok(())
    }
}
