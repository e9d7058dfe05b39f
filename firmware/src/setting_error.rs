//! The error of a setting that is out of range.

use compensator_core::parameters::reason::Reason;
use compensator_core::parameters::{Bound, ParameterError, Text, refuse};
use compensator_core::refusal;

/// A setting is out of range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettingError {
    /// Name of the setting.
    pub name: Text,
    /// Legal values.
    pub legal: Text,
}

impl From<SettingError> for Reason {
    fn from(SettingError { name, legal }: SettingError) -> Self {
        refusal!("{name}: must be {name}", name, legal)
    }
}

/// Checks that a value is one of two.
///
/// # Errors
/// Names the value and the nearer of the two.
#[inline(never)]
pub(crate) fn check_either(
    field: Text,
    value: f32,
    two: [f32; 2],
    why: Text,
) -> Result<(), ParameterError> {
    let [low, high] = two;
    if value == low || value == high {
        return Ok(());
    }
    let is_low = value < 0.5 * (low + high);
    refuse(field, value, if is_low { Bound::AtMost(low) } else { Bound::AtLeast(high) }, why)
}
