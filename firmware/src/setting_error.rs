//! The error of a setting that is out of range.

use compensator_core::parameters::Text;
use compensator_core::parameters::reason::Reason;
use compensator_core::refusal;
use core::fmt;

/// A setting is out of range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettingError {
    /// Name of the setting.
    pub name: Text,
    /// Legal values.
    pub legal: Text,
}

impl fmt::Display for SettingError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: must be {}", self.name, self.legal)
    }
}

impl From<SettingError> for Reason {
    fn from(SettingError { name, legal }: SettingError) -> Self {
        refusal!("{name}: must be {name}", name, legal)
    }
}

impl core::error::Error for SettingError {}
