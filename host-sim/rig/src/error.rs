//! Reasons why a rig does not run.

use compensator_core::ParameterError;
use firmware::store::StoreError;
use joint_bus::canopen::SdoError;

/// Error of a rig; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages describe the variants")]
pub enum RigError {
    #[error(transparent)]
    Set(#[from] ParameterError),
    #[error("flash: {0:?}")]
    Flash(StoreError),
    #[error("the driver does not arm: {0}")]
    NotArmed(String),
    #[error(transparent)]
    Object(#[from] SdoError),
    #[error(transparent)]
    Restart(Box<dyn std::error::Error + Send + Sync>),
}
