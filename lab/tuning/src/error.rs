//! Why a joint cannot be graded. Each message is one line.

use friction_fit::spec::SpecError;
use joint_bus::bus::BusError;
use joint_bus::canopen::SdoError;
use joint_rig::RigError;
use joint_tuning::TuneError;
use joint_tuning::session::SessionError;
use simulated_machines::scenarios::HideError;
use std::error::Error;

/// Why a joint cannot be graded.
#[derive(Debug, thiserror::Error)]
pub enum GradeError {
    /// The plant does not have the effect.
    #[error(transparent)]
    Joint(#[from] HideError),
    /// The driver rejects the set of its start.
    #[error(transparent)]
    Start(#[from] RigError),
    /// Another driver, such as an emulated board, does not start.
    #[error(transparent)]
    OtherDriver(Box<dyn Error + Send + Sync>),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The joint does not answer, or refuses an object.
    #[error(transparent)]
    Object(#[from] SdoError),
    /// A session is refused.
    #[error(transparent)]
    Refused(#[from] TuneError),
    /// The joint stops in a motion, or refuses a set.
    #[error(transparent)]
    Motion(#[from] SessionError),
    /// A law of the rival has too many terms.
    #[error(transparent)]
    Law(#[from] SpecError),
    /// The session that tunes a joint before its effect appears saved nothing.
    #[error("its first session saved nothing")]
    NothingSaved,
    /// A session that saved nothing has no recording of the joint as it was found.
    #[error("no recording")]
    NoRecording,
    /// A session without a learnt model has no rival.
    #[error("the session learnt nothing")]
    NothingLearnt,
    /// The driver refuses every set of the rival.
    #[error("no set of the rival is valid")]
    NoRival,
}
