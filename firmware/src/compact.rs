//! A joint driver for chips whose flash or RAM is too small for [`crate::driver`].
//!
//! It has the current loop, the compensator, the supervisor, the process frames, the parameter set and its store. Each
//! object that it serves ([`objects::is_served`]) has the index, type and meaning of the whole driver's, so that the tools of
//! a PC load, commit and save a set in the same way. It leaves out drive modes (CiA 402), program updates, access levels,
//! scope, HIL, adaptation, trials, commissioning measurements, CAN FD, LSS, mapping of PDOs, networks, holding brake, ramps
//! and the sensors of the dry side.
//!
//! ```text
//! frame -> receive -> network command · object -> staging, store, supervisor
//!                  -> Command, Seal, Surroundings <-> current loop
//!                  -> SYNC -> Motion, Torque, Answer, Status, Telemetry
//! tick  -> heartbeat, timeouts, supervisor -> emergencies
//! ```

mod device;
pub mod objects;
mod process;
mod requests;

use crate::background::JointNode;
use crate::control::Covariates;
use crate::driver::{Boot, Identity, LoopCommands, LoopReport};
use crate::loop_parts::StageTraits;
use crate::node::sdo::SdoServer;
use crate::node::{Network, NmtAction};
use crate::node_settings::NodeSettings;
use crate::parameter_set::ParameterSet;
use crate::start_values::StartRecord;
use crate::supervisor::{CanState, Supervisor};
use compensator_core::can::{Frame, NodeId, cob_id};
use device::Device;
use embedded_storage::nor_flash::NorFlash;

/// A joint driver without the parts that a small chip has no room for.
#[derive(Debug)]
pub struct CompactNode<F> {
    network: Network,
    sdo: SdoServer,
    device: Device<F>,
    is_reset_requested: bool,
}

impl<F: NorFlash> CompactNode<F> {
    /// Creates a node that has loaded nothing yet: [`JointNode::load`] completes its start. `settings` apply if none are
    /// stored. The parameters use the whole flash.
    pub fn with_defaults(
        settings: NodeSettings,
        flash: F,
        identity: Identity,
        now_us: u64,
    ) -> Self {
        Self {
            network: Network::new(settings.node, now_us),
            sdo: SdoServer::new(),
            device: Device::with_defaults(settings, flash, identity, now_us),
            is_reset_requested: false,
        }
    }

    /// Returns the node number in use.
    pub const fn node(&self) -> NodeId {
        self.network.node()
    }

    /// Returns the supervisor.
    pub const fn supervisor(&self) -> &Supervisor {
        &self.device.supervisor
    }

    /// Returns the flash.
    pub fn flash(&self) -> &F {
        self.device.store.flash()
    }

    fn execute(&mut self, action: NmtAction, now_us: u64) {
        match action {
            // A joint without a master must not stay armed.
            NmtAction::State(_) if self.network.is_operational() => {}
            NmtAction::State(_) => self.device.disarm(),
            NmtAction::Reset => {
                self.device.disarm();
                self.is_reset_requested = true;
            }
            NmtAction::ResetCommunication => {
                self.device.disarm();
                self.sdo = SdoServer::new();
                self.device.restart_communication();
                let node = self.device.settings.node;
                self.network = Network::boot(node, now_us, &mut self.device.outbox);
            }
        }
    }

    fn serve(&mut self, frame: &Frame, now_us: u64) {
        if !self.network.can_serve_objects() {
            return;
        }
        let Ok(request) = <&[u8; 8]>::try_from(frame.data()) else {
            return self.device.counters.count_wrong_length();
        };
        let answer = self.sdo.answer(request, now_us, &mut self.device);
        self.send_answer(answer);
    }

    fn send_answer(&mut self, answer: Option<[u8; 8]>) {
        let Some(answer) = answer else { return };
        self.device.counters.sdo_refused = self.sdo.aborts();
        let identifier = cob_id::SDO_ANSWER + u16::from(self.node().number());
        if let Some(frame) = Frame::new(identifier, &answer) {
            self.device.outbox.push(frame);
        }
    }

    /// Sends an emergency for every code that was raised or cleared.
    fn publish_events(&mut self) {
        while let Some((code, register, detail)) = self.device.next_event() {
            self.network.emergency(code, register, detail, &mut self.device.outbox);
        }
    }
}

impl<F: NorFlash> JointNode for CompactNode<F> {
    fn load(&mut self, boot: &Boot, now_us: u64) {
        self.device.load(boot);
        self.network = Network::boot(self.device.settings.node, now_us, &mut self.device.outbox);
        self.publish_events();
    }

    fn receive(&mut self, frame: &Frame, now_us: u64) {
        self.device.now_us = now_us;
        self.device.counters.received = self.device.counters.received.wrapping_add(1);
        if self.network.on_heartbeat(frame, self.device.settings.awaited_heartbeat, now_us) {
            return;
        }
        if let Some(action) = self.network.on_nmt_frame(frame) {
            self.execute(action, now_us);
        } else if frame.identifier() == cob_id::SDO_REQUEST + u16::from(self.node().number()) {
            self.serve(frame, now_us);
        } else {
            self.device.take_frame(frame, self.network.node(), self.network.is_operational());
        }
        self.publish_events();
    }

    /// Returns the next frame to send. The segments of a block are made only here, when no other frame waits: the queue is
    /// shorter than a block.
    fn transmit_if(&mut self, can_send: impl FnMut(u16) -> bool) -> Option<Frame> {
        if self.device.outbox.is_empty() && self.network.can_serve_objects() {
            let segment = self.sdo.next_segment(&mut self.device);
            self.send_answer(segment);
        }
        self.device.outbox.take(can_send)
    }

    fn is_reset_requested(&self) -> bool {
        self.is_reset_requested
    }

    fn receive_identifiers(&self) -> [u16; 7] {
        // The filters of the start accept everything with its node number, which another one needs too.
        let node = u16::from(self.node().number());
        let bases = [cob_id::RPDO_2, cob_id::RPDO_3, cob_id::RPDO_4, cob_id::SDO_REQUEST];
        let mut identifiers = [0; 7];
        for (identifier, base) in identifiers.iter_mut().zip(bases) {
            *identifier = base + node;
        }
        identifiers
    }

    fn set(&self) -> &ParameterSet {
        self.device.staging.active()
    }

    fn start_record(&self) -> &StartRecord {
        &self.device.start
    }

    fn start_record_mut(&mut self) -> &mut StartRecord {
        &mut self.device.start
    }

    fn stage(&self) -> StageTraits {
        self.device.identity.stage
    }

    fn bus_state(&mut self, receiver_overrun: bool, can: CanState) {
        self.device.bus_state(receiver_overrun, can);
    }

    fn report(&mut self, report: &LoopReport) {
        self.device.take_report(report);
    }

    fn tick(&mut self, now_us: u64) {
        let settings = &self.device.settings;
        let (awaited, every_ms) = (settings.awaited_heartbeat, settings.heartbeat_ms);
        self.network.tick(every_ms, now_us, &mut self.device.outbox);
        let heartbeat_lost = self.network.is_heartbeat_missing(awaited, now_us);
        self.device.tick(heartbeat_lost, now_us);
        if self.network.can_serve_objects() {
            let frame = self.sdo.tick(now_us, &mut self.device);
            self.send_answer(frame);
        }
        self.publish_events();
    }

    fn loop_commands(&self, now_us: u64) -> LoopCommands {
        self.device.loop_commands(now_us)
    }

    fn check_seal_sensors(&mut self, covariates: &mut Covariates, now_us: u64) {
        self.device.seal_sensors.check(covariates, now_us);
    }

    fn winding_rise_k(&self) -> Option<f32> {
        self.device.motor.winding_rise_k()
    }
}
