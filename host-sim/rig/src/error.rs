//! Reasons why a rig does not run.

use compensator_core::ParameterError;
use firmware::store::StoreError;
use joint_bus::canopen::SdoError;

/// Error of a rig; its message is one line.
#[derive(Debug, thiserror::Error)]
pub enum RigError {
    /// The driver refuses the set of its flash.
    #[error(transparent)]
    Set(#[from] ParameterError),
    /// The set cannot be stored.
    #[error("flash: {0:?}")]
    Flash(StoreError),
    /// The driver does not arm, with its reason.
    #[error("the driver does not arm: {0}")]
    NotArmed(String),
    /// An object was not read or written.
    #[error(transparent)]
    Object(#[from] SdoError),
    /// A driver outside of this process does not start again.
    #[error(transparent)]
    Restart(Box<dyn std::error::Error + Send + Sync>),
}
