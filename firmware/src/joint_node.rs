//! A joint on its bus: network state, object server, and the joint itself.
//!
//! [`JointNode`] is what every driver has: network commands, heartbeat, objects, emergencies, restart. Behind [`Joint`] are
//! the parts that differ: those of the whole driver ([`crate::driver::Device`]), or those of a small chip
//! ([`crate::compact::Device`]).
//!
//! ```text
//! frames   -> receive         -+         +-> transmit_if -> frames
//! state of the board, reports -+-> joint +-> LoopOutput  -> current loop
//! time     -> tick            -+         +-> BoardOutput -> brake, memory over a reset
//! ```

mod base;
mod board;
pub(crate) mod compensation_share;
pub(crate) mod current_loop;
pub(crate) mod history;
pub(crate) mod objects;
pub(crate) mod refusals;
pub(crate) mod sample_frames;
pub(crate) mod seal_sensors;

pub use base::JointBase;
pub(crate) use base::{StoredBlock, larger_than_stored, recall};
pub use board::{BoardOutput, BoardState, Boot, Equipment, Identity};

use crate::driver::loop_data::{LoopOutput, LoopReport};
use crate::log::log;
use crate::node::lss::LSS_REQUEST;
use crate::node::sdo::{Objects, SdoServer};
use crate::node::{Emergency, Network, NmtAction};
use crate::node_settings::NodeSettings;
use crate::scope::ScopeRow;
use crate::sensors::LocalReadings;
use crate::supervisor::JointState;
use compensator_core::can::{FdTelemetry, Frame, NodeId, cob_id};

/// Maximum time from the request of a restart to the restart, us: a joint that has not stopped by then is left to its open
/// bridge. The longest ramp of the reference joint and the longest delay of a holding brake fit into it.
const RESTART_LIMIT_US: u64 = 10_000_000;

/// A joint behind its node. What a joint without a part does not need has an empty default.
pub trait Joint: Objects + Sized {
    /// Memory of settings and parameters.
    type Flash;

    /// Creates a joint that has loaded nothing. `settings` apply if none are stored.
    fn with_defaults(
        settings: NodeSettings,
        flash: Self::Flash,
        identity: Identity,
        now_us: u64,
    ) -> Self;

    /// Loads settings and parameters, and records how the previous run ended.
    fn load(&mut self, boot: &Boot);

    /// Takes what the board has.
    fn equip(&mut self, _equipment: Equipment) {}

    /// Returns the flash, on a PC.
    fn flash(&self) -> &Self::Flash;

    /// Returns what every joint has.
    fn base(&mut self) -> &mut JointBase;

    /// Sets the time of a request.
    fn set_time(&mut self, now_us: u64) {
        self.base().now_us = now_us;
    }

    /// Processes the monitored heartbeat.
    fn take_heartbeat(&mut self, _now_us: u64) {}

    /// Processes a frame that is neither of the network nor a request to the object server. Returns what it requires of the
    /// network.
    fn take_frame(&mut self, frame: &Frame, network: &Network, now_us: u64) -> Option<NmtAction>;

    /// Returns the identifiers of the process frames that it receives under this node number; 0 for none.
    fn receive_identifiers(&self, node: NodeId) -> [u16; 6];

    /// Stops because of a network command, as if the connection were lost, and without one for a restart of its own.
    fn stop(&mut self, command: Option<NmtAction>, now_us: u64);

    /// Returns true if a restart changes nothing, because the joint has stopped.
    fn is_stopped(&self) -> bool {
        true
    }

    /// Takes the state of the board, before the reports of a tick.
    fn take_board_state(&mut self, state: &BoardState);

    /// Processes a report of the current loop.
    fn report(&mut self, report: &LoopReport);

    /// Takes a row of the scope from the current loop.
    fn take_scope_row(&mut self, _row: &ScopeRow) {}

    /// Runs the periodic work. Returns true if it needs a restart.
    fn tick(&mut self, network: &Network, now_us: u64) -> bool;

    /// Returns what the current loop needs after a tick, with the board's own readings where they are newer. The reading of a
    /// stuck sensor ages.
    fn loop_output(&mut self, sensors: &LocalReadings, now_us: u64) -> LoopOutput;

    /// Returns what the board needs after a tick.
    fn board_output(&self) -> BoardOutput;

    /// Returns the next code that was raised or cleared.
    fn next_emergency(&mut self) -> Option<Emergency>;
}

/// A joint on its bus.
#[derive(Debug)]
pub struct JointNode<J> {
    /// The joint.
    pub joint: J,
    network: Network,
    sdo: SdoServer,
    is_reset_requested: bool,
    /// A restart waits until the joint has stopped, at the latest until this time, us.
    restart_until_us: Option<u64>,
    /// The last state that was logged.
    logged: JointState,
}

impl<J: Joint> JointNode<J> {
    /// Starts a node: loads settings and parameters, reports how the previous run ended, and waits in a safe state.
    /// `settings` apply if none are stored.
    pub fn boot(
        settings: NodeSettings,
        flash: J::Flash,
        identity: Identity,
        boot: &Boot,
        now_us: u64,
    ) -> Self {
        let mut node = Self::with_defaults(settings, flash, identity, now_us);
        node.load(boot, now_us);
        node
    }

    /// Creates a node that has loaded nothing yet. [`Self::load`] completes its start; a board with little stack calls it
    /// once the node is at its place. `settings` apply if none are stored.
    pub fn with_defaults(
        settings: NodeSettings,
        flash: J::Flash,
        identity: Identity,
        now_us: u64,
    ) -> Self {
        Self {
            network: Network::new(settings.node, now_us),
            sdo: SdoServer::new(),
            joint: J::with_defaults(settings, flash, identity, now_us),
            is_reset_requested: false,
            restart_until_us: None,
            logged: JointState::Safe,
        }
    }

    /// Loads settings and parameters, reports how the previous run ended and sends the boot-up message.
    pub fn load(&mut self, boot: &Boot, now_us: u64) {
        self.joint.load(boot);
        self.boot_network(now_us);
        let JointBase { settings: _settings, identity: _identity, .. } = self.joint.base();
        log!(info, "start as node {=u8} on {=str}", _settings.node.number(), _identity.hardware);
        if let Some(_text) = boot.panic {
            log!(error, "the last life ended with: {=str}", _text);
        }
        self.publish_events();
    }

    fn boot_network(&mut self, now_us: u64) {
        let base = self.joint.base();
        self.network = Network::boot(base.settings.node, now_us, &mut base.outbox);
    }

    /// Processes a received frame.
    pub fn receive(&mut self, frame: &Frame, now_us: u64) {
        let JointBase { settings, counters, .. } = self.joint.base();
        counters.received = counters.received.wrapping_add(1);
        if self.network.on_heartbeat(frame, settings.awaited_heartbeat, now_us) {
            return self.joint.take_heartbeat(now_us);
        }
        if self.restart_until_us.is_some() {
            // Nothing ends the stop before the restart.
            return;
        }
        if let Some(action) = self.network.on_nmt_frame(frame) {
            return self.execute(action, now_us);
        }
        let is_request = frame.identifier() == self.request_identifier();
        if is_request {
            self.serve(frame, now_us);
        } else if let Some(action) = self.joint.take_frame(frame, &self.network, now_us) {
            self.execute(action, now_us);
        }
        // The events of process frames wait for the tick.
        if is_request || frame.identifier() == LSS_REQUEST {
            self.publish_events();
        }
    }

    fn execute(&mut self, action: NmtAction, now_us: u64) {
        if matches!(action, NmtAction::State(_)) && self.network.is_operational() {
            return;
        }
        // A joint without a master must not stay armed.
        self.joint.stop(Some(action), now_us);
        match action {
            NmtAction::State(_) => {}
            NmtAction::Reset => self.begin_restart(now_us),
            NmtAction::ResetCommunication => {
                self.sdo = SdoServer::new();
                self.boot_network(now_us);
            }
        }
    }

    /// Restarts once the joint, which stops, has stopped.
    fn begin_restart(&mut self, now_us: u64) {
        self.restart_until_us = Some(now_us.saturating_add(RESTART_LIMIT_US));
        self.watch_restart(now_us);
    }

    fn watch_restart(&mut self, now_us: u64) {
        if let Some(until_us) = self.restart_until_us {
            self.is_reset_requested |= now_us >= until_us || self.joint.is_stopped();
        }
    }

    fn serve(&mut self, frame: &Frame, now_us: u64) {
        if !self.network.can_serve_objects() {
            return;
        }
        let Ok(request) = <&[u8; 8]>::try_from(frame.data()) else {
            return self.joint.base().counters.count_wrong_length();
        };
        self.joint.set_time(now_us);
        let answer = self.sdo.answer(request, now_us, &mut self.joint);
        self.send_answer(answer);
    }

    /// Sends a frame of the object server, if there is one.
    fn send_answer(&mut self, answer: Option<[u8; 8]>) {
        let Some(answer) = answer else { return };
        let JointBase { counters, outbox, .. } = self.joint.base();
        counters.sdo_refused = self.sdo.aborts();
        let identifier = cob_id::SDO_ANSWER + u16::from(self.network.node().number());
        if let Some(frame) = Frame::new(identifier, &answer) {
            outbox.push(frame);
        }
    }

    /// Runs the periodic work: call it about once a millisecond.
    pub fn tick(&mut self, now_us: u64) {
        let JointBase { settings, outbox, .. } = self.joint.base();
        self.network.tick(settings.heartbeat_ms, now_us, outbox);
        let needs_restart = self.joint.tick(&self.network, now_us);
        if self.network.can_serve_objects() {
            let frame = self.sdo.tick(now_us, &mut self.joint);
            self.send_answer(frame);
        }
        if needs_restart && self.restart_until_us.is_none() {
            self.joint.stop(None, now_us);
            self.begin_restart(now_us);
        }
        self.watch_restart(now_us);
        self.publish_events();
    }

    /// Sends an emergency for every code that was raised or cleared.
    fn publish_events(&mut self) {
        while let Some(emergency) = self.joint.next_emergency() {
            self.network.send_emergency(&emergency, &mut self.joint.base().outbox);
        }
        let state = self.joint.base().supervisor.state();
        if state != self.logged {
            self.logged = state;
            match state {
                JointState::Safe => log!(info, "safe"),
                JointState::Armed => log!(info, "armed"),
                JointState::Fault => log!(warn, "stopped by a fault"),
            }
        }
    }

    /// Returns the next frame to send.
    pub fn transmit(&mut self) -> Option<Frame> {
        self.transmit_if(|_| true)
    }

    /// Returns the next frame to send of those whose identifier the controller can take now. The segments of a block are made
    /// only here, when no other frame waits: the queue is shorter than a block.
    pub fn transmit_if(&mut self, can_send: impl FnMut(u16) -> bool) -> Option<Frame> {
        if self.joint.base().outbox.is_empty() && self.network.can_serve_objects() {
            let segment = self.sdo.next_segment(&mut self.joint);
            self.send_answer(segment);
        }
        self.joint.base().outbox.take(can_send)
    }

    /// Returns the frame of CAN FD that waits, if the controller can take its identifier now.
    pub fn transmit_fd_if(&mut self, can_send: impl FnOnce(u16) -> bool) -> Option<FdTelemetry> {
        self.joint.base().outbox.take_fd(can_send)
    }

    /// Returns true if the network requested a restart and the joint has stopped. The board or its simulation performs
    /// the restart.
    pub const fn is_reset_requested(&self) -> bool {
        self.is_reset_requested
    }

    /// Returns the node number in use since the start.
    pub const fn node(&self) -> NodeId {
        self.network.node()
    }

    fn request_identifier(&self) -> u16 {
        cob_id::SDO_REQUEST + u16::from(self.node().number())
    }

    /// Returns the identifiers that the controller must accept besides broadcasts and those with the node number of the
    /// start: receive PDOs and SDO. 0 for none.
    pub fn receive_identifiers(&self) -> [u16; 7] {
        let [a, b, c, d, e, f] = self.joint.receive_identifiers(self.node());
        [a, b, c, d, e, f, self.request_identifier()]
    }
}
