//! State of a compact node behind its objects, and its periodic work.

use crate::driver::counters::Counters;
use crate::driver::device::compensation_share::CompensationShare;
use crate::driver::device::current_loop::LoopExchange;
use crate::driver::device::history::History;
use crate::driver::device::motor::MotorObservation;
use crate::driver::device::seal_sensors::SealSensors;
use crate::driver::device::{event_detail, watch};
use crate::driver::received::ReceivedInputs;
use crate::driver::staging::Staging;
use crate::driver::{LoopCommands, LoopOutput, LoopReport};
use crate::joint_node::{BoardOutput, BoardState, Boot, Identity, Joint, NodeParts};
use crate::node::dictionary::records::InputsObject;
use crate::node::sdo::Abort;
use crate::node::{Network, NmtAction, Outbox};
use crate::node_settings::{InputSource, MAX_BLOCK_BYTES, NodeSettings, split_block};
use crate::scope::ScopeOrder;
use crate::sensors::LocalReadings;
use crate::start_values::StartRecord;
use crate::store::{LoadError, Store};
use crate::supervisor::{CanState, Observation, ParameterSource, Supervisor, SupervisorBoot};
use crate::watch::ResidualWatch;
use compensator_core::can::{Frame, NodeId, SampleAssembler, SyncFrame, cob_id};
use embedded_storage::nor_flash::NorFlash;

/// Number of frames at a SYNC.
pub(super) const SYNC_FRAMES: usize = 5;

/// All parts of a compact node except its network state and its object server.
#[derive(Debug)]
pub struct Device<F> {
    pub(super) now_us: u64,
    pub(super) settings: NodeSettings,
    /// Codes that refused the last request.
    pub(super) blocking: u32,
    pub(super) can: CanState,
    pub(super) motor: MotorObservation,
    pub(super) compensation: CompensationShare,
    pub(super) watch: Option<ResidualWatch>,
    pub(super) received: ReceivedInputs,
    pub(super) inputs: InputsObject,
    /// Kind of the joint in a trace.
    pub(super) joint_kind: u32,
    pub(super) samples: SampleAssembler,
    /// Counter of the last SYNC, in the ring of those that have one.
    pub(super) sync_counter: u8,
    /// Each frame of a sample is sent at every n-th SYNC; 0: as by default.
    pub(super) sync_types: [u8; SYNC_FRAMES],
    /// SYNCs since each frame was sent.
    pub(super) syncs: [u8; SYNC_FRAMES],
    pub(super) current_loop: LoopExchange,
    pub(super) counters: Counters,
    pub(super) identity: Identity,
    pub(super) history: History,
    pub(super) seal_sensors: SealSensors,
    pub(super) store: Store<F>,
    pub(super) outbox: Outbox,
    pub(super) supervisor: Supervisor,
    pub(super) staging: Staging,
    pub(super) start: StartRecord,
}

impl<F: NorFlash> Device<F> {
    /// Returns the supervisor.
    pub const fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// Returns the flash.
    pub fn flash(&self) -> &F {
        self.store.flash()
    }

    // Not inlined: the stack of the block is free again during the rest of the start.
    #[inline(never)]
    fn load_block(&mut self) -> ParameterSource {
        let mut block = [0; MAX_BLOCK_BYTES];
        let length = match self.store.load(&mut block) {
            Ok(set) => set.length,
            Err(LoadError::Empty | LoadError::Damaged) => return ParameterSource::Default,
            Err(LoadError::Foreign(_) | LoadError::TooSmall { .. }) => {
                return ParameterSource::DefaultRefused;
            }
        };
        let (settings, parameters) = match split_block(block.get(..length).unwrap_or_default()) {
            Ok(parts) => parts,
            Err(error) => {
                self.staging.refuse(Abort::Value, error);
                return ParameterSource::DefaultRefused;
            }
        };
        // A set of the whole driver may have been that of a joint in HIL, which this node does not have.
        self.settings = NodeSettings { source: InputSource::Sensors, ..settings };
        match self.staging.load(parameters) {
            Ok(()) => ParameterSource::Set,
            Err(error) => {
                self.staging.refuse(Abort::Value, error);
                ParameterSource::DefaultRefused
            }
        }
    }

    /// Returns to the defaults of the communication.
    pub(super) fn restart_communication(&mut self) {
        self.samples = SampleAssembler::new(self.node());
        self.sync_types = [0; SYNC_FRAMES];
        self.syncs = [0; SYNC_FRAMES];
    }

    /// Starts the watch of the model with the parameters in use.
    pub(super) fn restart_watch(&mut self) {
        self.watch = watch(&self.staging.active().watch, &self.settings);
    }

    /// Returns the node number of the settings.
    pub(super) const fn node(&self) -> NodeId {
        self.settings.node
    }

    pub(super) fn disarm(&mut self) {
        self.supervisor.disarm();
    }

    /// Returns true if the bridge drives the motor.
    pub(super) fn is_bridge_in_use(&self) -> bool {
        self.supervisor.is_bridge_allowed()
    }

    pub(super) fn loop_commands(&self, now_us: u64) -> LoopCommands {
        let age_h = now_us as f32 * (1e-6 / 3600.0);
        let (set_number, gate_resets, home) = self.current_loop.orders();
        let supervisor = &self.supervisor;
        LoopCommands {
            setpoint: self.received.setpoint(now_us),
            covariates: self.received.covariates(self.settings.campaign_h + age_h, now_us),
            bridge: supervisor.is_bridge_allowed(),
            brake: self.staging.active().motor.brake_at_stop != 0.0
                && supervisor.is_braking_allowed(),
            compensation: supervisor.is_compensation_allowed(),
            current_share: supervisor.current_share(),
            compensation_share: self.compensation.share(),
            factors: None,
            set_number,
            gate_resets,
            home,
            probe: None,
            scope: ScopeOrder::OFF,
        }
    }

    pub(super) fn error_register(&self) -> u8 {
        self.supervisor.faults().error_register() | self.supervisor.limits().error_register()
    }

    pub(super) fn is_commissioned(&self) -> bool {
        self.settings.commissioned == self.staging.wiring_crc()
    }
}

impl<F: NorFlash> Joint for Device<F> {
    type Flash = F;

    fn with_defaults(settings: NodeSettings, flash: F, identity: Identity, now_us: u64) -> Self {
        Self {
            now_us,
            settings,
            blocking: 0,
            can: CanState::Active,
            motor: MotorObservation::default(),
            compensation: CompensationShare::default(),
            watch: None,
            received: ReceivedInputs::default(),
            // Inputs before any frame: every float is NaN.
            inputs: InputsObject::filled(f32::NAN.to_bits()),
            joint_kind: 0,
            samples: SampleAssembler::new(settings.node),
            sync_counter: SyncFrame::LAST,
            sync_types: [0; SYNC_FRAMES],
            syncs: [0; SYNC_FRAMES],
            current_loop: LoopExchange::default(),
            counters: Counters::default(),
            identity,
            history: History::default(),
            seal_sensors: SealSensors::default(),
            store: Store::open(flash),
            outbox: Outbox::default(),
            supervisor: Supervisor::default(),
            staging: Staging::default(),
            start: StartRecord::default(),
        }
    }

    #[inline(never)]
    fn load(&mut self, boot: &Boot) {
        let parameters = self.load_block();
        self.start = StartRecord::of(self.staging.active(), self.settings.bus());
        let commissioned = self.is_commissioned();
        self.supervisor.start(
            &self.staging.active().thresholds,
            &SupervisorBoot {
                reset: boot.cause,
                panicked: boot.panic.is_some(),
                stack_overflowed: boot.stack_overflowed,
                store: self.store.health(),
                parameters,
                commissioned,
                failed_self_test: boot.failed_self_test,
            },
        );
        self.motor.set_winding_rise(boot.winding_rise_k);
        self.restart_watch();
        self.history.set_panic(boot.panic.unwrap_or_default());
        self.restart_communication();
    }

    fn parts(&mut self) -> NodeParts<'_> {
        NodeParts {
            settings: &self.settings,
            identity: &self.identity,
            set: self.staging.active(),
            supervisor: &self.supervisor,
            start: &mut self.start,
            counters: &mut self.counters,
            outbox: &mut self.outbox,
        }
    }

    fn set_time(&mut self, now_us: u64) {
        self.now_us = now_us;
    }

    fn take_frame(&mut self, frame: &Frame, network: &Network, now_us: u64) -> Option<NmtAction> {
        self.now_us = now_us;
        self.take_process_frame(frame, network.node(), network.is_operational());
        None
    }

    fn receive_identifiers(&self, node: NodeId) -> [u16; 6] {
        // The filters of the start accept everything with its node number, which another one needs too.
        let node = u16::from(node.number());
        let [a, b, c] = [cob_id::RPDO_2, cob_id::RPDO_3, cob_id::RPDO_4].map(|base| base + node);
        [a, b, c, 0, 0, 0]
    }

    fn stop(&mut self, command: Option<NmtAction>, _now_us: u64) {
        self.disarm();
        if command == Some(NmtAction::ResetCommunication) {
            self.restart_communication();
        }
    }

    fn take_board_state(&mut self, state: &BoardState) {
        self.counters.count_bus(state.receiver_overrun, self.can, state.can);
        self.can = state.can;
    }

    fn report(&mut self, report: &LoopReport) {
        self.current_loop.take_report(report);
        if report.is_repeated {
            // A tick just before a report finds none, and the next one finds two: a step here would be one too many.
            return;
        }
        let drives = self.supervisor.is_bridge_allowed();
        let set = self.staging.active();
        let proven = self.settings.proven == self.staging.wiring_crc();
        let thresholds = self.supervisor.thresholds();
        self.motor.step(self.current_loop.report(), &set.motor, thresholds, drives, proven);
        if self.motor.state().is_turning_unseen {
            self.current_loop.lose_home();
        }
        // A proof belongs to the wiring that turned the joint.
        if self.motor.state().is_proven && self.start.is_in_use(set) {
            self.settings.proven = self.staging.wiring_crc();
        }
        let is_compensated = self.supervisor.is_compensation_allowed();
        self.compensation.step(report, set, is_compensated, Some(0.0));
        self.supervisor.record_overruns(report.overruns_in_a_row);
        if let Some(watch) = &mut self.watch {
            let is_valid = report.residual_torque_nm.is_finite();
            watch.step(report.residual_torque_nm, report.velocity_rad_s, is_valid);
        }
    }

    fn tick(&mut self, network: &Network, now_us: u64) -> bool {
        self.now_us = now_us;
        let is_position_needed = self.supervisor.thresholds().position_required != 0;
        let (report, awaited) = (self.current_loop.report(), self.settings.awaited_heartbeat);
        let mut observation = Observation {
            position_missing: is_position_needed && report.position_rad.is_nan(),
            stack_intact: report.stack_intact,
            can: self.can,
            heartbeat_lost: network.is_heartbeat_missing(awaited, now_us),
            model_in_band: self.watch.as_ref().and_then(ResidualWatch::in_band),
            ..Observation::default()
        };
        let (motor, compensation) = (self.motor.state(), &self.compensation);
        self.current_loop.observe(motor, compensation, &self.seal_sensors, &mut observation);
        self.supervisor.observe(&observation, now_us);
        self.current_loop.mark_report_seen();
        false
    }

    fn loop_output(&mut self, sensors: &LocalReadings, now_us: u64) -> LoopOutput {
        let mut commands = self.loop_commands(now_us);
        sensors.apply_newer(&mut commands.covariates, now_us);
        self.seal_sensors.check(&mut commands.covariates, now_us);
        LoopOutput { commands, gains: None }
    }

    fn board_output(&self) -> BoardOutput {
        BoardOutput { winding_rise_k: self.motor.winding_rise_k(), ..BoardOutput::default() }
    }

    fn next_event(&mut self) -> Option<(u16, u8, [u8; 5])> {
        let event = self.supervisor.take_event()?;
        let code = self.history.record_event(event);
        let [number, test] = event_detail(&self.supervisor, event);
        Some((code, self.error_register(), [number, 0, test, 0, 0]))
    }
}
