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
use crate::driver::received::CommandSequence;
use crate::hil::{HilReply, HilStep};
use crate::node::dictionary::records::InputsObject;
use crate::node_settings::InputSource;
use compensator_core::can::{
    AnswerFrame, CommandFrame, Frame, Message, MotionFrame, NodeId, SealFrame, StatusFrame,
    SurroundingsFrame, SyncFrame, TelemetryFrame, TorqueFrame, TraceEntry,
};
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Processes a process frame for this node.
    pub(in crate::driver) fn take(
        &mut self,
        message: &Message,
        frame: &Frame,
        node: NodeId,
        now_us: u64,
    ) {
        let inputs = &mut self.inputs;
        // A joint on its own sensors sends Motion and Torque itself and receives neither.
        let is_from_bus = self.settings.source == InputSource::Bus;
        let places = match message {
            Message::Motion(of, _) if *of == node && is_from_bus => {
                [&mut inputs.velocity_rad_s, &mut inputs.position_rad]
            }
            Message::Torque(of, _) if *of == node && is_from_bus => {
                [&mut inputs.torque_nm, &mut inputs.load_torque_nm]
            }
            Message::Seal(of, _) if *of == node => {
                [&mut inputs.radial_force_n, &mut inputs.pressure_diff_pa]
            }
            Message::Surroundings(of, _) if *of == node => {
                [&mut inputs.temperature_c, &mut inputs.auxiliary]
            }
            Message::Command(of, _) if *of == node && !self.profile.is_active() => {
                [&mut inputs.command_current_a, &mut inputs.command_velocity_and_counter]
            }
            _ => return self.counters.count_foreign(),
        };
        for (place, word) in places.into_iter().zip(frame.data().as_chunks::<4>().0) {
            *place = u32::from_le_bytes(*word);
        }
        self.process_input(message, now_us);
    }

    /// Processes an input that was written as an object, in the same way as its frame.
    pub(in crate::driver) fn input(&mut self, sub_index: u8, word: u32) {
        let Some(words) = self.inputs.set(sub_index, word) else { return };
        let node = self.settings.node;
        let [first, second] = words.map(f32::from_bits);
        let message = match sub_index {
            InputsObject::VELOCITY | InputsObject::POSITION => {
                Message::Motion(node, MotionFrame { velocity_rad_s: first, position_rad: second })
            }
            InputsObject::TORQUE | InputsObject::LOAD_TORQUE => {
                Message::Torque(node, TorqueFrame { torque_nm: first, load_torque_nm: second })
            }
            InputsObject::RADIAL_FORCE | InputsObject::PRESSURE_DIFF => {
                Message::Seal(node, SealFrame { radial_force_n: first, pressure_diff_pa: second })
            }
            InputsObject::TEMPERATURE | InputsObject::AUXILIARY => Message::Surroundings(
                node,
                SurroundingsFrame { temperature_c: first, auxiliary: second },
            ),
            _ => Message::Command(node, CommandFrame::from_words(words)),
        };
        self.process_input(&message, self.now_us);
    }

    pub(super) fn process_input(&mut self, message: &Message, now_us: u64) {
        self.hil.take(message);
        match self.received.take(message, now_us) {
            Some(CommandSequence::New { lost }) => {
                count(&mut self.counters.command_lost, u32::from(lost));
                self.supervisor.record_command(now_us);
            }
            Some(CommandSequence::Duplicate) => count(&mut self.counters.command_duplicate, 1),
            Some(CommandSequence::Late) => count(&mut self.counters.command_late, 1),
            None => {}
        }
    }

    /// Ends a sample. Returns its number; `None` for a repeated or late SYNC.
    pub(super) fn sync(&mut self, sync: SyncFrame) -> Option<u32> {
        let lost = match self.hil.sync(sync) {
            HilStep::Duplicate => {
                count(&mut self.counters.sync_duplicate, 1);
                return None;
            }
            HilStep::Late => {
                count(&mut self.counters.sync_late, 1);
                return None;
            }
            HilStep::Reply(reply, lost) => {
                if self.settings.source == InputSource::Bus {
                    self.reply = reply;
                }
                lost
            }
        };
        count(&mut self.counters.sync_lost, u32::from(lost));
        if self.settings.source == InputSource::Sensors {
            self.reply = self.measured_reply();
        }
        let reply = self.reply;
        if self.settings.source == InputSource::Bus
            && let Some(watch) = &mut self.watch
        {
            let residual_nm = reply.telemetry.residual_torque_nm;
            let velocity_rad_s = f32::from_bits(self.inputs.velocity_rad_s);
            watch.step(residual_nm, velocity_rad_s, residual_nm.is_finite());
        }
        Some(reply.status.sequence)
    }

    fn measured_reply(&self) -> HilReply {
        HilReply {
            answer: AnswerFrame {
                friction_torque_nm: self.report.friction_torque_nm,
                feed_forward_current_a: self.report.feed_forward_current_a,
            },
            status: StatusFrame {
                flags: self.report.flags | self.network.flags(),
                sequence: self.hil.inbox().sequence().wrapping_sub(1),
            },
            telemetry: TelemetryFrame {
                current_a: self.report.current_a,
                residual_torque_nm: self.report.residual_torque_nm,
            },
        }
    }

    /// Processes an entry of a trace about the samples that follow.
    pub(in crate::driver) fn trace(&mut self, entry: TraceEntry, message: &Message) {
        match entry {
            TraceEntry::Run(number) => self.run = number,
            TraceEntry::Sequence(_) => {}
            TraceEntry::JointKind(kind) => self.joint_kind = kind,
        }
        self.hil.take(message);
    }
}
