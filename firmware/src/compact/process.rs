//! Process frames: the inputs of a sample, and what is sent at a SYNC. They are those of `joint.dbc`.

use super::device::{Device, SYNC_FRAMES};
use crate::driver::counters::count;
use crate::driver::received::CommandSequence;
use crate::node::dictionary::records::InputsObject;
use compensator_core::can::{
    AnswerFrame, CommandFrame, Frame, Message, MotionFrame, NodeId, SealFrame, StatusFrame,
    SurroundingsFrame, SyncFrame, SyncOutcome, TelemetryFrame, TorqueFrame, cob_id,
};
use embedded_storage::nor_flash::NorFlash;

/// Motion is sent at every SYNC, and the other frames by default at every n-th, as by the whole driver.
const SLOW_TYPE: u8 = 10;

/// Places of the frames of a sample: those of their transmit PDOs (1800h to 1804h).
const TELEMETRY: usize = 2;
const MOTION: usize = 3;
/// Order at a SYNC: what was measured, then what was computed.
const SYNC_ORDER: [usize; SYNC_FRAMES] = [3, 4, 0, 1, 2];

impl<F: NorFlash> Device<F> {
    /// Processes a frame that is neither of the network nor a request of an object.
    pub(super) fn take_process_frame(&mut self, frame: &Frame, node: NodeId, is_operational: bool) {
        let is_plain_sync = frame.identifier() == cob_id::SYNC && frame.data().is_empty();
        match Message::parse(frame) {
            _ if is_plain_sync && is_operational => {
                let counter = self.sync_counter % SyncFrame::LAST + 1;
                self.sync(SyncFrame { counter }, node);
            }
            Ok(_) if !is_operational => self.counters.count_passed_over(),
            _ if is_plain_sync => self.counters.count_passed_over(),
            Ok(Message::Sync(sync)) => self.sync(sync, node),
            Ok(message) => self.take_input(&message, frame, node),
            Err(error) => self.counters.count_error(&error),
        }
    }

    fn take_input(&mut self, message: &Message, frame: &Frame, node: NodeId) {
        let place = match message {
            Message::Seal(of, _) if *of == node => InputsObject::RADIAL_FORCE,
            Message::Surroundings(of, _) if *of == node => InputsObject::TEMPERATURE,
            Message::Command(of, _) if *of == node => InputsObject::COMMAND_CURRENT,
            _ => return self.counters.count_foreign(),
        };
        for (sub_index, word) in (place..).zip(frame.data().as_chunks::<4>().0) {
            let _ = self.inputs.set(sub_index, u32::from_le_bytes(*word));
        }
        self.process_input(message);
    }

    /// Processes an input that was written as an object, in the same way as its frame. Velocity, position and torque of this
    /// joint are measured; its load torque is not.
    pub(super) fn input(&mut self, sub_index: u8, word: u32) {
        let Some(words) = self.inputs.set(sub_index, word) else { return };
        let node = self.node();
        let [first, second] = words.map(f32::from_bits);
        let message = match sub_index {
            InputsObject::VELOCITY | InputsObject::POSITION => return,
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
        self.process_input(&message);
    }

    fn process_input(&mut self, message: &Message) {
        match self.received.take(message, self.now_us) {
            Some(CommandSequence::New { lost }) => {
                count(&mut self.counters.command_lost, u32::from(lost));
                self.supervisor.record_command(self.now_us);
            }
            Some(CommandSequence::Duplicate) => count(&mut self.counters.command_duplicate, 1),
            Some(CommandSequence::Late) => count(&mut self.counters.command_late, 1),
            None => {}
        }
    }

    /// Ends a sample and sends its frames.
    fn sync(&mut self, sync: SyncFrame, node: NodeId) {
        self.sync_counter = sync.counter;
        match self.samples.sync(sync) {
            SyncOutcome::Duplicate => return count(&mut self.counters.sync_duplicate, 1),
            SyncOutcome::Late => return count(&mut self.counters.sync_late, 1),
            SyncOutcome::Sample { lost } => count(&mut self.counters.sync_lost, u32::from(lost)),
        }
        let sequence = self.samples.sequence();
        self.samples.end_sample();
        for slot in SYNC_ORDER {
            if self.is_due(slot) {
                let message = self.sample_frame(slot, sequence, node);
                self.outbox.push(message.emit());
            }
        }
    }

    /// Returns the transmission type of a frame: it is sent at every n-th SYNC.
    pub(super) fn sync_type(&self, slot: usize) -> u8 {
        match self.sync_types.get(slot) {
            Some(0) | None if slot == MOTION => 1,
            Some(0) | None if slot == TELEMETRY && self.settings.telemetry_every > 1 => {
                self.settings.telemetry_every
            }
            Some(0) | None => SLOW_TYPE,
            Some(given) => *given,
        }
    }

    fn is_due(&mut self, slot: usize) -> bool {
        let every = self.sync_type(slot);
        let is_disabled = slot == TELEMETRY && self.settings.telemetry_every == 0;
        let Some(syncs) = self.syncs.get_mut(slot) else { return false };
        *syncs = syncs.saturating_add(1);
        let is_due = *syncs >= every;
        if is_due {
            *syncs = 0;
        }
        is_due && !is_disabled
    }

    fn sample_frame(&self, slot: usize, sequence: u32, node: NodeId) -> Message {
        let report = self.current_loop.report();
        match slot {
            0 => Message::Answer(
                node,
                AnswerFrame {
                    friction_torque_nm: report.friction_torque_nm,
                    feed_forward_current_a: report.feed_forward_current_a,
                },
            ),
            1 => Message::Status(node, StatusFrame { flags: report.flags, sequence }),
            TELEMETRY => Message::Telemetry(
                node,
                TelemetryFrame {
                    current_a: report.current_a,
                    residual_torque_nm: report.residual_torque_nm,
                },
            ),
            MOTION => Message::Motion(
                node,
                MotionFrame {
                    velocity_rad_s: report.velocity_rad_s,
                    position_rad: report.position_rad,
                },
            ),
            _ => Message::Torque(
                node,
                TorqueFrame {
                    torque_nm: report.motor_torque_nm,
                    load_torque_nm: f32::from_bits(self.inputs.load_torque_nm),
                },
            ),
        }
    }
}
