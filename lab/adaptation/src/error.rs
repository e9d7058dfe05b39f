//! Why a joint cannot be graded.

use compensator_core::ParameterError;
use friction_fit::spec::SpecError;

/// Why a joint cannot be graded.
#[derive(Debug, thiserror::Error)]
pub enum GradeError {
    /// No joint has the seed.
    #[error("no joint")]
    NoJoint,
    /// The set cannot be identified.
    #[error(transparent)]
    Fit(#[from] SpecError),
    /// The driver would refuse the set.
    #[error("{0:?}")]
    Set(ParameterError),
}
