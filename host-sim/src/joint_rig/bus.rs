//! The rig's CAN bus as any tool on this PC sees one: a client's frames in, the driver's answers out, time virtual.
//!
//! While a client waits the joint lives on, a millisecond after the other, with nobody commanding it. What the driver
//! sends by itself (process data) stays with the rig's own master ([`super::Heard`]).

use super::JointRig;
use joint_bus::bus::{Bus, BusError, Counters, Received};
use joint_trace::CanFrame;
use std::collections::VecDeque;

/// A place on the bus of a rig.
pub struct RigBus<'r, 'q> {
    rig: &'r mut JointRig<'q>,
    heard: VecDeque<Received>,
    counters: Counters,
}

impl<'r, 'q> RigBus<'r, 'q> {
    /// A place on this rig's bus. Answers nobody has asked for yet are dropped.
    pub fn new(rig: &'r mut JointRig<'q>) -> Self {
        rig.answers.clear();
        Self { rig, heard: VecDeque::new(), counters: Counters::default() }
    }

    fn collect(&mut self) {
        let time_ns = self.now_ns();
        let answers = self.rig.take_answers();
        self.counters.received += answers.len() as u64;
        let received = answers.iter().map(|frame| Received { time_ns, frame: (*frame).into() });
        self.heard.extend(received);
    }
}

impl Bus for RigBus<'_, '_> {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        let what = "a frame that is no classic one of 11 bits";
        let frame = frame
            .to_joint()
            .ok_or_else(|| BusError::Unsupported { name: "of the rig".into(), what })?;
        self.rig.deliver(frame);
        self.counters.sent += 1;
        Ok(())
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        self.collect();
        while self.heard.is_empty() && self.now_ns() < until_ns {
            self.rig.pass();
            self.collect();
        }
        Ok(self.heard.pop_front())
    }

    fn now_ns(&self) -> u64 {
        1000 * self.rig.now_us
    }

    fn counters(&self) -> Counters {
        self.counters
    }
}
