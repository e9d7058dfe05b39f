//! Why a joint cannot be graded.

use compensator_core::ParameterError;
use friction_fit::spec::SpecError;
use simulated_machines::scenarios::HideError;

/// Why a joint cannot be graded.
#[derive(Debug, thiserror::Error)]
pub enum GradeError {
    /// The joint cannot be drawn.
    #[error(transparent)]
    Joint(#[from] HideError),
    /// The set cannot be identified.
    #[error(transparent)]
    Fit(#[from] SpecError),
    /// The driver would refuse the set.
    #[error(transparent)]
    Set(#[from] ParameterError),
}
