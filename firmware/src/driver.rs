//! The joint driver between its bus and its current loop.
//!
//! A driver does all work that is not done in every period of the current loop. It processes frames, serves its
//! objects, keeps the parameters, supervises the joint and commands the current loop. Time is passed in with
//! every call, so that a PC runs the same code in virtual time. The boards and `host-sim node`
//! own a [`Driver`] each and add only hardware access.
//!
//! ```text
//! frame -> receive -> network command · object -> staging, store, supervisor
//!                  -> PDO, SYNC      -> HIL joint (source: bus)   -> Answer, Status, Telemetry
//!                                    -> received inputs (source: sensors) <-> current loop
//! tick  -> heartbeat, timeouts, supervisor -> emergencies
//! ```

pub mod angle;
pub mod commissioning;
pub(crate) mod counters;
pub(crate) mod device;
pub mod holding_brake;
mod home;
pub mod loop_data;
mod motion;
pub(crate) mod motor_watch;
pub(crate) mod objects;
pub mod over_compensation;
pub mod passivity;
pub mod profile;
pub mod received;
pub mod staging;
pub mod trajectory;
mod unseen_turning;

pub use counters::Counters;
pub use device::{Boot, Identity};
pub use home::{KeptHome, MOVED_MAX_TURNS};
pub use loop_data::{Home, LoopCommands, LoopReport, REPORT_PERIOD_S, TouchEdges};
pub(crate) use loop_data::{PeriodValues, ReportStatus, ReportedAngle};

use crate::access::Key;
use crate::control::Covariates;
use crate::log::log;
use crate::loop_parts::StageTraits;
use crate::node::lss::LSS_REQUEST;
use crate::node::sdo::SdoServer;
use crate::node::{Network, NmtAction};
use crate::node_settings::{InputSource, NodeSettings};
use crate::parameter_set::ParameterSet;
use crate::scope::{Scope, ScopeRow};
use crate::sensors::biss::{self, TURN_WORDS};
use crate::sensors::enclosure;
use crate::start_values::StartRecord;
use crate::supervisor::{CanState, JointState, Supervisor};
use compensator_core::adaptation::Gains;
use compensator_core::can::{FdTelemetry, Frame, FrameError, Message, NodeId, cob_id};
use compensator_core::network::Factors;
use device::Device;
use embedded_storage::nor_flash::NorFlash;

/// Maximum time from the request of a restart to the restart, us: a joint that has not stopped by then is left to its open
/// bridge. The longest ramp of the reference joint and the longest delay of a holding brake fit into it.
const RESTART_LIMIT_US: u64 = 10_000_000;

/// Time from the start until the model and its live terms are logged, us: sensors and bus have reported by then.
const MODEL_LOG_DELAY_US: u64 = 1_000_000;

/// A joint driver.
#[derive(Debug)]
pub struct Driver<F> {
    network: Network,
    sdo: SdoServer,
    device: Device<F>,
    is_reset_requested: bool,
    /// A restart waits until the joint has stopped, at the latest until this time, us.
    restart_until_us: Option<u64>,
    /// The last state that was logged.
    logged: JointState,
    /// Time at which the model is logged, us; `None` afterwards.
    model_log_us: Option<u64>,
}

impl<F: NorFlash> Driver<F> {
    /// Starts the driver: loads settings and parameters, reports how the previous run ended, and waits in a safe
    /// state. `settings` apply if none are stored.
    pub fn boot(
        settings: NodeSettings,
        flash: F,
        identity: Identity,
        boot: &Boot,
        now_us: u64,
    ) -> Self {
        let mut driver = Self::with_defaults(settings, flash, identity, now_us);
        driver.load(boot, now_us);
        driver
    }

    /// Creates a driver that has loaded nothing yet. [`Self::load`] completes its start; a board with little stack
    /// calls it once the driver is at its place. `settings` apply if none are stored.
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
            restart_until_us: None,
            logged: JointState::Safe,
            model_log_us: Some(now_us.saturating_add(MODEL_LOG_DELAY_US)),
        }
    }

    /// Loads settings and parameters, reports how the previous run ended and sends the boot-up message.
    pub fn load(&mut self, boot: &Boot, now_us: u64) {
        self.device.load(boot);
        let node = self.device.settings().node;
        self.network = Network::boot(node, now_us, self.device.outbox());
        let _hardware = self.device.identity.hardware;
        log!(info, "start as node {=u8} on {=str}", node.number(), _hardware);
        if let Some(_text) = boot.panic {
            log!(error, "the last life ended with: {=str}", _text);
        }
        self.publish_events();
    }

    /// Processes a received frame.
    pub fn receive(&mut self, frame: &Frame, now_us: u64) {
        self.device.counters.received = self.device.counters.received.wrapping_add(1);
        if self.network.on_heartbeat(frame, self.device.settings().awaited_heartbeat, now_us) {
            self.device.confirm_target_by_heartbeat(now_us);
            return;
        }
        if self.restart_until_us.is_some() {
            // Nothing ends the stop before the restart.
            return;
        }
        if let Some(action) = self.network.on_nmt_frame(frame) {
            self.execute(action, now_us);
            return;
        }
        let node = self.network.node();
        if let Some(slot) = self.device.receive_slot(frame.identifier()) {
            if self.network.is_operational() {
                self.device.take_pdo(slot, frame, now_us);
            } else {
                self.device.counters.count_passed_over();
            }
            return;
        }
        if frame.identifier() == LSS_REQUEST {
            if self.device.configure(frame) {
                self.execute(NmtAction::ResetCommunication, now_us);
            }
            self.publish_events();
            return;
        }
        if frame.identifier() == cob_id::SDO_REQUEST + u16::from(node.number()) {
            self.serve(frame, node, now_us);
            self.publish_events();
            return;
        }
        if frame.identifier() == cob_id::SYNC && frame.data().is_empty() {
            if self.network.is_operational() {
                self.device.take_sync(None, now_us);
            } else {
                self.device.counters.count_passed_over();
            }
            return;
        }
        match Message::parse(frame) {
            Ok(_) if !self.network.is_operational() => self.device.counters.count_passed_over(),
            // The receive PDOs have been processed: other frames are those of other joints, or of a disabled PDO.
            Ok(Message::Sync(sync)) => self.device.take_sync(Some(sync.counter), now_us),
            Ok(_) => self.device.counters.count_foreign(),
            Err(FrameError::Foreign(_)) => self.device.counters.count_foreign(),
            Err(FrameError::Length { .. }) => self.device.counters.count_wrong_length(),
            Err(FrameError::Counter(_) | FrameError::JointKind(_)) => {
                self.device.counters.count_wrong_content();
            }
        }
    }

    fn execute(&mut self, action: NmtAction, now_us: u64) {
        match action {
            NmtAction::State(_) => {
                // A joint without a master must not stay armed.
                if !self.network.is_operational() {
                    self.device.set_time(now_us);
                    self.device.restart_pdos();
                    self.device.stop_connection();
                }
            }
            NmtAction::Reset => {
                self.device.note_ordered_restart();
                self.begin_restart(now_us);
            }
            NmtAction::ResetCommunication => {
                self.device.set_time(now_us);
                self.device.stop_connection();
                self.device.lock();
                self.sdo = SdoServer::new();
                self.device.reset_pdos();
                let node = self.device.settings().node;
                self.network = Network::boot(node, now_us, self.device.outbox());
            }
        }
    }

    /// Stops the joint as if its connection were lost. The restart follows once it has stopped.
    fn begin_restart(&mut self, now_us: u64) {
        self.restart_until_us = Some(now_us.saturating_add(RESTART_LIMIT_US));
        self.device.set_time(now_us);
        self.device.stop_connection();
        self.watch_restart(now_us);
    }

    fn watch_restart(&mut self, now_us: u64) {
        if let Some(until_us) = self.restart_until_us {
            self.is_reset_requested |=
                now_us >= until_us || self.device.motion.has_stopped(&self.device.seen());
        }
    }

    fn serve(&mut self, frame: &Frame, node: NodeId, now_us: u64) {
        if !self.network.can_serve_objects() {
            return;
        }
        let Ok(request) = <&[u8; 8]>::try_from(frame.data()) else {
            self.device.counters.count_wrong_length();
            return;
        };
        self.device.set_time(now_us);
        let answer = self.sdo.answer(request, now_us, &mut self.device);
        self.send_answer(answer, node);
    }

    /// Sends a frame of the object server, if there is one.
    fn send_answer(&mut self, answer: Option<[u8; 8]>, node: NodeId) {
        let Some(answer) = answer else { return };
        self.device.counters.sdo_refused = self.sdo.aborts();
        let identifier = cob_id::SDO_ANSWER + u16::from(node.number());
        if let Some(frame) = Frame::new(identifier, &answer) {
            self.device.outbox().push(frame);
        }
    }

    /// Runs the periodic work: call it about once a millisecond.
    pub fn tick(&mut self, now_us: u64) {
        let settings = *self.device.settings();
        self.network.tick(settings.heartbeat_ms, now_us, self.device.outbox());
        let heartbeat_lost = self.network.is_heartbeat_missing(settings.awaited_heartbeat, now_us);
        self.device.tick(heartbeat_lost, now_us);
        if self.network.is_operational() {
            self.device.transmit_events(now_us);
        }
        if self.network.can_serve_objects() {
            let frame = self.sdo.tick(now_us, &mut self.device);
            self.send_answer(frame, self.network.node());
        }
        if self.restart_until_us.is_none() && self.device.program.is_restart_due(now_us) {
            self.begin_restart(now_us);
        }
        self.watch_restart(now_us);
        if self.model_log_us.is_some_and(|log_us| now_us >= log_us) {
            self.model_log_us = None;
            self.device.log_model();
        }
        self.publish_events();
    }

    /// Sends an emergency for every code that was raised or cleared.
    fn publish_events(&mut self) {
        while let Some((code, register, detail)) = self.device.next_event() {
            self.network.emergency(code, register, detail, self.device.outbox());
        }
        let state = self.supervisor().state();
        if state != self.logged {
            self.logged = state;
            match state {
                JointState::Safe => log!(info, "safe"),
                JointState::Armed => log!(info, "armed"),
                JointState::Fault => log!(warn, "stopped by a fault"),
            }
        }
    }

    /// Returns the next frame to send; called when the controller has room for it. The segments of a block are
    /// made only here, when no other frame waits: the queue is shorter than a block.
    pub fn transmit(&mut self) -> Option<Frame> {
        self.transmit_if(|_| true)
    }

    /// Returns the next frame to send of those whose identifier the controller can take now.
    pub fn transmit_if(&mut self, can_send: impl FnMut(u16) -> bool) -> Option<Frame> {
        if self.device.outbox().is_empty() && self.network.can_serve_objects() {
            let segment = self.sdo.next_segment(&mut self.device);
            self.send_answer(segment, self.network.node());
        }
        self.device.outbox().take(can_send)
    }

    /// States that the CAN controller sends frames of CAN FD. Without it, `fd_telemetry` (2001h:9) is refused.
    pub const fn allow_fd(&mut self) {
        self.device.sends_fd = true;
    }

    /// Returns the frame of CAN FD that waits to be sent; called when the controller has room for it.
    pub fn transmit_fd(&mut self) -> Option<FdTelemetry> {
        self.transmit_fd_if(|_| true)
    }

    /// Returns the frame of CAN FD, if the controller can take its identifier now.
    pub fn transmit_fd_if(&mut self, can_send: impl FnOnce(u16) -> bool) -> Option<FdTelemetry> {
        self.device.outbox().take_fd(can_send)
    }

    /// Sets the state of the CAN controller, and whether received frames were lost.
    pub fn bus_state(&mut self, receiver_overrun: bool, can: CanState) {
        self.device.bus_state(receiver_overrun, can);
    }

    /// Sets the first words of the last frame of a BiSS encoder, before a tick; `None` without one.
    pub fn take_biss(&mut self, words: Option<[u16; TURN_WORDS]>) {
        self.device.take_biss(words);
    }

    /// Sets the levels of Hall sensors, before the reports of a tick; illegal ones if there are no sensors.
    pub fn take_hall(&mut self, levels: u8) {
        self.device.motion.take_hall(levels);
    }

    /// Sets the secret of the access challenges: random bytes of the board, new at every start. Without them, the
    /// challenges depend on the key and the time.
    pub const fn seed_challenges(&mut self, seed: [u8; Key::LENGTH]) {
        self.device.lock.seed(seed);
    }

    pub(crate) const fn start_record(&self) -> &StartRecord {
        &self.device.start
    }

    pub(crate) const fn start_record_mut(&mut self) -> &mut StartRecord {
        &mut self.device.start
    }

    /// Returns the properties of the power stage.
    pub(crate) const fn stage(&self) -> StageTraits {
        self.device.identity.stage
    }

    /// Gives the scope its memory. Without it, a capture is refused.
    pub fn set_scope_memory(&mut self, memory: &'static mut [f32]) {
        self.device.scope = Scope::new(memory);
    }

    /// Takes a row of the scope from the current loop.
    pub fn take_scope_row(&mut self, row: &ScopeRow) {
        self.device.scope.take(row);
    }

    /// Sets the last readings of the dry side, before a tick.
    pub fn set_enclosure(&mut self, readings: enclosure::Readings) {
        self.device.set_enclosure(readings);
    }

    /// Sets the words of the encoder at the joint's side of the gear, before the reports of a tick; `None` without one.
    pub const fn set_joint_words(&mut self, words: Option<[u16; biss::WORDS]>) {
        self.device.set_joint_words(words);
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

    /// Returns true if its frames have the identifiers of `joint.dbc`: no master changed them.
    pub fn has_own_identifiers(&self) -> bool {
        self.device.has_own_identifiers()
    }

    /// Returns the identifiers that the controller must accept besides broadcasts and those with the node number of
    /// the start: receive PDOs and SDO. 0 for none.
    pub fn receive_identifiers(&self) -> [u16; 7] {
        let [a, b, c, d, e, f] = self.device.receive_identifiers();
        [a, b, c, d, e, f, cob_id::SDO_REQUEST + u16::from(self.network.node().number())]
    }

    /// Returns the bit rate of the settings, kbit/s.
    pub fn bit_rate_kbit(&self) -> u16 {
        self.device.settings().bit_rate_kbit
    }

    /// Returns the bit rate of the data of CAN FD frames on the bus, kbit/s.
    pub fn data_bit_rate_kbit(&self) -> u16 {
        self.device.settings().data_bit_rate_kbit
    }

    /// Returns the source of its inputs.
    pub fn source(&self) -> InputSource {
        self.device.settings().source
    }

    /// Returns the supervisor.
    pub fn supervisor(&self) -> &Supervisor {
        self.device.supervisor()
    }

    /// Returns the counters of the bus side.
    pub fn counters(&self) -> &Counters {
        &self.device.counters
    }

    /// Returns the commands for the current loop.
    pub fn loop_commands(&self, now_us: u64) -> LoopCommands {
        self.device.loop_commands(now_us)
    }

    /// Returns the gains that the adaptation has learnt, and their number.
    pub fn learnt_gains(&self) -> (u32, Gains<f32>) {
        self.device.learnt()
    }

    /// Returns the level of the holding brake's output; `None` if the joint has no brake: the output is not driven.
    pub fn brake_output(&self) -> Option<bool> {
        self.device.motion.stopping.brake().output(&self.device.settings().drive)
    }

    /// Returns the home to keep over a reset; `None` if none is known.
    pub fn kept_home(&self) -> Option<KeptHome> {
        self.device.kept_home()
    }

    /// Returns the rise of the winding above the stator by its model, K; `None` if it is not known.
    pub fn winding_rise_k(&self) -> Option<f32> {
        self.device.winding_rise_k()
    }

    /// Checks that the sensors of side load and pressure still change. The reading of a stuck sensor ages.
    /// Called once per tick with the readings of bus and board.
    pub fn check_seal_sensors(&mut self, covariates: &mut Covariates, now_us: u64) {
        self.device.check_seal_sensors(covariates, now_us);
    }

    /// Returns the network's factors for the law, if there is a network. It is evaluated at its own rate while
    /// friction is compensated.
    pub fn supply(&mut self, covariates: &Covariates, now_us: u64) -> Option<Factors<f32>> {
        self.device.supply(covariates, now_us)
    }

    /// Processes a report of the current loop.
    pub fn report(&mut self, report: &LoopReport) {
        self.device.take_report(report);
    }

    /// Returns the parameters in use, for building a current loop.
    pub fn set(&self) -> &ParameterSet {
        self.device.set()
    }

    /// Returns true if the joint is armed, on its own sensors or in HIL.
    pub fn is_armed(&self) -> bool {
        self.device.is_armed()
    }

    /// Returns the flash.
    pub fn flash(&self) -> &F {
        self.device.flash()
    }

    /// Returns the flash, for a simulated fault.
    pub fn flash_mut(&mut self) -> &mut F {
        self.device.flash_mut()
    }

    /// Returns the flash by value, as a power cut leaves it.
    pub fn into_flash(self) -> F {
        self.device.into_flash()
    }
}
