//! Why numbers that a person wrote were refused, in words that person understands.
//!
//! A refusal names the field, its value, the bound that the value broke, and why there is one.

use core::fmt;

/// The bound a refused value broke.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bound {
    /// It must be at least this.
    AtLeast(f64),
    /// It must be at most this.
    AtMost(f64),
    /// It must be more than this.
    MoreThan(f64),
    /// It must be a finite number.
    Finite,
    /// It must be a whole number.
    Whole,
}

impl fmt::Display for Bound {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Bound::AtLeast(bound) => write!(f, "at least {bound}"),
            Bound::AtMost(bound) => write!(f, "at most {bound}"),
            Bound::MoreThan(bound) => write!(f, "more than {bound}"),
            Bound::Finite => f.write_str("a finite number"),
            Bound::Whole => f.write_str("a whole number"),
        }
    }
}

/// Why parameters were refused: which, its value, its bound and the reason.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterError {
    /// Name of the parameter or envelope field.
    pub field: &'static str,
    /// Its value, in its own unit.
    pub value: f64,
    /// What it should have been.
    pub bound: Bound,
    /// Why.
    pub why: &'static str,
}

impl fmt::Display for ParameterError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Seven digits: records hold f32, and 1.8 should not read 1.7999999523162842.
        write!(f, "{} = {}: must be {}: {}", self.field, self.value as f32, self.bound, self.why)
    }
}

impl core::error::Error for ParameterError {}

/// Checks numbers against ranges: smallest and largest legal value, and why, each in the order of the names.
///
/// # Errors
/// Names the first that is not a number or out of its range.
pub fn check_ranges(
    names: &[&'static str],
    values: &[f32],
    ranges: &[(f32, f32, &'static str)],
) -> Result<(), ParameterError> {
    for ((field, value), (least, most, why)) in names.iter().zip(values).zip(ranges) {
        let bound = if !value.is_finite() {
            Bound::Finite
        } else if value < least {
            Bound::AtLeast((*least).into())
        } else if value > most {
            Bound::AtMost((*most).into())
        } else {
            continue;
        };
        return refuse(field, (*value).into(), bound, why);
    }
    Ok(())
}

/// A refusal, as a result.
///
/// # Errors
/// Always.
pub(crate) fn refuse(
    field: &'static str,
    value: f64,
    bound: Bound,
    why: &'static str,
) -> Result<(), ParameterError> {
    Err(ParameterError { field, value, bound, why })
}
