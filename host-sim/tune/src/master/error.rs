//! Reasons why a motion ended early.

use joint_bus::bus::BusError;
use joint_bus::canopen::SdoError;

/// Reason why a motion ended early; one line.
#[derive(Debug, thiserror::Error)]
pub enum MasterError {
    /// An object was not read or written.
    #[error(transparent)]
    Object(#[from] SdoError),
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The joint does not report.
    #[error("node {0} has stopped reporting: cable, supply or reset")]
    Silent(u8),
    /// The drive left the enabled state.
    #[error("the drive stopped: {0}")]
    Stopped(String),
    /// The drive did not reach the enabled state.
    #[error("the drive does not arm: {0}")]
    NotEnabled(String),
    /// The trial's renewal was refused.
    #[error("the trial on the drive has ended: abort code {0:08X}")]
    TrialEnded(u32),
    /// The position error exceeded its guard.
    #[error(
        "the position error reached {0:.3} rad, at which the motion is ended: the joint does not follow"
    )]
    ErrorGuard(f64),
    /// The joint stands still, far from its demand or with its current at the limit.
    #[error("the joint stands {0:.3} rad from its demand and presses: use a range without a stop")]
    Stop(f64),
    /// The caller asked to stop.
    #[error("interrupted")]
    Interrupted,
}
