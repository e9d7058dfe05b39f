//! The device behind the object dictionary: state of a joint driver.

mod access;
mod adaptation;
mod boot;
mod commissioning;
pub(crate) mod compensation_share;
pub(crate) mod current_loop;
pub(crate) mod history;
mod inputs;
mod joint_encoder;
mod kept_home;
mod lss;
mod memory;
mod motion;
pub(crate) mod motor;
mod network;
mod parameter_trial;
mod pdos;
mod program;
mod requests;
mod scope;
pub(crate) mod seal_sensors;
mod stored_home;
mod terms;
mod touch_probe;
mod trend;
mod turn_readings;
pub(crate) mod values;

use super::counters::Counters;
use super::home::KeptHome;
use super::loop_data::{LoopCommands, LoopReport, REPORT_PERIOD_S};
use super::motion::Motion;
use super::received::ReceivedInputs;
use super::staging::Staging;
use crate::access::Lock;
use crate::control::Covariates;
use crate::level_learner::LevelLearner;
use crate::loop_parts::StageTraits;
use crate::node::Outbox;
use crate::node::dictionary::records;
use crate::node::lss::Lss;
use crate::node_settings::{InputSource, NodeSettings};
use crate::parameter_set::ParameterSet;
use crate::scope::Scope;
use crate::sensors::enclosure;
use crate::start_values::StartRecord;
use crate::supervisor::{
    CanState, Code, Event, JointState, Observation, ResetCause, SelfTest, Supervisor,
};
use crate::update::Program;
use crate::watch::{ResidualWatch, WatchParameters};
use compensation_share::CompensationShare;
use compensator_core::can::{Frame, Message, NodeId};
use current_loop::LoopExchange;
use embedded_storage::nor_flash::NorFlash;
use history::History;
use inputs::Samples;
use joint_encoder::JointEncoder;
use memory::Memory;
use motor::MotorObservation;
use network::LiveNetwork;
use parameter_trial::ParameterTrial;
use pdos::Pdos;
use seal_sensors::SealSensors;
use stored_home::StoredHome;
use touch_probe::TouchProbes;
use trend::StoredTrend;
use turn_readings::TurnReadings;

/// Maximum length of a stored panic text, bytes.
pub const MAX_PANIC_BYTES: usize = 160;

/// Identity of a driver.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// Name of the board.
    pub hardware: &'static str,
    /// Serial number of the board.
    pub serial: u32,
    /// Properties of its power stage, which limit the parameters.
    pub stage: StageTraits,
}

impl Identity {
    /// Returns the identity object of the dictionary.
    pub fn object(&self) -> records::IdentityObject {
        crate::update::recovery::identity(self.serial)
    }
}

/// State of the board at the start, and how the previous run ended.
#[derive(Clone, Copy, Debug)]
pub struct Boot<'a> {
    /// Cause of the reset.
    pub cause: ResetCause,
    /// Text of a panic before the reset.
    pub panic: Option<&'a str>,
    /// The guard below the stack was overwritten.
    pub stack_overflowed: bool,
    /// First of the board's start-up tests that failed.
    pub failed_self_test: Option<SelfTest>,
    /// Rise of the winding above the stator at the end of the previous run, K. `None` if the board has lost it, such as
    /// without power: the winding is then assumed to be hot.
    pub winding_rise_k: Option<f32>,
    /// Home that the previous run kept; `None` if the board has lost it, such as without power. The flash may have it then.
    pub home: Option<KeptHome>,
    /// Places of images and parameters, if the board has two banks. Otherwise the parameters use the whole flash, and
    /// there are no updates.
    pub program: Option<Program>,
}

impl Default for Boot<'_> {
    /// Power-on without faults, after a pause in which the winding has cooled.
    fn default() -> Self {
        Self {
            cause: ResetCause::PowerOn,
            panic: None,
            stack_overflowed: false,
            failed_self_test: None,
            winding_rise_k: Some(0.0),
            home: None,
            program: None,
        }
    }
}

/// All parts of a driver except its network state and its object server.
// Small parts first: the offset of a field in a load is limited, and each access beyond takes an instruction more.
#[derive(Debug)]
#[repr(C)]
pub struct Device<F> {
    now_us: u64,
    settings: NodeSettings,
    blocking: u32,
    /// The CAN controller of this board sends frames of CAN FD.
    pub(super) sends_fd: bool,
    can: CanState,
    trial: ParameterTrial,
    pub(super) start: StartRecord,
    trend: StoredTrend,
    stored_home: StoredHome,
    turn_readings: TurnReadings,
    home: kept_home::HomeState,
    network: LiveNetwork,
    motor: MotorObservation,
    compensation: CompensationShare,
    pub(super) touch: TouchProbes,
    pub(super) joint_encoder: JointEncoder,
    watch: Option<ResidualWatch>,
    pub(super) motion: Motion,
    received: ReceivedInputs,
    current_loop: LoopExchange,
    pub(super) counters: Counters,
    pub(super) enclosure: enclosure::Readings,
    pub(super) identity: Identity,
    pub(super) history: History,
    lss: Lss,
    pub(super) lock: Lock,
    pub(super) scope: Scope,
    seal_sensors: SealSensors,
    memory: Memory<F>,
    outbox: Outbox,
    supervisor: Supervisor,
    pub(super) staging: Staging,
    pub(super) program: program::ProgramState,
    pub(super) samples: Samples,
    /// Process data objects as a master has set them; reset with the communication.
    pdos: Pdos,
    adaptation: LevelLearner,
}

impl<F: NorFlash> Device<F> {
    pub(super) const fn settings(&self) -> &NodeSettings {
        &self.settings
    }

    pub(super) const fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    pub(super) fn set(&self) -> &ParameterSet {
        self.staging.active()
    }

    pub(super) fn outbox(&mut self) -> &mut Outbox {
        &mut self.outbox
    }

    pub(super) fn flash(&self) -> &F {
        self.memory.store().flash()
    }

    pub(super) fn flash_mut(&mut self) -> &mut F {
        self.memory.flash_mut()
    }

    pub(super) fn into_flash(self) -> F {
        self.memory.into_flash()
    }

    /// Returns true if the joint is armed, on its own sensors or in HIL.
    // Not inlined, to reduce the size of the image, like all small functions below with this attribute.
    #[inline(never)]
    pub(super) fn is_armed(&self) -> bool {
        self.supervisor.is_armed() || self.samples.is_hil_armed()
    }

    /// Sets the time of a request, and ends a session that is over by then.
    pub(super) fn set_time(&mut self, now_us: u64) {
        self.now_us = now_us;
        self.watch_session();
    }

    /// Runs the periodic work: see [`super::Driver::tick`].
    pub(super) fn tick(&mut self, heartbeat_lost: bool, now_us: u64) {
        self.now_us = now_us;
        let (report, motor) = (self.current_loop.report(), self.motor.state());
        let measures = self.settings.source == InputSource::Sensors;
        let in_band = self.watch.as_ref().and_then(ResidualWatch::in_band);
        let observation = if measures {
            Observation {
                bus_voltage_v: report.bus_voltage_v,
                phase_currents_a: report.phase_currents_a,
                current_a: report.current_a,
                current_setpoint_a: report.current_reference_a,
                velocity_rad_s: report.velocity_rad_s,
                bridge_temperature_c: report.bridge_temperature_c,
                motor_temperature_c: report.motor_temperature_c,
                winding_temperature_c: motor.winding_c,
                motor_against: motor.is_emf_reversed,
                turns_unseen: motor.is_turning_unseen,
                motor_stands: motor.is_blocked,
                position_missing: self.motion.is_position_missing(&self.seen()),
                following_error: self.motion.following_state(&self.seen()).1
                    || self.joint_encoder.are_sides_apart(),
                stalled: motor.is_stalled,
                brake_test_failed: self.motion.brake_test.has_failed(),
                over_compensated: self.compensation.is_over_compensated(),
                radial_force_stuck: self.seal_sensors.is_radial_force_stuck(),
                pressure_stuck: self.seal_sensors.is_pressure_stuck(),
                sample_age_us: report.sample_age_us,
                gate_driver_fault: report.gate_driver_fault,
                system_break: report.system_break,
                bridge_shorted: report.bridge_shorted,
                magnet_fault: report.magnet_fault || self.joint_encoder.has_warning(),
                enclosure: enclosure::assess(&self.enclosure, &self.set().sensors),
                stack_intact: report.stack_intact,
                can: self.can,
                heartbeat_lost,
                loop_flags: report.loop_flags,
                compensator: report.flags,
                model_in_band: in_band,
            }
        } else {
            // A joint in HIL has no bridge to supervise.
            Observation {
                stack_intact: report.stack_intact,
                can: self.can,
                heartbeat_lost,
                model_in_band: in_band,
                ..Observation::default()
            }
        };
        self.supervisor.set_ramp_faults(self.motion.ramp_faults(&self.seen()));
        self.move_by(Motion::prepare_stops);
        self.move_by(Motion::watch_target);
        self.supervisor.observe(&observation, now_us);
        self.move_by(Motion::react_to_fault);
        let (fault, armed) = (self.supervisor.state() == JointState::Fault, self.is_armed());
        self.motion.profile.sync_with_supervisor(fault, armed);
        if fault {
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
        self.current_loop.mark_report_seen();
        if self.samples.is_hil_armed() && !self.hil_blocking_codes().is_empty() {
            // In HIL the supervisor is not armed and would not trip by itself.
            if heartbeat_lost {
                self.supervisor.trip(Code::HeartbeatLost);
            }
            self.disarm();
        }
    }

    /// Processes a report of the current loop: see [`super::Driver::report`].
    pub(super) fn take_report(&mut self, report: &LoopReport) {
        self.current_loop.take_report(report);
        if report.is_repeated {
            // A tick just before a report finds none, and the next one finds two: a step here would be one too many.
            return;
        }
        let is_testing = self.motion.brake_test.is_running();
        // A motor that presses against its brake stands.
        let drives =
            self.supervisor.is_bridge_allowed() && !self.motion.is_measuring_motor() && !is_testing;
        let (motor, thresholds) = (&self.staging.active().motor, self.supervisor.thresholds());
        let proven = self.is_wiring_proven();
        self.motor.step(self.current_loop.report(), motor, thresholds, drives, proven);
        if self.motor.state().is_turning_unseen {
            self.current_loop.lose_home();
        }
        if self.motor.state().is_proven && !proven && self.start.is_in_use(self.staging.active()) {
            // Stored with the next save.
            self.settings.proven = self.staging.wiring_crc();
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
        self.supervisor.record_overruns(report.overruns_in_a_row);
        if self.settings.source == InputSource::Sensors
            && let Some(watch) = &mut self.watch
        {
            let valid = report.residual_torque_nm.is_finite() && !is_testing;
            watch.step(report.residual_torque_nm, report.velocity_rad_s, valid);
        }
    }

    pub(super) const fn winding_rise_k(&self) -> Option<f32> {
        self.motor.winding_rise_k()
    }

    /// Checks the sensors of side load and pressure: see [`super::Driver::check_seal_sensors`].
    pub(super) fn check_seal_sensors(&mut self, covariates: &mut Covariates, now_us: u64) {
        self.seal_sensors.check(covariates, now_us);
        self.adaptation.take_covariates(covariates);
    }

    pub(super) fn loop_commands(&self, now_us: u64) -> LoopCommands {
        let drives = self.settings.source == InputSource::Sensors;
        let age_h = now_us as f32 * (1e-6 / 3600.0);
        let (set_number, gate_resets, home) = self.current_loop.orders();
        LoopCommands {
            setpoint: self.motion.setpoint(&self.seen(), now_us),
            covariates: self.received.covariates(self.settings.campaign_h + age_h, now_us),
            bridge: drives && self.supervisor.is_bridge_allowed(),
            brake: drives
                && (self.set().motor.brake_at_stop != 0.0
                    || self.motion.stopping.shorts_low_sides())
                && self.supervisor.is_braking_allowed(),
            compensation: drives
                && self.supervisor.is_compensation_allowed()
                && !self.motion.is_commissioning()
                && !self.motion.brake_test.is_running(),
            current_share: self.supervisor.current_share(),
            compensation_share: self.compensation.share(),
            factors: None,
            set_number,
            gate_resets,
            home,
            probe: self.motion.probe(),
            scope: self.scope.order(),
        }
    }

    pub(super) fn bus_state(&mut self, receiver_overrun: bool, can: CanState) {
        self.counters.count_bus(receiver_overrun, self.can, can);
        self.can = can;
    }

    /// Sets the last readings of the dry side: see [`super::Driver::set_enclosure`].
    pub(super) const fn set_enclosure(&mut self, readings: enclosure::Readings) {
        self.enclosure = readings;
    }

    /// Disarms the joint, for any source of inputs.
    #[inline(never)]
    pub(super) fn disarm(&mut self) {
        self.supervisor.disarm();
        self.motion.end();
        self.samples.arm_hil(false);
    }

    /// Returns the next code that was raised or cleared, as an emergency: code, register, manufacturer field.
    pub(super) fn next_event(&mut self) -> Option<(u16, u8, [u8; 5])> {
        let event = self.supervisor.take_event()?;
        let code = self.history.record_event(event);
        let [number, test] = event_detail(&self.supervisor, event);
        Some((code, self.error_register(), [number, self.joint_encoder.state(), test, 0, 0]))
    }
}

/// Returns the number of the code of an event, and that of the failed self-test if it is its code.
pub(crate) fn event_detail(supervisor: &Supervisor, event: Event) -> [u8; 2] {
    let is_test = event.code == Code::SelfTestFailed;
    [event.code.number(), if is_test { supervisor.failed_self_test() } else { 0 }]
}

/// Builds a monitor with these parameters; `None` if it cannot be built. If the samples are farther apart than
/// `independent_s`, they are independent too.
pub(crate) fn watch(written: &WatchParameters, settings: &NodeSettings) -> Option<ResidualWatch> {
    let period_s = match settings.source {
        InputSource::Sensors => REPORT_PERIOD_S,
        InputSource::Bus => settings.period_s,
    };
    let independent_s = written.independent_s.max(period_s);
    WatchParameters { independent_s, ..*written }.build(period_s).ok()
}
