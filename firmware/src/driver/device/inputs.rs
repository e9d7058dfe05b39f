//! Process frames in, and the reply to a SYNC.
//!
//! ```text
//! Command, Seal, Surroundings ------------------> received inputs -> commands of the loop
//! Motion, Torque (source *bus*: a HIL joint) ---> HIL: model -------> reply, at SYNC
//! report of the loop (source *sensors*) ---------------------------> reply, at SYNC
//! ```
//! An input that is written as an object has the effect of its frame. A frame for another node is counted as foreign, and
//! so is a Command while a CiA 402 mode is active. Repeated and late frames are counted and change nothing.

use super::Device;
use crate::driver::counters::count;
use crate::hil::{HilJoint, HilReply, HilStep};
use crate::node::dictionary::records::TraceObject;
use crate::node_settings::{InputSource, NodeSettings};
use compensator_core::can::{
    AnswerFrame, Frame, JointKind, Message, NodeId, StatusFrame, SyncFrame, TelemetryFrame,
    TraceEntry,
};
use embedded_storage::nor_flash::NorFlash;

/// The frames of a sample: what was received, the joint in HIL, and the last reply.
#[derive(Debug)]
pub(crate) struct Samples {
    pub(super) hil: HilJoint,
    reply: HilReply,
    /// Run and kind of the joint in a trace.
    run: u32,
    joint_kind: JointKind,
}

impl Samples {
    pub(super) fn new(defaults: &NodeSettings) -> Self {
        Self {
            hil: HilJoint::without_model(defaults.node, defaults.hil_setup()),
            reply: HilReply::NONE,
            run: 0,
            joint_kind: JointKind::default(),
        }
    }

    /// Replaces the joint in HIL; it is not armed.
    #[inline(never)]
    pub(super) fn set_hil(&mut self, hil: HilJoint) {
        self.hil = hil;
    }

    /// Returns the last outputs: the words of 2005h.
    pub(crate) fn outputs(&self) -> [u32; 6] {
        self.reply.words()
    }

    /// Returns the place in a trace (2000h).
    pub(crate) fn trace_object(&self) -> TraceObject {
        let sequence = self.hil.inbox().sequence();
        TraceObject { run: self.run, sequence, joint_kind: self.joint_kind as u32 }
    }
}

impl<F: NorFlash> Device<F> {
    /// Processes a process frame for this node.
    pub(crate) fn take(&mut self, message: &Message, frame: &Frame, node: NodeId, now_us: u64) {
        let is_taken = match message {
            // A joint on its own sensors sends Motion and Torque itself and receives neither.
            Message::Motion(..) | Message::Torque(..) => self.base.settings.is_in_hil(),
            Message::Command(..) => !self.motion.profile.is_active(),
            _ => true,
        };
        if !is_taken {
            return self.base.counters.count_foreign();
        }
        self.base.now_us = now_us;
        if self.base.take_input(message, frame, node) {
            self.samples.hil.take(message);
        }
    }

    /// Processes an input that was written as an object, in the same way as its frame.
    pub(crate) fn input(&mut self, sub_index: u8, word: u32) {
        if let Some(message) = self.base.input_message(sub_index, word) {
            self.base.process_input(&message);
            self.samples.hil.take(&message);
        }
    }

    /// Arms or disarms the joint in HIL.
    #[inline(never)]
    pub(super) fn arm_hil(&mut self, is_armed: bool) {
        self.samples.hil.set_enabled(is_armed);
        self.base.is_hil_armed = is_armed;
    }

    /// Ends a sample. Returns its number; `None` for a repeated or late SYNC.
    pub(super) fn sync(&mut self, sync: SyncFrame) -> Option<u32> {
        let step = match self.base.settings.source {
            InputSource::Bus => {
                let blocked = self.learning_blocked_by();
                self.samples.hil.sync_learning(sync, &mut self.adaptation, blocked)
            }
            InputSource::Sensors => self.samples.hil.sync(sync),
        };
        match step {
            HilStep::Duplicate => {
                count(&mut self.base.counters.sync_duplicate, 1);
                return None;
            }
            HilStep::Late => {
                count(&mut self.base.counters.sync_late, 1);
                return None;
            }
            HilStep::Reply(reply, lost) => {
                count(&mut self.base.counters.sync_lost, lost);
                self.samples.reply = match self.base.settings.source {
                    InputSource::Bus => reply,
                    InputSource::Sensors => self.measured_reply(),
                };
            }
        }
        let reply = self.samples.reply;
        if self.base.settings.is_in_hil()
            && let Some(watch) = &mut self.base.watch
        {
            let residual_nm = reply.telemetry.residual_torque_nm;
            let velocity_rad_s = f32::from_bits(self.base.inputs.velocity_rad_s);
            watch.step(residual_nm, velocity_rad_s, residual_nm.is_finite());
        }
        Some(reply.status.sequence)
    }

    fn measured_reply(&self) -> HilReply {
        let report = self.base.report();
        HilReply {
            answer: AnswerFrame {
                friction_torque_nm: report.friction_torque_nm,
                feed_forward_current_a: report.feed_forward_current_a,
            },
            status: StatusFrame {
                flags: report.flags | self.network.flags(),
                sequence: self.samples.hil.inbox().sequence().wrapping_sub(1),
            },
            telemetry: TelemetryFrame {
                current_a: report.current_a,
                residual_torque_nm: report.residual_torque_nm,
            },
        }
    }

    /// Processes an entry of a trace about the samples that follow.
    pub(crate) fn trace(&mut self, entry: TraceEntry, message: &Message) {
        match entry {
            TraceEntry::Run(number) => self.samples.run = number,
            TraceEntry::Sequence(_) => {}
            TraceEntry::JointKind(kind) => self.samples.joint_kind = kind,
        }
        if self.samples.hil.take(message) && self.base.settings.is_in_hil() {
            self.restart_adaptation();
        }
    }
}
