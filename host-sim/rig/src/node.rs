//! A joint driver with a simulated motor on an in-process bus, for trying a tool before a bench exists.
//!
//! The driver is the shipped one, with the simulated sensors of its board. Motor, gear, seal and encoder belong to the
//! plant. The driver starts from a blank flash, or commissioned. One millisecond on the bus is one millisecond of the
//! plant, and another participant of the bus sends the SYNC frames.

use super::{JointRig, PowerUp, RigFaults, start_driver};
use firmware::loop_link::LoopQueues;
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::Participant;
use joint_trace::CanFrame;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::collections::VecDeque;
use std::f64::consts::PI;

const MILLISECOND_NS: u64 = 1_000_000;

/// Maximum time simulated at once after a gap in the bus time, ms; the rest of the gap is skipped.
const MAX_CATCH_UP_MS: u64 = 50;

/// A driver with its motor and joint.
pub struct MotorNode {
    rig: JointRig<'static>,
    /// Bus time up to which the rig has run, ns.
    simulated_until_ns: u64,
}

impl MotorNode {
    /// Starts an uncommissioned joint of the reference drive. Its encoder is reversed and offset, and its motor cogs.
    ///
    /// # Errors
    /// Returns one line if the driver does not start.
    pub fn start() -> Result<Self, String> {
        let constants = Parameters {
            encoder_direction: -1.0,
            encoder_zero_rad: 0.3 * PI,
            cogging_nm: 0.004,
            ..Parameters::default()
        };
        Self::with_plant(&constants, &PowerUp::default())
    }

    /// Starts the same joint commissioned, its encoder mounted as the default parameters state.
    ///
    /// # Errors
    /// As [`MotorNode::start`].
    pub fn commissioned() -> Result<Self, String> {
        let set = ParameterSet::default();
        let start = PowerUp { set: Some(&set), commissioned: true, ..PowerUp::default() };
        Self::with_plant(&Parameters::default(), &start)
    }

    fn with_plant(constants: &Parameters, start: &PowerUp) -> Result<Self, String> {
        let mut plant = JointPlant::new(constants, Load::Free, 1);
        plant.watch_overcurrent();
        // A process has one such node until it ends, so that the leak is bounded.
        let queues = Box::leak(Box::new(LoopQueues::new()));
        let mut rig = start_driver(queues, start, plant, RigFaults::default())?;
        rig.received.outgoing_frames = Some(VecDeque::new());
        rig.stop_sync();
        Ok(Self { rig, simulated_until_ns: 0 })
    }
}

impl Participant for MotorNode {
    fn receive(&mut self, frame: &CanFrame, _now_ns: u64) {
        if let Some(frame) = frame.to_joint() {
            self.rig.deliver(frame);
        }
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.simulated_until_ns =
            self.simulated_until_ns.max(now_ns.saturating_sub(MAX_CATCH_UP_MS * MILLISECOND_NS));
        while self.simulated_until_ns <= now_ns {
            self.rig.step_idle();
            self.simulated_until_ns += MILLISECOND_NS;
        }
        Some(now_ns + MILLISECOND_NS)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.rig.received.outgoing_frames.as_mut()?.pop_front()
    }
}
