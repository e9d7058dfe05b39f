//! A healthy joint to which one cause at a time is added.

use compensator_core::Flags;
use firmware::control::LoopFlags;
use firmware::store::StoreHealth;
use firmware::supervisor::{
    CanState, Code, Event, Observation, ParameterSource, ResetCause, SelfTest, Supervisor,
    SupervisorBoot, Thresholds,
};

/// Time between two observations, us.
pub const STEP_US: u64 = 1000;

pub struct Bench {
    pub supervisor: Supervisor,
    pub observation: Observation,
    pub now_us: u64,
    /// True if a set-point arrives with every observation.
    pub has_commands: bool,
    /// Loop overruns before each observation.
    pub overruns: u32,
    pub events: Vec<Event>,
}

pub fn healthy_observation() -> Observation {
    Observation {
        bus_voltage_v: Some(48.0),
        phase_currents_a: Some([0.1, -0.05, -0.05]),
        bridge_temperature_c: Some(30.0),
        motor_temperature_c: Some(30.0),
        sample_age_us: Some(50),
        model_in_band: Some(true),
        ..Observation::default()
    }
}

impl Bench {
    pub fn boot(boot: &SupervisorBoot) -> Self {
        Self {
            supervisor: Supervisor::boot(&Thresholds::default(), boot),
            observation: healthy_observation(),
            now_us: 1_000_000,
            has_commands: true,
            overruns: 0,
            events: Vec::new(),
        }
    }

    pub fn armed() -> Self {
        let mut bench = Self::boot(&SupervisorBoot::default());
        bench.run(10 * STEP_US);
        bench.supervisor.arm(bench.now_us).unwrap();
        bench
    }

    /// Runs one observation.
    pub fn step(&mut self) {
        self.now_us += STEP_US;
        if self.has_commands {
            self.supervisor.record_command(self.now_us);
        }
        for _ in 0..self.overruns {
            self.supervisor.record_loop_overrun();
        }
        // A period without an overrun ends the row.
        if self.overruns < 3 {
            self.supervisor.record_loop_on_time();
        }
        self.supervisor.observe(&self.observation, self.now_us);
        self.events.extend(std::iter::from_fn(|| self.supervisor.take_event()));
    }

    /// Runs the observations of this time span.
    pub fn run(&mut self, time_us: u64) {
        (0..time_us / STEP_US).for_each(|_| self.step());
    }

    /// Sets or removes the cause of a code. Returns `None` if the cause lies in the previous run, which the boot report
    /// carries.
    pub fn set_cause(&mut self, code: Code, present: bool) -> Option<()> {
        let observation = &mut self.observation;
        if let Some(flag) = raising_loop_flag(code) {
            observation.loop_flags = if present { flag } else { LoopFlags::empty() };
            return Some(());
        }
        if let Some(flags) = raising_compensator_flags(code) {
            observation.compensator = if present { flags } else { Flags::empty() };
            return Some(());
        }
        match code {
            Code::WatchdogReset | Code::PanicBeforeReset => return None,
            Code::CommandTimeout => self.has_commands = !present,
            Code::LoopOverrun => self.overruns = if present { 3 } else { 0 },
            Code::LoopLate => self.overruns = u32::from(present),
            Code::HeartbeatLost => observation.heartbeat_lost = present,
            Code::CanBusOff => observation.can = can_state(present, CanState::Off),
            Code::CanErrorPassive => observation.can = can_state(present, CanState::Passive),
            Code::GateDriverFault => observation.gate_driver_fault = present,
            Code::SystemBreak => observation.system_break = present,
            Code::MotorAgainst => observation.motor_against = present,
            Code::MotorStands => observation.motor_stands = present,
            Code::Stalled => observation.stalled = present,
            Code::BrakeTestFailed => observation.brake_test_failed = present,
            Code::OverCompensated => observation.over_compensated = present,
            Code::RadialForceStuck => observation.radial_force_stuck = present,
            Code::PressureStuck => observation.pressure_stuck = present,
            Code::AdcTimeout => observation.sample_age_us = Some(if present { 1000 } else { 999 }),
            Code::EncoderMagnet => observation.magnet_fault = present,
            Code::FollowingError => observation.following_error = present,
            Code::PositionUnknown => observation.position_missing = present,
            Code::TorqueOff => observation.enclosure.is_torque_off = present,
            Code::TorqueOffChannels => observation.enclosure.do_channels_differ = present,
            Code::Leak => observation.enclosure.leak_stops = present,
            Code::LeakReported => observation.enclosure.leak_is_reported = present,
            Code::HousingHumid => observation.enclosure.is_humid = present,
            Code::HousingPressure => observation.enclosure.is_pressure_outside = present,
            Code::EnclosureUnknown => observation.enclosure.is_sensor_invalid = present,
            Code::StackOverflow => observation.stack_intact = !present,
            Code::ModelOutOfBand => observation.model_in_band = Some(!present),
            Code::SelfTestFailed => {
                self.supervisor.set_self_test_result(present.then_some(SelfTest::OffsetA));
            }
            Code::NotCommissioned => self.supervisor.set_commissioned(!present),
            Code::StoreDamaged => self.set_store_health(present, StoreHealth::Damaged),
            Code::StoreReduced => self.set_store_health(present, StoreHealth::Reduced),
            Code::ParametersDefault => {
                self.set_parameter_source(present, ParameterSource::Default);
            }
            Code::ParametersRefused => {
                self.set_parameter_source(present, ParameterSource::DefaultRefused);
            }
            _ => set_measured_cause(observation, code, present),
        }
        Some(())
    }

    fn set_store_health(&mut self, present: bool, health: StoreHealth) {
        self.supervisor.set_store_health(if present { health } else { StoreHealth::Sound });
    }

    fn set_parameter_source(&mut self, present: bool, source: ParameterSource) {
        self.supervisor.set_parameter_source(if present { source } else { ParameterSource::Set });
    }
}

fn can_state(present: bool, state: CanState) -> CanState {
    if present { state } else { CanState::Active }
}

/// Sets a measured quantity to the raise level of a code or to its clear level.
fn set_measured_cause(observation: &mut Observation, code: Code, present: bool) {
    let choose = |raised: f32, cleared: f32| if present { raised } else { cleared };
    match code {
        Code::Overcurrent => {
            observation.phase_currents_a = Some([choose(-40.0, 39.9), choose(20.0, -20.0), -20.0]);
            // The bridge is off once the cause is removed.
            if !present {
                *observation = healthy_observation();
            }
        }
        Code::CurrentSensorInvalid => {
            observation.phase_currents_a = Some([0.1, choose(f32::NAN, 0.0), -0.1]);
        }
        Code::CurrentOffset => observation.phase_currents_a = Some([choose(1.0, 0.5), 0.0, 0.0]),
        Code::PhaseLost => {
            observation.current_setpoint_a = choose(6.0, 0.0);
            observation.current_a = choose(2.0, 0.0);
            observation.phase_currents_a = Some([0.0, choose(2.0, 0.0), choose(-2.0, 0.0)]);
        }
        Code::BusOvervoltage => observation.bus_voltage_v = Some(choose(60.0, 56.0)),
        Code::BusUndervoltage => observation.bus_voltage_v = Some(choose(36.0, 40.0)),
        Code::BridgeOvertemperature => {
            observation.bridge_temperature_c = Some(choose(100.0, 95.0));
        }
        Code::MotorOvertemperature => observation.motor_temperature_c = Some(choose(120.0, 115.0)),
        Code::Overspeed => observation.velocity_rad_s = choose(-14.0, -12.5),
        Code::Derated => observation.motor_temperature_c = Some(choose(100.0, 95.0)),
        Code::TemperatureUnknown => {
            observation.bridge_temperature_c = Some(choose(f32::NAN, 30.0));
        }
        _ => panic!("{code:?} has no cause on this bench"),
    }
}

/// A flag of the current loop that raises the code, if a flag does.
fn raising_loop_flag(code: Code) -> Option<LoopFlags> {
    Some(match code {
        Code::EncoderLost => LoopFlags::ENCODER_LOST,
        Code::EncoderJump => LoopFlags::ENCODER_IMPLAUSIBLE,
        Code::Internal => LoopFlags::NOT_FINITE,
        Code::VoltageLimited => LoopFlags::VOLTAGE_LIMITED,
        Code::CurrentImbalance => LoopFlags::CURRENT_IMBALANCE,
        Code::BrakingLimited => LoopFlags::BRAKING_LIMITED,
        Code::EncoderCoasting => LoopFlags::ENCODER_COASTING,
        Code::SetpointInvalid => LoopFlags::SETPOINT_INVALID,
        _ => return None,
    })
}

/// The flags of the compensator that raise the code, if flags do.
fn raising_compensator_flags(code: Code) -> Option<Flags> {
    Some(match code {
        Code::ModelNotFinite => Flags::MODEL_NOT_FINITE,
        Code::VelocityInvalid => Flags::VELOCITY_INVALID | Flags::REFERENCE_INVALID,
        Code::CurrentLimited => Flags::CURRENT_LIMITED,
        Code::CompensationLimited => Flags::TORQUE_LIMITED,
        Code::CompensationSlewed => Flags::SLEW_LIMITED,
        Code::RadialForceStale => Flags::RADIAL_FORCE_STALE,
        Code::PressureStale => Flags::PRESSURE_INVALID,
        Code::TemperatureStale => Flags::TEMPERATURE_STALE,
        Code::OtherInputStale => Flags::LOAD_TORQUE_STALE,
        _ => return None,
    })
}

/// The boot report that raises a code, if there is one.
pub fn boot_with(code: Code) -> Option<SupervisorBoot> {
    let boot = SupervisorBoot::default();
    Some(match code {
        Code::WatchdogReset => SupervisorBoot { reset: ResetCause::Watchdog, ..boot },
        Code::PanicBeforeReset => SupervisorBoot { panicked: true, ..boot },
        Code::StackOverflow => SupervisorBoot { stack_overflowed: true, ..boot },
        Code::SelfTestFailed => {
            SupervisorBoot { failed_self_test: Some(SelfTest::OffsetB), ..boot }
        }
        Code::StoreDamaged => SupervisorBoot { store: StoreHealth::Damaged, ..boot },
        Code::StoreReduced => SupervisorBoot { store: StoreHealth::Reduced, ..boot },
        Code::ParametersDefault => SupervisorBoot { parameters: ParameterSource::Default, ..boot },
        Code::ParametersRefused => {
            SupervisorBoot { parameters: ParameterSource::DefaultRefused, ..boot }
        }
        _ => return None,
    })
}
