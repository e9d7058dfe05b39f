//! Whether a number type has room for what a model computes with.
//!
//! [`crate::Fixed`] has a range. Building a model proves that no coefficient and no product of its step can
//! leave it within the envelope, which is why the step need not check. Floats hold everything.

use crate::number::Real;
use crate::refusal::{Bound, ParameterError, Text, refuse};
use crate::text;

/// Refuses a coefficient the number type would round too coarsely, or has no room for.
// Not inlined: a build checks many values, and is in every image.
#[inline(never)]
pub(crate) fn coefficient<T: Real>(field: Text, value: f32) -> Result<(), ParameterError> {
    if T::represents(value) {
        return Ok(());
    }
    let why = text!("the number type cannot hold this coefficient to 1e-3 of its value");
    refuse(field, value, Bound::Finite, why)
}

/// Refuses a product the number type has no room for, with two percent to spare for the rounding of
/// its factors. A small product may round to nothing.
#[inline(never)]
pub(crate) fn product<T: Real>(field: Text, value: f32) -> Result<(), ParameterError> {
    // A value that is not a number must not pass as the larger one.
    if value.is_finite() && T::represents((1.02 * value.abs()).max(1.0)) {
        return Ok(());
    }
    let why = text!("the number type cannot hold this product of the step within the envelope");
    refuse(field, value, Bound::Finite, why)
}
