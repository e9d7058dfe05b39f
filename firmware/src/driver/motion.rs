//! Motion of the joint above the current loop: what a master, a test or the driver wants becomes the loop's set-point, in
//! `chain`.
//!
//! ```text
//! device -> Seen -> step of Motion -> Orders -> device
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
use super::loop_data::LoopReport;
use super::profile::Profile;
use super::received::ReceivedInputs;
use crate::node::dictionary::records::{InputsObject, MeasuredObject};
use crate::node::sdo::Abort;
use crate::node_settings::{InputSource, NodeSettings};
use crate::parameter_set::ParameterSet;
use crate::supervisor::{Code, Supervisor};
use brake_test::BrakeTest;
use commissioning::Run;
use compensator_core::parameters::reason::Reason;
use compensator_core::text;
pub(super) use drive::Target;
use drive::Targets;
use offsets::Offsets;
use position::PositionControl;
use profile_modes::ProfileModes;
use stopping::Stopping;
use velocity::VelocityControl;

/// A refusal: the abort code, and the reason that 2028h tells.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refused(pub(super) Abort, pub(super) Reason);

impl Refused {
    #[inline(never)]
    pub(super) fn new(abort: Abort, why: impl Into<Reason>) -> Self {
        Self(abort, why.into())
    }

    /// The bridge is in use.
    pub(super) fn armed() -> Self {
        let why = text!("the joint is armed, and nothing is written then: disarm first");
        Self::new(Abort::State, why)
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
    pub(super) targets: Targets,
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
    pub(super) fn begin_driving(&mut self, seen: &Seen<'_>) {
        self.begin_velocity(seen, seen.set.motor.acceleration_max_rad_s2);
        self.preload_brake(seen);
        self.begin_position();
    }
}

/// What motion sees of the device.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub(super) now_us: u64,
    pub(super) settings: &'a NodeSettings,
    pub(super) set: &'a ParameterSet,
    pub(super) report: &'a LoopReport,
    pub(super) supervisor: &'a Supervisor,
    pub(super) received: &'a ReceivedInputs,
    pub(super) is_hil_armed: bool,
    pub(super) inputs: &'a InputsObject,
}

impl Seen<'_> {
    /// Returns true if the joint is armed, on its own sensors or in HIL.
    pub(super) fn is_armed(&self) -> bool {
        self.supervisor.is_armed() || self.is_hil_armed
    }

    /// Returns true if the bridge is in use: parameters must not change.
    pub(super) fn is_bridge_in_use(&self) -> bool {
        self.is_armed() || self.supervisor.is_stopping()
    }

    /// Returns what the joint measures, or receives in HIL.
    #[inline(never)]
    pub(super) fn measured(&self) -> MeasuredObject {
        let received = self.inputs;
        match self.settings.source {
            InputSource::Bus => MeasuredObject {
                velocity_rad_s: received.velocity_rad_s,
                position_rad: received.position_rad,
                torque_nm: received.torque_nm,
                load_torque_nm: received.load_torque_nm,
            },
            InputSource::Sensors => MeasuredObject {
                velocity_rad_s: self.report.velocity_rad_s.to_bits(),
                position_rad: self.report.position_rad.to_bits(),
                torque_nm: self.report.motor_torque_nm.to_bits(),
                load_torque_nm: received.load_torque_nm,
            },
        }
    }
}
