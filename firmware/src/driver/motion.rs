//! Motion of the joint above the current loop: what a master, a test or the driver wants becomes the loop's set-point, in
//! `chain`.
//!
//! ```text
//! device -> JointBase -> step of Motion -> Orders -> device
//! ```
//! [`Motion`] owns all that moves the joint. It sees the device as it is at the begin of a call, and changes only itself. What
//! it wants of the supervisor, the home or the reasons of refusals, the device executes after the call.

mod brake_test;
mod chain;
mod commissioning;
mod drive;
mod offsets;
mod position;
mod profile_modes;
mod stopping;
mod velocity;

use super::commissioning::AbortReason;
use super::profile::Profile;
use crate::joint_node::JointBase;
use crate::joint_node::refusals::ARMED;
use crate::node::sdo::Abort;
use crate::supervisor::Code;
use brake_test::BrakeTest;
use commissioning::Run;
use compensator_core::parameters::reason::Reason;
pub(super) use drive::Target;
use offsets::Offsets;
use position::PositionControl;
use profile_modes::ProfileModes;
use stopping::Stopping;
use velocity::VelocityControl;

/// A refusal: the abort code, and the reason for 2028h.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Refused {
    pub(crate) abort: Abort,
    pub(crate) why: Reason,
}

impl Refused {
    #[inline(never)]
    pub(super) fn new(abort: Abort, why: impl Into<Reason>) -> Self {
        Self { abort, why: why.into() }
    }

    /// The bridge is in use.
    pub(super) fn armed() -> Self {
        Self::new(Abort::State, ARMED)
    }
}

/// What motion wants of the other parts.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Orders {
    /// Disarm the joint.
    pub disarms: bool,
    /// A target came: the master is there.
    pub confirms: bool,
    /// A fault that motion has found.
    pub trips: Option<Code>,
    /// The present position, rad.
    pub home_rad: Option<f32>,
    /// A reason for 2028h.
    pub refusal: Option<Refused>,
}

/// Everything that moves the joint above the current loop.
// Small parts first, as in the device.
#[derive(Debug, Default)]
#[repr(C)]
pub(super) struct Motion {
    /// Time of the last target, us; `None` if none came since the mode or a setting changed.
    pub(super) target_us: Option<u64>,
    pub(super) offsets: Offsets,
    pub(super) velocity: VelocityControl,
    pub(super) modes: ProfileModes,
    pub(super) brake_test: BrakeTest,
    pub(super) profile: Profile,
    pub(super) stopping: Stopping,
    pub(super) position: PositionControl,
    pub(super) orders: Orders,
    pub(super) commissioning: Run,
}

impl Motion {
    /// Ends every motion, for an open bridge.
    pub(super) fn end(&mut self) {
        self.stopping.end();
        self.end_commissioning(AbortReason::Stopped);
    }

    /// Ends every motion and disarms the joint.
    #[inline(never)]
    pub(super) fn disarm(&mut self) {
        self.end();
        self.orders.disarms = true;
    }

    /// Starts the loops above the current loop.
    pub(super) fn begin_driving(&mut self, joint: &JointBase) {
        self.begin_velocity(joint, joint.set().motor.acceleration_max_rad_s2);
        self.preload_brake(joint);
        self.begin_position();
    }
}
