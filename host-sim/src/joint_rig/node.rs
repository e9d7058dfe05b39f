//! A joint driver with a simulated motor on a bus of this process: what a tool is tried on before a bench is.
//!
//! The driver is the shipped one, on the sensors of its board, from a blank flash; motor, gear, seal and encoder are the
//! plant's, and the driver knows none of them. A millisecond of the bus is a millisecond of the plant.

use super::{Faults, JointRig, Start, start_driver};
use firmware::loop_link::LoopQueues;
use joint_bus::bus::Participant;
use joint_trace::CanFrame;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::collections::VecDeque;
use std::f64::consts::PI;

const MILLISECOND_NS: u64 = 1_000_000;

/// A driver, its motor and its joint.
pub struct MotorNode(JointRig<'static>);

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
        let plant = JointPlant::new(&constants, Load::Free, 1);
        // One in a process that ends with it.
        let queues = Box::leak(Box::new(LoopQueues::new()));
        let mut rig = start_driver(queues, &Start::default(), plant, Faults::default())?;
        rig.outgoing = Some(VecDeque::new());
        Ok(Self(rig))
    }
}

impl Participant for MotorNode {
    fn receive(&mut self, frame: &CanFrame, _now_ns: u64) {
        if let Some(frame) = frame.to_joint() {
            self.0.deliver(frame);
        }
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.0.pass();
        Some(now_ns + MILLISECOND_NS)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.0.outgoing.as_mut()?.pop_front().map(CanFrame::from)
    }
}
