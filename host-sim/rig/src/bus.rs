//! The rig's CAN bus for clients on this PC, in virtual time.
//!
//! A client's frames go to the driver, and the driver's object answers go to the client. While the client waits for an
//! answer, the rig runs on in steps of 1 ms without commands. Process data that the driver sends go to the rig's own
//! master ([`super::MasterView`]).

use super::JointRig;
use joint_bus::bus::{Bus, BusError, Counters, Received};
use joint_trace::CanFrame;
use std::collections::VecDeque;

/// A port on the bus of a rig.
pub struct RigBus<'r> {
    rig: &'r mut JointRig,
    received: VecDeque<Received>,
    counters: Counters,
}

impl<'r> RigBus<'r> {
    /// Opens a port on this rig's bus and drops answers that no client has read.
    pub fn new(rig: &'r mut JointRig) -> Self {
        rig.received.answers.clear();
        Self { rig, received: VecDeque::new(), counters: Counters::default() }
    }

    fn collect(&mut self) {
        let time_ns = self.now_ns();
        let answers = self.rig.take_answers();
        self.counters.received += answers.len() as u64;
        let frames = answers.iter().map(|frame| Received { time_ns, frame: (*frame).into() });
        self.received.extend(frames);
    }
}

impl Bus for RigBus<'_> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        let what = "a frame that is not a classic CAN frame with an 11-bit identifier";
        let frame =
            frame.to_joint().ok_or_else(|| BusError::Unsupported { name: "rig".into(), what })?;
        self.rig.driver.receive(&frame);
        self.counters.sent += 1;
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        self.collect();
        while self.received.is_empty() && self.now_ns() < until_ns {
            self.rig.step_idle();
            self.collect();
        }
        Ok(self.received.pop_front())
    }

    fn now_ns(&self) -> u64 {
        1000 * self.rig.now_us
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}
