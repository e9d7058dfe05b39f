//! What the whole driver and the compact node have in common behind their node.
//!
//! [`JointBase`] is the state that both have: settings and parameters, the supervisor, the last report of the current loop with
//! its watches, the inputs from the bus, and the frames to send. Its methods are the steps that both make in the same way: the
//! start, a report, an observation, the commands for the loop, a commit. `objects.rs` has the objects that both serve.

use super::compensation_share::CompensationShare;
use super::current_loop::LoopExchange;
use super::history::History;
use super::seal_sensors::SealSensors;
use super::{BoardState, Boot, Identity};
use crate::control::PERIOD_S;
use crate::driver::counters::{Counters, count};
use crate::driver::loop_data::{LoopCommands, LoopReport};
use crate::driver::motor_watch::{MotorState, MotorWatch};
use crate::driver::received::{CommandSequence, ReceivedInputs};
use crate::driver::staging::Staging;
use crate::loop_parts::LoopParts;
use crate::node::dictionary::records::{InputsObject, MeasuredObject};
use crate::node::sdo::Abort;
use crate::node::{Emergency, Outbox};
use crate::node_settings::{InputSource, MAX_BLOCK_BYTES, NodeSettings};
use crate::parameter_set::ParameterSet;
use crate::start_values::StartRecord;
use crate::store::{LoadError, Store, StoreHealth};
use crate::supervisor::{
    CanState, Code, JointState, Observation, ParameterSource, Supervisor, SupervisorBoot,
};
use crate::watch::{ResidualWatch, WatchParameters};
use compensator_core::can::{Frame, Message, NodeId};
use compensator_core::parameters::Text;
use compensator_core::refusal;
use embedded_storage::nor_flash::NorFlash;

/// What a store held at the start.
pub(crate) struct LoadedBlock {
    /// Source of the parameters that are active now.
    pub parameters: ParameterSource,
    /// Settings beside them, also of a refused set; `None` if they are unknown.
    pub settings: Option<NodeSettings>,
    /// Sequence number of the block.
    pub sequence: u32,
}

/// A stored block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StoredBlock {
    /// The one that a start loads.
    Newest,
    /// The one that was saved before it.
    Former,
}

/// Reads the set of a stored block, and returns the settings beside it. `None` if there is no such block, or if it is not intact
/// or refused; the set is then undefined.
// Not inlined: the stack of the block is free again when the set is used.
#[inline(never)]
pub(crate) fn recall<F: NorFlash>(
    store: &mut Store<F>,
    from: StoredBlock,
    set: &mut ParameterSet,
) -> Option<NodeSettings> {
    let mut block = [0; MAX_BLOCK_BYTES];
    let loaded = match from {
        StoredBlock::Newest => store.load(&mut block),
        StoredBlock::Former => store.load_former(&mut block),
    };
    let (settings, parameters) = NodeSettings::split(block.get(..loaded.ok()?.length)?)?;
    set.read(parameters).ok()?;
    Some(settings)
}

/// Returns the first quantity with which a set may compensate more friction than the set in the flash, or than the defaults if
/// none is stored or readable.
// Not inlined: the stack of the stored set is free again afterwards.
#[inline(never)]
pub(crate) fn larger_than_stored<F: NorFlash>(
    store: &mut Store<F>,
    set: &ParameterSet,
) -> Option<Text> {
    let mut stored = ParameterSet::default();
    if recall(store, StoredBlock::Newest, &mut stored).is_none() {
        stored = ParameterSet::default();
    }
    set.larger_quantity(&stored)
}

/// The watch of the motor with its last result, and the wiring that was measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MotorObservation {
    pub watch: MotorWatch,
    pub state: MotorState,
    /// CRC of the wiring that the last complete measurement of the motor found.
    pub measured_wiring: Option<u32>,
}

/// State of every joint behind its node.
// Small parts first: the offset of a field in a load is limited, and each access beyond takes an instruction more.
#[derive(Debug)]
#[repr(C)]
pub struct JointBase {
    pub(crate) now_us: u64,
    pub(crate) settings: NodeSettings,
    /// Codes that refused the last request.
    pub(crate) blocking: u32,
    pub(crate) can: CanState,
    /// The joint is armed in HIL.
    pub(crate) is_hil_armed: bool,
    /// What the node keeps of its start.
    pub start: StartRecord,
    pub(crate) motor: MotorObservation,
    pub(crate) compensation: CompensationShare,
    pub(crate) watch: Option<ResidualWatch>,
    pub(crate) received: ReceivedInputs,
    /// Last inputs from process frames (2004h).
    pub(crate) inputs: InputsObject,
    pub(crate) current_loop: LoopExchange,
    pub(crate) counters: Counters,
    /// 1008h.
    pub(crate) name: &'static str,
    pub(crate) identity: Identity,
    pub(crate) history: History,
    pub(crate) seal_sensors: SealSensors,
    pub(crate) outbox: Outbox,
    /// The supervisor.
    pub supervisor: Supervisor,
    pub(crate) staging: Staging,
}

impl JointBase {
    /// Creates the state before anything is loaded.
    // Inlined into the value of its callers, which would be another 10 KB of stack.
    #[inline(always)]
    pub(crate) fn new(
        name: &'static str,
        settings: NodeSettings,
        identity: Identity,
        now_us: u64,
    ) -> Self {
        Self {
            now_us,
            settings,
            blocking: 0,
            can: CanState::Active,
            is_hil_armed: false,
            start: StartRecord::default(),
            motor: MotorObservation::default(),
            compensation: CompensationShare::default(),
            watch: None,
            received: ReceivedInputs::default(),
            // Inputs before any frame: every float is NaN.
            inputs: InputsObject::of([f32::NAN.to_bits(); InputsObject::ENTRIES.len()]),
            current_loop: LoopExchange::default(),
            counters: Counters::default(),
            name,
            identity,
            history: History::default(),
            seal_sensors: SealSensors::default(),
            outbox: Outbox::default(),
            supervisor: Supervisor::default(),
            staging: Staging::default(),
        }
    }

    /// Returns the parameters in use.
    pub(crate) fn set(&self) -> &ParameterSet {
        self.staging.active()
    }

    /// Returns the last report of the current loop.
    pub(crate) const fn report(&self) -> &LoopReport {
        self.current_loop.report()
    }

    /// Returns the state of the joint, which may be armed in HIL.
    #[inline(never)]
    pub(crate) fn state(&self) -> JointState {
        match self.supervisor.state() {
            JointState::Safe if self.is_hil_armed => JointState::Armed,
            state => state,
        }
    }

    /// Returns true if the joint is armed, on its own sensors or in HIL.
    // Not inlined, to reduce the size of the image, like all small functions below with this attribute.
    #[inline(never)]
    pub fn is_armed(&self) -> bool {
        self.supervisor.is_armed() || self.is_hil_armed
    }

    /// Returns true if the bridge is in use: parameters must not change.
    #[inline(never)]
    pub(crate) fn is_bridge_in_use(&self) -> bool {
        self.is_armed() || self.supervisor.is_stopping()
    }

    /// Returns what the joint measures, or receives in HIL.
    #[inline(never)]
    pub(crate) fn measured(&self) -> MeasuredObject {
        let (received, report) = (&self.inputs, self.report());
        match self.settings.source {
            InputSource::Bus => MeasuredObject {
                velocity_rad_s: received.velocity_rad_s,
                position_rad: received.position_rad,
                torque_nm: received.torque_nm,
                load_torque_nm: received.load_torque_nm,
            },
            InputSource::Sensors => MeasuredObject {
                velocity_rad_s: report.velocity_rad_s.to_bits(),
                position_rad: report.position_rad.to_bits(),
                torque_nm: report.motor_torque_nm.to_bits(),
                load_torque_nm: received.load_torque_nm,
            },
        }
    }

    pub(crate) fn is_commissioned(&self) -> bool {
        self.settings.commissioned == self.staging.wiring_crc()
    }

    /// Returns true if the motor was seen to turn by its current with the wiring in use.
    pub(crate) fn is_wiring_proven(&self) -> bool {
        self.settings.proven == self.staging.wiring_crc()
    }

    /// Loads settings and parameters from the newest block of a store. The default set stays active if no block is stored or if
    /// it is refused. The settings in use stay.
    // Not inlined: its stack is free again when the rest of the start needs as much.
    #[inline(never)]
    pub(crate) fn load_block<F: NorFlash>(&mut self, store: &mut Store<F>) -> LoadedBlock {
        let mut block = [0; MAX_BLOCK_BYTES];
        let unknown = |parameters| LoadedBlock { parameters, settings: None, sequence: 0 };
        let set = match store.load(&mut block) {
            Ok(set) => set,
            Err(LoadError::Empty | LoadError::Damaged) => return unknown(ParameterSource::Default),
            // A set of another firmware is stored.
            Err(LoadError::Foreign(_) | LoadError::TooSmall { .. }) => {
                return unknown(ParameterSource::DefaultRefused);
            }
        };
        let parts = block.get(..set.length).and_then(NodeSettings::split);
        let Some((settings, parameters)) = parts else {
            let why = refusal!("stored settings are of another version or out of range");
            self.refuse(Abort::Value, why);
            return unknown(ParameterSource::DefaultRefused);
        };
        let parameters = match self.staging.load(parameters) {
            Ok(()) => ParameterSource::Set,
            Err(error) => {
                self.refuse(Abort::Value, error);
                ParameterSource::DefaultRefused
            }
        };
        LoadedBlock { parameters, settings: Some(settings), sequence: set.sequence }
    }

    /// Starts the supervisor and the watches with the active set, and records how the previous run ended.
    pub(crate) fn start(&mut self, boot: &Boot, store: StoreHealth, parameters: ParameterSource) {
        let set = self.staging.active();
        self.start = StartRecord::of(set, self.settings.bus());
        self.supervisor.start(
            &set.thresholds,
            &SupervisorBoot {
                reset: boot.cause,
                panicked: boot.panic.is_some(),
                stack_overflowed: boot.stack_overflowed,
                store,
                parameters,
                commissioned: self.is_commissioned(),
                failed_self_test: boot.failed_self_test,
            },
        );
        self.motor.watch = MotorWatch::with_rise(boot.winding_rise_k);
        self.watch = self.watch_of(&self.settings);
        self.history.set_panic(boot.panic.unwrap_or_default());
    }

    /// Builds the watch of the active set with these settings; `None` if it cannot be built. If the samples are farther apart
    /// than `independent_s`, they are independent too.
    pub(crate) fn watch_of(&self, settings: &NodeSettings) -> Option<ResidualWatch> {
        let period_s = settings.sample_period_s();
        let written = self.staging.active().watch;
        let independent_s = written.independent_s.max(period_s);
        WatchParameters { independent_s, ..written }.build(period_s).ok()
    }

    pub(crate) fn take_board_state(&mut self, state: &BoardState) {
        self.counters.count_bus(state.receiver_overrun, self.can, state.can);
        self.can = state.can;
    }

    /// Takes a report, and evaluates the motor. `drives`: the bridge drives the motor. Returns false for a report that is
    /// repeated: a tick just before a report finds none, and the next one finds two, so that a step would be one too many.
    pub(crate) fn take_report(&mut self, report: &LoopReport, drives: bool) -> bool {
        self.current_loop.take_report(report);
        if report.is_repeated {
            return false;
        }
        let (motor, thresholds) = (&self.staging.active().motor, self.supervisor.thresholds());
        let proven = self.is_wiring_proven();
        let report = self.current_loop.report();
        self.motor.state = self.motor.watch.step(report, motor, thresholds, drives, proven);
        if self.motor.state.is_turning_unseen {
            self.current_loop.lose_home();
        }
        // A proof belongs to the wiring that turned the joint. It is stored with the next save.
        if self.motor.state.is_proven && !proven && self.start.is_in_use(self.staging.active()) {
            self.settings.proven = self.staging.wiring_crc();
        }
        true
    }

    /// Returns what the supervisor evaluates of every joint.
    pub(crate) fn observation(&self, heartbeat_lost: bool) -> Observation {
        Observation {
            can: self.can,
            heartbeat_lost,
            stack_intact: self.report().stack_intact,
            model_in_band: self.watch.as_ref().and_then(ResidualWatch::in_band),
            ..Observation::default()
        }
    }

    /// Completes an observation with what the last report and its watches show.
    pub(crate) fn observe_report(&self, observation: &mut Observation) {
        let (motor, compensation) = (&self.motor.state, &self.compensation);
        self.current_loop.observe(motor, compensation, &self.seal_sensors, observation);
    }

    /// Returns the commands for the loop of a joint that its master commands by torque.
    #[inline(always)]
    pub(crate) fn loop_commands(&self, now_us: u64) -> LoopCommands {
        let age_h = now_us as f32 * (1e-6 / 3600.0);
        LoopCommands {
            setpoint: self.received.setpoint(now_us),
            covariates: self.received.covariates(self.settings.campaign_h + age_h, now_us),
            bridge: self.supervisor.is_bridge_allowed(),
            brake: self.set().motor.brake_at_stop != 0.0 && self.supervisor.is_braking_allowed(),
            compensation: self.supervisor.is_compensation_allowed(),
            current_share: self.supervisor.current_share(),
            compensation_share: self.compensation.share(),
            set_number: self.current_loop.set_number,
            gate_resets: self.current_loop.gate_resets,
            home: self.current_loop.home(),
            ..LoopCommands::default()
        }
    }

    /// Returns the next code that was raised or cleared. Its details are the number of the code, the state of the encoder at the
    /// joint's side, and the number of the self-test that failed.
    pub(crate) fn next_emergency(&mut self, joint_encoder: u8) -> Option<Emergency> {
        let event = self.supervisor.take_event()?;
        let code = self.history.record_event(event);
        let is_test = event.code == Code::SelfTestFailed;
        let test = if is_test { self.supervisor.failed_self_test() } else { 0 };
        let detail = [event.code.number(), joint_encoder, test, 0, 0];
        Some(Emergency { code, register: self.error_register(), detail })
    }

    /// 1001h.
    pub(crate) fn error_register(&self) -> u8 {
        self.supervisor.faults().error_register() | self.supervisor.limits().error_register()
    }

    /// Keeps the words of an input frame for this node, and processes it. Any other message is counted as foreign, and false is
    /// returned.
    pub(crate) fn take_input(&mut self, message: &Message, frame: &Frame, node: NodeId) -> bool {
        let place = match message {
            Message::Motion(of, _) if *of == node => InputsObject::VELOCITY,
            Message::Torque(of, _) if *of == node => InputsObject::TORQUE,
            Message::Seal(of, _) if *of == node => InputsObject::RADIAL_FORCE,
            Message::Surroundings(of, _) if *of == node => InputsObject::TEMPERATURE,
            Message::Command(of, _) if *of == node => InputsObject::COMMAND_CURRENT,
            _ => {
                self.counters.count_foreign();
                return false;
            }
        };
        for (sub_index, word) in (place..).zip(frame.data().as_chunks::<4>().0) {
            let _ = self.inputs.set(sub_index, u32::from_le_bytes(*word));
        }
        self.process_input(message);
        true
    }

    /// Processes an input, which came as a frame or was written as an object.
    pub(crate) fn process_input(&mut self, message: &Message) {
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

    /// Arms the joint on its own sensors.
    pub(crate) fn arm(&mut self) -> Result<(), Abort> {
        self.check_start()?;
        self.supervisor.arm(self.now_us).map_err(|refusal| self.refuse_arming(refusal))
    }

    /// Clears the faults whose causes have ended.
    pub(crate) fn clear_faults(&mut self) -> Result<(), Abort> {
        self.supervisor.clear_faults().map_err(|left| {
            if !left.contains(Code::GateDriverFault) {
                return self.refuse_blocked(left);
            }
            // The gate driver may latch its fault until it has slept, and the bridge is off. The next request succeeds.
            self.current_loop.reset_gate_driver();
            self.blocking = left.fault_bits();
            let why = refusal!(
                "still present:{faults} (its driver was reset: ask again)",
                left.fault_bits()
            );
            self.refuse(Abort::State, why)
        })
    }

    /// Checks that the board can drive with the set in use, which needs no restart.
    pub(crate) fn check_start(&mut self) -> Result<(), Abort> {
        let checked = self.start.check(self.staging.active());
        checked.map_err(|why| self.refuse(Abort::State, why))
    }

    /// Sets the joint position, rad: known at rest at a stop, or from a sensor behind the gear.
    pub(crate) fn set_position(&mut self, position_rad: f32) -> Result<(), Abort> {
        if !position_rad.is_finite() {
            let why = refusal!("set_position_rad = {f32}: must be a finite number", position_rad);
            return Err(self.refuse(Abort::Value, why));
        }
        self.current_loop.set_home(position_rad);
        Ok(())
    }

    /// Gives the supervisor the thresholds of the staged set, if the loop can be built from the set. The loop receives the same
    /// parts after the commit.
    pub(crate) fn accept_staged(&mut self) -> Result<(), Abort> {
        let set = self.staging.staged();
        let built = LoopParts::build(set, self.identity.stage, PERIOD_S).map(drop);
        let accepted = built.and_then(|()| self.supervisor.configure(&set.thresholds));
        accepted.map_err(|error| self.refuse(Abort::Value, error))
    }

    /// Makes the staged set the active one, once it is accepted.
    pub(crate) fn activate_staged(&mut self) {
        self.staging.activate();
        self.supervisor.set_parameter_source(ParameterSource::Set);
    }

    /// Makes watches, wiring and current loop follow the set that became active.
    pub(crate) fn follow_set(&mut self) {
        // A proof belongs to the wiring that turned the joint.
        self.motor.watch.forget_travel();
        self.motor.state.is_proven = false;
        self.start.set_refused(None);
        self.watch = self.watch_of(&self.settings);
        self.compensation.reset();
        let is_commissioned = self.is_commissioned();
        self.supervisor.set_commissioned(is_commissioned);
        self.current_loop.take_set();
    }

    /// Confirms that the joint is wired as its parameters say; `seen` is the CRC of these wiring parameters.
    pub(crate) fn confirm_wiring(&mut self, seen: u32) -> Result<(), Abort> {
        self.staging.check_wiring(seen)?;
        self.settings.commissioned = seen;
        // A measurement turned the motor. Without it, the wiring may have been changed before the confirmation.
        let is_measured =
            self.motor.measured_wiring == Some(seen) && self.start.is_in_use(self.staging.active());
        self.settings.proven = if is_measured { seen } else { 0 };
        self.supervisor.set_commissioned(true);
        Ok(())
    }
}
