//! Process frames: the inputs of a sample, and what is sent at a SYNC. They are those of `joint.dbc`.

use super::device::Device;
use crate::driver::counters::count;
use crate::joint_node::sample_frames::{ANSWER, MOTION, SLOW_TYPE, STATUS, SYNC_ORDER, TELEMETRY};
use compensator_core::can::{
    AnswerFrame, Frame, Message, MotionFrame, NodeId, StatusFrame, SyncFrame, SyncOutcome,
    TelemetryFrame, TorqueFrame, cob_id,
};
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Processes a frame that is neither of the network nor a request of an object.
    pub(super) fn take_process_frame(&mut self, frame: &Frame, node: NodeId, is_operational: bool) {
        let is_plain_sync = frame.identifier() == cob_id::SYNC && frame.data().is_empty();
        match Message::parse(frame) {
            _ if is_plain_sync && is_operational => {
                let counter = self.sync_counter % SyncFrame::LAST + 1;
                self.sync(SyncFrame { counter }, node);
            }
            Ok(_) if !is_operational => self.base.counters.count_passed_over(),
            _ if is_plain_sync => self.base.counters.count_passed_over(),
            Ok(Message::Sync(sync)) => self.sync(sync, node),
            // Velocity, position and torque of this joint are measured.
            Ok(Message::Motion(..) | Message::Torque(..)) => self.base.counters.count_foreign(),
            Ok(message) => {
                self.base.take_input(&message, frame, node);
            }
            Err(error) => self.base.counters.count_error(&error),
        }
    }

    /// Ends a sample and sends its frames.
    fn sync(&mut self, sync: SyncFrame, node: NodeId) {
        self.sync_counter = sync.counter;
        match self.samples.sync(sync) {
            SyncOutcome::Duplicate => return count(&mut self.base.counters.sync_duplicate, 1),
            SyncOutcome::Late => return count(&mut self.base.counters.sync_late, 1),
            SyncOutcome::Sample { lost } => count(&mut self.base.counters.sync_lost, lost),
        }
        let sequence = self.samples.sequence();
        self.samples.end_sample();
        for slot in SYNC_ORDER {
            if self.is_due(slot) {
                let message = self.sample_frame(slot, sequence, node);
                self.base.outbox.push(message.emit());
            }
        }
    }

    /// Returns the transmission type of a frame: it is sent at every n-th SYNC.
    pub(super) fn sync_type(&self, slot: usize) -> u8 {
        match self.sync_types.get(slot) {
            Some(0) | None if slot == MOTION => 1,
            Some(0) | None if slot == TELEMETRY && self.base.settings.telemetry_every > 1 => {
                self.base.settings.telemetry_every
            }
            Some(0) | None => SLOW_TYPE,
            Some(given) => *given,
        }
    }

    fn is_due(&mut self, slot: usize) -> bool {
        let every = self.sync_type(slot);
        let is_disabled = slot == TELEMETRY && self.base.settings.telemetry_every == 0;
        let Some(syncs) = self.syncs.get_mut(slot) else { return false };
        *syncs = syncs.saturating_add(1);
        let is_due = *syncs >= every;
        if is_due {
            *syncs = 0;
        }
        is_due && !is_disabled
    }

    fn sample_frame(&self, slot: usize, sequence: u32, node: NodeId) -> Message {
        let report = self.base.report();
        match slot {
            ANSWER => Message::Answer(
                node,
                AnswerFrame {
                    friction_torque_nm: report.friction_torque_nm,
                    feed_forward_current_a: report.feed_forward_current_a,
                },
            ),
            STATUS => Message::Status(node, StatusFrame { flags: report.flags, sequence }),
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
                    load_torque_nm: f32::from_bits(self.base.inputs.load_torque_nm),
                },
            ),
        }
    }
}
