//! The device behind the object dictionary: state of a joint driver.

mod access;
mod adaptation;
mod boot;
mod commissioning;
mod inputs;
mod joint_encoder;
mod kept_home;
mod lss;
mod memory;
mod motion;
mod network;
mod parameter_trial;
mod pdos;
mod program;
mod requests;
mod scope;
mod stored_home;
mod terms;
mod touch_probe;
mod trend;
mod turn_readings;

use super::counters::Counters;
use super::loop_data::{LoopCommands, LoopOutput, LoopReport};
use super::motion::Motion;
use super::profile;
use crate::access::Lock;
use crate::joint_node::{BoardOutput, BoardState, Boot, Equipment, Identity, Joint, JointBase};
use crate::level_learner::LevelLearner;
use crate::node::lss::LSS_REQUEST;
use crate::node::lss::Lss;
use crate::node::{Emergency, Network, NmtAction};
use crate::node_settings::NodeSettings;
use crate::parameter_set::ParameterSet;
use crate::scope::{Scope, ScopeRow};
use crate::sensors::{LocalReadings, enclosure};
use crate::supervisor::{Code, JointState, Observation, Supervisor};
use compensator_core::can::{Frame, Message, NodeId, cob_id};
use embedded_storage::nor_flash::NorFlash;
use inputs::Samples;
use joint_encoder::JointEncoder;
use memory::Memory;
use network::LiveNetwork;
use parameter_trial::ParameterTrial;
use pdos::Pdos;
use stored_home::StoredHome;
use touch_probe::TouchProbes;
use trend::StoredTrend;
use turn_readings::TurnReadings;

/// All parts of a driver except its network state and its object server.
// Small parts first: the offset of a field in a load is limited, and each access beyond takes an instruction more.
#[derive(Debug)]
#[repr(C)]
pub struct Device<F> {
    /// The CAN controller of this board sends frames of CAN FD.
    pub(super) sends_fd: bool,
    trial: ParameterTrial,
    trend: StoredTrend,
    stored_home: StoredHome,
    turn_readings: TurnReadings,
    home: kept_home::HomeState,
    network: LiveNetwork,
    pub(super) touch: TouchProbes,
    pub(super) joint_encoder: JointEncoder,
    pub(super) motion: Motion,
    pub(super) enclosure: enclosure::Readings,
    lss: Lss,
    pub(super) lock: Lock,
    pub(super) scope: Scope,
    memory: Memory<F>,
    pub(super) base: JointBase,
    pub(super) program: program::ProgramState,
    pub(super) samples: Samples,
    /// Process data objects as a master has set them; reset with the communication.
    pdos: Pdos,
    adaptation: LevelLearner,
    /// Time at which the model is logged, us; `None` afterwards.
    model_log_us: Option<u64>,
}

impl<F: NorFlash> Device<F> {
    /// Returns the settings in use.
    pub const fn settings(&self) -> &NodeSettings {
        &self.base.settings
    }

    /// Returns the supervisor.
    pub const fn supervisor(&self) -> &Supervisor {
        &self.base.supervisor
    }

    /// Returns the counters of the bus side.
    pub const fn counters(&self) -> &Counters {
        &self.base.counters
    }

    /// Returns the parameters in use.
    pub fn set(&self) -> &ParameterSet {
        self.base.staging.active()
    }

    /// Returns the flash, for a simulated fault.
    pub fn flash_mut(&mut self) -> &mut F {
        self.memory.store.flash_mut()
    }

    /// Returns the flash by value, as a power cut leaves it.
    pub fn into_flash(self) -> F {
        self.memory.store.into_flash()
    }

    /// Returns true if the joint is armed, on its own sensors or in HIL.
    pub fn is_armed(&self) -> bool {
        self.base.is_armed()
    }

    /// Returns what the supervisor evaluates.
    fn observation(&self, heartbeat_lost: bool) -> Observation {
        let mut observation = self.base.observation(heartbeat_lost);
        // A joint in HIL has no bridge to supervise.
        if !self.base.settings.is_in_hil() {
            self.base.observe_report(&mut observation);
            observation.position_missing = self.motion.is_position_missing(&self.base);
            observation.following_error =
                self.motion.has_following_error(&self.base) || self.joint_encoder.are_sides_apart();
            observation.brake_test_failed = self.motion.brake_test.has_failed();
            observation.magnet_fault |= self.joint_encoder.has_warning();
            observation.enclosure = enclosure::assess(&self.enclosure, &self.set().sensors);
        }
        observation
    }

    /// Evaluates the last report: stops, supervisor, measurements and what is kept.
    fn evaluate(&mut self, heartbeat_lost: bool, now_us: u64) {
        self.base.now_us = now_us;
        self.step_turn_readings();
        let observation = self.observation(heartbeat_lost);
        self.base.supervisor.set_ramp_faults(self.motion.ramp_faults(&self.base));
        self.move_by(Motion::prepare_stops);
        self.move_by(Motion::watch_target);
        self.base.supervisor.observe(&observation, now_us);
        self.move_by(Motion::react_to_fault);
        let state = self.base.state();
        self.motion.profile.follow_joint(state);
        if state == JointState::Fault {
            self.scope.record_fault();
        }
        self.move_by(Motion::update_stop);
        self.move_by(Motion::watch_stop);
        self.move_by(Motion::watch_brake_test);
        self.move_by(Motion::step_brake);
        self.move_by(Motion::watch_commissioning);
        self.watch_trial(heartbeat_lost);
        self.watch_session();
        self.tick_program(now_us);
        self.record_trend();
        self.record_home();
        self.base.current_loop.mark_report_seen();
        if self.base.is_hil_armed && !self.hil_blocking_codes().is_empty() {
            // In HIL the supervisor is not armed and would not trip by itself.
            if heartbeat_lost {
                self.base.supervisor.trip(Code::HeartbeatLost);
            }
            self.disarm();
        }
    }

    /// Evaluates a report for over-compensation.
    fn step_over_compensation(&mut self) {
        let is_compensated = !self.base.settings.is_in_hil()
            && self.base.supervisor.is_compensation_allowed()
            && !self.motion.is_commissioning();
        let offset_nm = self.motion.mover(&self.base).is_torque().then(|| {
            // The other torque modes have no offset.
            let is_offset = self.motion.profile.mode == profile::CST;
            let offset_a = if is_offset { self.motion.offset_current_a(&self.base) } else { 0.0 };
            self.set().friction.compensator.torque_constant_nm_per_a * offset_a
        });
        let (report, set) = (self.base.current_loop.report(), self.base.staging.active());
        self.base.compensation.step(report, set, is_compensated, offset_nm);
    }

    /// Returns the commands for the current loop.
    pub fn loop_commands(&self, now_us: u64) -> LoopCommands {
        let drives = !self.base.settings.is_in_hil();
        let commands = self.base.loop_commands(now_us);
        let shorts = commands.brake
            || self.motion.stopping.shorts_low_sides && self.base.supervisor.is_braking_allowed();
        LoopCommands {
            setpoint: self.motion.setpoint(&self.base, now_us),
            bridge: drives && commands.bridge,
            brake: drives && shorts,
            compensation: drives
                && commands.compensation
                && !self.motion.is_commissioning()
                && !self.motion.brake_test.is_running(),
            probe: self.motion.commissioning.run.probe_command(),
            scope: self.scope.order(),
            ..commands
        }
    }

    /// Disarms the joint, for any source of inputs.
    #[inline(never)]
    pub(super) fn disarm(&mut self) {
        self.base.supervisor.disarm();
        self.motion.end();
        self.arm_hil(false);
    }
}

impl<F: NorFlash> Joint for Device<F> {
    type Flash = F;

    fn with_defaults(settings: NodeSettings, flash: F, identity: Identity, now_us: u64) -> Self {
        Self::unloaded(settings, flash, identity, now_us)
    }

    fn load(&mut self, boot: &Boot) {
        self.load_stored(boot);
    }

    fn equip(&mut self, equipment: Equipment) {
        self.sends_fd = equipment.sends_fd;
        if let Some(memory) = equipment.scope {
            self.scope = Scope::new(memory);
        }
        if let Some(seed) = equipment.seed {
            self.lock.seed(seed);
        }
    }

    fn flash(&self) -> &F {
        self.memory.store.flash()
    }

    fn base(&mut self) -> &mut JointBase {
        &mut self.base
    }

    /// Sets the time of a request, and ends a session that is over by then.
    fn set_time(&mut self, now_us: u64) {
        self.base.now_us = now_us;
        self.watch_session();
    }

    fn take_heartbeat(&mut self, now_us: u64) {
        self.confirm_target_by_heartbeat(now_us);
    }

    #[inline(never)]
    fn take_frame(&mut self, frame: &Frame, network: &Network, now_us: u64) -> Option<NmtAction> {
        if frame.identifier() == LSS_REQUEST {
            return self.configure(frame).then_some(NmtAction::ResetCommunication);
        }
        let is_operational = network.is_operational();
        let slot = self.receive_slot(frame.identifier());
        let is_plain_sync = frame.identifier() == cob_id::SYNC && frame.data().is_empty();
        if slot.is_some() || is_plain_sync {
            match slot {
                _ if !is_operational => self.base.counters.count_passed_over(),
                Some(slot) => self.take_pdo(slot, frame, now_us),
                None => self.take_sync(None, now_us),
            }
            return None;
        }
        match Message::parse(frame) {
            Ok(_) if !is_operational => self.base.counters.count_passed_over(),
            // The receive PDOs have been processed: other frames are those of other joints, or of a disabled PDO.
            Ok(Message::Sync(sync)) => self.take_sync(Some(sync.counter), now_us),
            Ok(_) => self.base.counters.count_foreign(),
            Err(error) => self.base.counters.count_error(&error),
        }
        None
    }

    fn receive_identifiers(&self, _node: NodeId) -> [u16; 6] {
        self.pdo_identifiers()
    }

    fn stop(&mut self, command: Option<NmtAction>, now_us: u64) {
        self.set_time(now_us);
        match command {
            Some(NmtAction::State(_)) => self.restart_pdos(),
            Some(NmtAction::Reset) => self.note_ordered_restart(),
            Some(NmtAction::ResetCommunication) | None => {}
        }
        self.stop_connection();
        if command == Some(NmtAction::ResetCommunication) {
            self.lock();
            self.reset_pdos();
        }
    }

    fn is_stopped(&self) -> bool {
        self.motion.has_stopped(&self.base)
    }

    fn take_board_state(&mut self, state: &BoardState) {
        self.base.take_board_state(state);
        self.enclosure = state.enclosure;
        self.turn_readings.words = state.biss;
        self.joint_encoder.words = state.joint_words;
        self.motion.commissioning.run.take_hall(state.hall);
    }

    fn report(&mut self, report: &LoopReport) {
        let is_testing = self.motion.brake_test.is_running();
        // A motor that presses against its brake stands.
        let drives = self.base.supervisor.is_bridge_allowed()
            && !self.motion.is_measuring_motor()
            && !is_testing;
        if !self.base.take_report(report, drives) {
            return;
        }
        self.restore_home();
        self.step_over_compensation();
        if self.adaptation.is_active() {
            self.step_adaptation();
        }
        self.step_commissioning();
        self.move_by(Motion::step_motion);
        self.step_touch_probes();
        self.step_joint_encoder();
        self.base.supervisor.record_overruns(report.overruns_in_a_row);
        if !self.base.settings.is_in_hil()
            && let Some(watch) = &mut self.base.watch
        {
            let valid = report.residual_torque_nm.is_finite() && !is_testing;
            watch.step(report.residual_torque_nm, report.velocity_rad_s, valid);
        }
    }

    fn take_scope_row(&mut self, row: &ScopeRow) {
        self.scope.take(row);
    }

    fn tick(&mut self, network: &Network, now_us: u64) -> bool {
        let awaited = self.base.settings.awaited_heartbeat;
        self.evaluate(network.is_heartbeat_missing(awaited, now_us), now_us);
        if network.is_operational() {
            self.transmit_events(now_us);
        }
        if self.model_log_us.is_some_and(|log_us| now_us >= log_us) {
            self.model_log_us = None;
            self.log_model();
        }
        self.program.is_restart_due(now_us)
    }

    #[inline(never)]
    fn loop_output(&mut self, sensors: &LocalReadings, now_us: u64) -> LoopOutput {
        let mut commands = self.loop_commands(now_us);
        sensors.apply_newer(&mut commands.covariates, now_us);
        self.base.seal_sensors.check(&mut commands.covariates, now_us);
        self.adaptation.take_covariates(&commands.covariates);
        commands.factors = self.supply(&commands.covariates, now_us);
        LoopOutput { commands, gains: Some(self.learnt()) }
    }

    fn board_output(&self) -> BoardOutput {
        BoardOutput {
            brake: self.motion.stopping.brake().output(&self.base.settings.drive),
            winding_rise_k: self.base.motor.watch.rise_k(),
            home: self.kept_home(),
        }
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        let joint_encoder = self.joint_encoder.state();
        self.base.next_emergency(joint_encoder)
    }
}
