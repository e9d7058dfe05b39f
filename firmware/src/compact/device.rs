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
use crate::driver::{Boot, Identity, LoopCommands, LoopReport};
use crate::node::Outbox;
use crate::node::dictionary::records::InputsObject;
use crate::node::sdo::Abort;
use crate::node_settings::{InputSource, MAX_BLOCK_BYTES, NodeSettings, split_block};
use crate::scope::ScopeOrder;
use crate::start_values::StartRecord;
use crate::store::{LoadError, Store};
use crate::supervisor::{CanState, Observation, ParameterSource, Supervisor, SupervisorBoot};
use crate::watch::ResidualWatch;
use compensator_core::can::{NodeId, SampleAssembler, SyncFrame};
use embedded_storage::nor_flash::NorFlash;

/// Number of frames at a SYNC.
pub(super) const SYNC_FRAMES: usize = 5;

/// All parts of a compact node except its network state and its object server.
#[derive(Debug)]
pub(super) struct Device<F> {
    pub now_us: u64,
    pub settings: NodeSettings,
    /// Codes that refused the last request.
    pub blocking: u32,
    pub can: CanState,
    pub motor: MotorObservation,
    pub compensation: CompensationShare,
    pub watch: Option<ResidualWatch>,
    pub received: ReceivedInputs,
    pub inputs: InputsObject,
    /// Kind of the joint in a trace.
    pub joint_kind: u32,
    pub samples: SampleAssembler,
    /// Counter of the last SYNC, in the ring of those that have one.
    pub sync_counter: u8,
    /// Each frame of a sample is sent at every n-th SYNC; 0: as by default.
    pub sync_types: [u8; SYNC_FRAMES],
    /// SYNCs since each frame was sent.
    pub syncs: [u8; SYNC_FRAMES],
    pub current_loop: LoopExchange,
    pub counters: Counters,
    pub identity: Identity,
    pub history: History,
    pub seal_sensors: SealSensors,
    pub store: Store<F>,
    pub outbox: Outbox,
    pub supervisor: Supervisor,
    pub staging: Staging,
    pub start: StartRecord,
}

impl<F: NorFlash> Device<F> {
    pub fn with_defaults(
        settings: NodeSettings,
        flash: F,
        identity: Identity,
        now_us: u64,
    ) -> Self {
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

    /// Loads settings and parameters from the store and records how the previous run ended.
    #[inline(never)]
    pub fn load(&mut self, boot: &Boot) {
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
    pub fn restart_communication(&mut self) {
        self.samples = SampleAssembler::new(self.node());
        self.sync_types = [0; SYNC_FRAMES];
        self.syncs = [0; SYNC_FRAMES];
    }

    /// Starts the watch of the model with the parameters in use.
    pub fn restart_watch(&mut self) {
        self.watch = watch(&self.staging.active().watch, &self.settings);
    }

    /// Returns the node number of the settings.
    pub const fn node(&self) -> NodeId {
        self.settings.node
    }

    pub fn disarm(&mut self) {
        self.supervisor.disarm();
    }

    /// Returns true if the bridge drives the motor.
    pub fn is_bridge_in_use(&self) -> bool {
        self.supervisor.is_bridge_allowed()
    }

    pub fn bus_state(&mut self, receiver_overrun: bool, can: CanState) {
        self.counters.count_bus(receiver_overrun, self.can, can);
        self.can = can;
    }

    /// Processes a report of the current loop.
    pub fn take_report(&mut self, report: &LoopReport) {
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

    /// Evaluates the last report.
    pub fn tick(&mut self, heartbeat_lost: bool, now_us: u64) {
        self.now_us = now_us;
        let (report, motor) = (self.current_loop.report(), self.motor.state());
        let is_position_needed = self.supervisor.thresholds().position_required != 0;
        let observation = Observation {
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
            position_missing: is_position_needed && report.position_rad.is_nan(),
            stalled: motor.is_stalled,
            over_compensated: self.compensation.is_over_compensated(),
            radial_force_stuck: self.seal_sensors.is_radial_force_stuck(),
            pressure_stuck: self.seal_sensors.is_pressure_stuck(),
            sample_age_us: report.sample_age_us,
            gate_driver_fault: report.gate_driver_fault,
            system_break: report.system_break,
            bridge_shorted: report.bridge_shorted,
            magnet_fault: report.magnet_fault,
            stack_intact: report.stack_intact,
            can: self.can,
            heartbeat_lost,
            loop_flags: report.loop_flags,
            compensator: report.flags,
            model_in_band: self.watch.as_ref().and_then(ResidualWatch::in_band),
            ..Observation::default()
        };
        self.supervisor.observe(&observation, now_us);
        self.current_loop.mark_report_seen();
    }

    pub fn loop_commands(&self, now_us: u64) -> LoopCommands {
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

    /// Returns the next code that was raised or cleared, as an emergency: code, register, manufacturer field.
    pub fn next_event(&mut self) -> Option<(u16, u8, [u8; 5])> {
        let event = self.supervisor.take_event()?;
        let code = self.history.record_event(event);
        let [number, test] = event_detail(&self.supervisor, event);
        Some((code, self.error_register(), [number, 0, test, 0, 0]))
    }

    pub fn error_register(&self) -> u8 {
        self.supervisor.faults().error_register() | self.supervisor.limits().error_register()
    }

    pub fn is_commissioned(&self) -> bool {
        self.settings.commissioned == self.staging.wiring_crc()
    }
}
