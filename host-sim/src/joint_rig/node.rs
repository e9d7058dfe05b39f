//! A joint driver with a simulated motor on a bus of this process: what a tool is tried on before a bench is.
//!
//! The driver is the shipped one, on the sensors of its board; motor, gear, seal and encoder are the plant's. From a blank
//! flash it knows none of them; or it is commissioned, as a joint is that works. A millisecond of the bus is a millisecond of
//! the plant, and SYNCs are whoever's on the bus.

use super::{Faults, JointRig, Start, start_driver};
use firmware::loop_link::LoopQueues;
use firmware::parameter_set::ParameterSet;
use joint_bus::bus::Participant;
use joint_trace::CanFrame;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::collections::VecDeque;
use std::f64::consts::PI;

const MILLISECOND_NS: u64 = 1_000_000;

/// Milliseconds that are caught up with at once, where the bus's time was away: more are left out.
const CATCH_UP: u64 = 50;

/// A driver, its motor and its joint.
pub struct MotorNode {
    rig: JointRig<'static>,
    /// The bus's time it has lived to, ns.
    until_ns: u64,
}

impl MotorNode {
    /// A joint of the reference drive, its encoder mounted the other way round and at an angle, its motor cogging.
    ///
    /// # Errors
    /// The driver does not start; one line.
    pub fn start() -> Result<Self, String> {
        let constants = Parameters {
            encoder_direction: -1.0,
            encoder_zero_rad: 0.3 * PI,
            cogging_nm: 0.004,
            ..Parameters::default()
        };
        Self::on(&constants, &Start::default())
    }

    /// The same joint, its encoder mounted as the defaults of the parameters say, and commissioned with them.
    ///
    /// # Errors
    /// As [`MotorNode::start`].
    pub fn commissioned() -> Result<Self, String> {
        let set = ParameterSet::default();
        let start = Start { set: Some(&set), commissioned: true, ..Start::default() };
        Self::on(&Parameters::default(), &start)
    }

    fn on(constants: &Parameters, start: &Start) -> Result<Self, String> {
        let mut plant = JointPlant::new(constants, Load::Free, 1);
        plant.watch_overcurrent();
        // One in a process that ends with it.
        let queues = Box::leak(Box::new(LoopQueues::new()));
        let mut rig = start_driver(queues, start, plant, Faults::default())?;
        rig.outgoing = Some(VecDeque::new());
        rig.stop_sync();
        Ok(Self { rig, until_ns: 0 })
    }
}

impl Participant for MotorNode {
    fn receive(&mut self, frame: &CanFrame, _now_ns: u64) {
        if let Some(frame) = frame.to_joint() {
            self.rig.deliver(frame);
        }
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.until_ns = self.until_ns.max(now_ns.saturating_sub(CATCH_UP * MILLISECOND_NS));
        while self.until_ns <= now_ns {
            self.rig.pass();
            self.until_ns += MILLISECOND_NS;
        }
        Some(now_ns + MILLISECOND_NS)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.rig.outgoing.as_mut()?.pop_front().map(CanFrame::from)
    }
}
