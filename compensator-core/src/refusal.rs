//! Errors for invalid parameters.
//!
//! An error names the field, its value, the violated bound and the reason for the bound. All are numbers, so that
//! an error takes few bytes of an image, which does not contain the texts: see [`Text`].

pub mod reason;
mod short_number;
mod text;

pub use short_number::ShortNumber;
pub use text::Text;

use core::fmt;

/// The bound that a refused value violates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// The value must be at least this.
    AtLeast(f32),
    /// The value must be at most this.
    AtMost(f32),
    /// The value must be more than this.
    MoreThan(f32),
    /// The value must be finite.
    Finite,
    /// The value must be an integer.
    Whole,
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Bound::AtLeast(bound) => write!(f, "at least {}", ShortNumber(bound.into())),
            Bound::AtMost(bound) => write!(f, "at most {}", ShortNumber(bound.into())),
            Bound::MoreThan(bound) => write!(f, "more than {}", ShortNumber(bound.into())),
            Bound::Finite => f.write_str("a finite number"),
            Bound::Whole => f.write_str("a whole number"),
        }
    }
}

/// Error for an invalid parameter: its name, its value, the violated bound and the reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterError {
    /// Name of the parameter or envelope field.
    pub field: Text,
    /// Value, in the parameter's unit, rounded to single precision.
    pub value: f32,
    /// The violated bound.
    pub bound: Bound,
    /// Reason for the bound.
    pub why: Text,
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (value, Self { field, bound, why, .. }) = (ShortNumber(self.value.into()), self);
        write!(f, "{field} = {value}: must be {bound}: {why}")
    }
}

impl core::error::Error for ParameterError {}

/// Range of a named field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldRange {
    /// Smallest legal value.
    pub least: f32,
    /// Largest legal value.
    pub most: f32,
    /// Reason for both.
    pub why: Text,
}

/// Checks values against ranges, in the order of the names.
///
/// # Errors
/// Names the first value that is not finite or not in its range.
// Not inlined: an image has one copy.
#[inline(never)]
pub fn check_ranges(
    names: &[Text],
    values: &[f32],
    ranges: &[FieldRange],
) -> Result<(), ParameterError> {
    for ((field, value), FieldRange { least, most, why }) in names.iter().zip(values).zip(ranges) {
        let bound = if !value.is_finite() {
            Bound::Finite
        } else if value < least {
            Bound::AtLeast(*least)
        } else if value > most {
            Bound::AtMost(*most)
        } else {
            continue;
        };
        return refuse(*field, *value, bound, *why);
    }
    Ok(())
}

/// Returns the error for an invalid parameter.
///
/// # Errors
/// Always returns an error.
pub fn refuse(field: Text, value: f32, bound: Bound, why: Text) -> Result<(), ParameterError> {
    Err(ParameterError { field, value, bound, why })
}
