//! The joint driver between its bus and its current loop.
//!
//! Everything a driver does that is not done in every period: it takes frames in and gives frames out,
//! serves its objects, keeps the parameters, watches over the joint and tells the current loop what to
//! do. Time is passed in with every call and never read, so that a PC runs this very code in virtual time.
//! The STM32 and QEMU boards and `host-sim node` own a [`Driver`] each and add nothing but wires.
//!
//! ```text
//! frame -> receive -> network command · object -> staging, store, supervisor
//!                  -> PDO, SYNC      -> HIL joint (source: bus)   -> Answer, Status, Telemetry
//!                                    -> live inputs (source: sensors) <-> current loop
//! tick  -> heartbeat, timeouts, supervisor -> emergencies
//! ```

pub mod commissioning;
mod counters;
mod device;
pub mod live;
mod motor_watch;
mod objects;
pub mod over_compensation;
pub mod profile;
pub mod staging;

pub use counters::Counters;
pub use device::{Boot, Identity, REPORT_PERIOD_S};
pub use live::{Home, LoopOrders, LoopReport};

use crate::control::Covariates;
use crate::log::log;
use crate::node::sdo::SdoServer;
use crate::node::{Network, NmtAction};
use crate::node_settings::{NodeSettings, Source};
use crate::parameter_set::ParameterSet;
use crate::supervisor::{CanState, State, Supervisor};
use compensator_core::can::{Frame, FrameError, Message, Node, cob_id};
use compensator_core::network::Factors;
use device::Device;
use embedded_storage::nor_flash::NorFlash;

/// A joint driver.
#[derive(Debug)]
pub struct Driver<F> {
    network: Network,
    sdo: SdoServer,
    device: Device<F>,
    reset_wanted: bool,
    /// The state last logged.
    logged: State,
}

impl<F: NorFlash> Driver<F> {
    /// Starts: loads settings and parameters, reports what the last life ended with, and waits in a
    /// safe state. `settings` stand in where none are stored.
    pub fn boot(
        settings: NodeSettings,
        flash: F,
        identity: Identity,
        boot: &Boot,
        now_us: u64,
    ) -> Self {
        let mut device = Device::boot(settings, flash, identity, boot, now_us);
        let node = device.settings().node;
        let network = Network::boot(node, now_us, device.outbox());
        let mut driver = Self {
            network,
            sdo: SdoServer::new(),
            device,
            reset_wanted: false,
            logged: State::Safe,
        };
        log!(info, "start as node {=u8} on {=str}", node.number(), identity.hardware);
        if let Some(_text) = boot.panic {
            log!(error, "the last life ended with: {=str}", _text);
        }
        driver.publish_events();
        driver
    }

    /// Takes in a frame.
    pub fn receive(&mut self, frame: &Frame, now_us: u64) {
        self.device.counters.received = self.device.counters.received.wrapping_add(1);
        if let Some(action) = self.network.on_nmt_frame(frame) {
            self.execute(action, now_us);
            return;
        }
        if self.network.on_heartbeat(frame, self.device.settings().awaited_heartbeat, now_us) {
            self.device.sign_of_life(now_us);
            return;
        }
        let node = self.network.node();
        if frame.identifier() == cob_id::RPDO_1 + u16::from(node.number()) {
            if self.network.is_operational() {
                self.device.take_drive_frame(frame, now_us);
            } else {
                self.device.counters.count_passed_over();
            }
            return;
        }
        if frame.identifier() == cob_id::SDO_REQUEST + u16::from(node.number()) {
            self.serve(frame, node, now_us);
            self.publish_events();
            return;
        }
        match Message::parse(frame) {
            Ok(message) if self.network.is_operational() => {
                self.device.take(&message, frame, node, now_us);
            }
            Ok(_) => self.device.counters.count_passed_over(),
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
                // A joint nobody talks to any more does not stay armed.
                if !self.network.is_operational() {
                    self.device.disarm();
                }
            }
            NmtAction::Reset => self.reset_wanted = true,
            NmtAction::ResetCommunication => {
                self.device.disarm();
                self.sdo = SdoServer::new();
                self.device.forget_identifiers();
                let node = self.device.settings().node;
                self.network = Network::boot(node, now_us, self.device.outbox());
            }
        }
    }

    fn serve(&mut self, frame: &Frame, node: Node, now_us: u64) {
        if !self.network.serves_objects() {
            return;
        }
        let Ok(request) = <&[u8; 8]>::try_from(frame.data()) else {
            self.device.counters.count_wrong_length();
            return;
        };
        self.device.set_time(now_us);
        if let Some(answer) = self.sdo.answer(request, now_us, &mut self.device) {
            self.device.counters.sdo_refused = self.sdo.aborts();
            let identifier = cob_id::SDO_ANSWER + u16::from(node.number());
            if let Some(frame) = Frame::new(identifier, &answer) {
                self.device.outbox().push(frame);
            }
        }
    }

    /// Does what is due: call it once a millisecond or so.
    pub fn tick(&mut self, now_us: u64) {
        let settings = *self.device.settings();
        self.network.tick(settings.heartbeat_ms, now_us, self.device.outbox());
        let heartbeat_lost = self.network.misses_heartbeat(settings.awaited_heartbeat, now_us);
        self.device.tick(heartbeat_lost, now_us);
        self.publish_events();
    }

    /// Sends an emergency for every code that came or went.
    fn publish_events(&mut self) {
        while let Some((code, register, detail)) = self.device.next_event() {
            self.network.emergency(code, register, detail, self.device.outbox());
        }
        let state = self.supervisor().state();
        if state != self.logged {
            self.logged = state;
            match state {
                State::Safe => log!(info, "safe"),
                State::Armed => log!(info, "armed"),
                State::Fault => log!(warn, "stopped by a fault"),
            }
        }
    }

    /// The next frame to send.
    pub fn transmit(&mut self) -> Option<Frame> {
        self.device.outbox().pop()
    }

    /// How the controller stands to its bus, and whether it lost what came in.
    pub fn bus_state(&mut self, receiver_overrun: bool, can: CanState) {
        self.device.bus_state(receiver_overrun, can);
    }

    /// Whether the network asked for a restart; the board, or whoever stands for it, does it.
    pub const fn reset_wanted(&self) -> bool {
        self.reset_wanted
    }

    /// Its number on the bus, of this life.
    pub const fn node(&self) -> Node {
        self.network.node()
    }

    /// Whether its frames have the identifiers of `joint.dbc`: no master gave them others.
    pub fn has_own_identifiers(&self) -> bool {
        self.device.has_own_identifiers()
    }

    /// The bit rate it is to have, kbit/s.
    pub fn bit_rate_kbit(&self) -> u16 {
        self.device.settings().bit_rate_kbit
    }

    /// Where its inputs come from.
    pub fn source(&self) -> Source {
        self.device.settings().source
    }

    /// The supervisor, to look at.
    pub fn supervisor(&self) -> &Supervisor {
        self.device.supervisor()
    }

    /// What the bus side counted.
    pub fn counters(&self) -> &Counters {
        &self.device.counters
    }

    /// What the current loop is to do from now on.
    pub fn orders(&self, now_us: u64) -> LoopOrders {
        self.device.orders(now_us)
    }

    /// Looks whether the sensors of side load and pressure still measure; what one says that does not grows old. Called
    /// once a tick, on readings of bus and board.
    pub fn watch_seal(&mut self, covariates: &mut Covariates, now_us: u64) {
        self.device.watch_seal(covariates, now_us);
    }

    /// What the network, where there is one, says of the law's levels and stiffness, on what is known of the joint:
    /// evaluated at its own rate, while friction is compensated.
    pub fn supply(&mut self, covariates: &Covariates, now_us: u64) -> Option<Factors<f32>> {
        self.device.supply(covariates, now_us)
    }

    /// Takes in what the current loop did since the last report.
    pub fn report(&mut self, report: &LoopReport) {
        self.device.take_report(report);
    }

    /// The parameters in use, for building a current loop.
    pub fn set(&self) -> &ParameterSet {
        self.device.set()
    }

    /// Whether the joint is armed, on its own sensors or in HIL.
    pub fn is_armed(&self) -> bool {
        self.device.is_armed()
    }

    /// The flash, to look at.
    pub fn flash(&self) -> &F {
        self.device.flash()
    }

    /// Gives the flash back: what a power cut leaves.
    pub fn into_flash(self) -> F {
        self.device.into_flash()
    }
}
