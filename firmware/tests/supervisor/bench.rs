//! A joint that is well, to be spoiled in one way at a time.

use compensator_core::Flags;
use firmware::control::LoopFlags;
use firmware::store::Health;
use firmware::supervisor::{
    Boot, CanState, Code, Event, InUse, Observation, ResetCause, Supervisor, Thresholds,
};

/// Time between two observations, us.
pub const STEP_US: u64 = 1000;

pub struct Bench {
    pub supervisor: Supervisor,
    pub seen: Observation,
    pub now_us: u64,
    /// Set-points come with every observation.
    pub commanded: bool,
    /// Periods that were too short, before each observation.
    pub overruns: u32,
    pub events: Vec<Event>,
}

pub fn well() -> Observation {
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
    pub fn boot(boot: &Boot) -> Self {
        Self {
            supervisor: Supervisor::boot(&Thresholds::default(), boot),
            seen: well(),
            now_us: 1_000_000,
            commanded: true,
            overruns: 0,
            events: Vec::new(),
        }
    }

    pub fn armed() -> Self {
        let mut bench = Self::boot(&Boot::default());
        bench.run(10 * STEP_US);
        bench.supervisor.arm(bench.now_us).unwrap();
        bench
    }

    /// One observation.
    pub fn step(&mut self) {
        self.now_us += STEP_US;
        if self.commanded {
            self.supervisor.command_received(self.now_us);
        }
        for _ in 0..self.overruns {
            self.supervisor.loop_overrun();
        }
        // A row ends with a period that was long enough.
        if self.overruns < 3 {
            self.supervisor.loop_on_time();
        }
        self.supervisor.observe(&self.seen, self.now_us);
        self.events.extend(std::iter::from_fn(|| self.supervisor.take_event()));
    }

    /// As many observations as are in this time.
    pub fn run(&mut self, time_us: u64) {
        (0..time_us / STEP_US).for_each(|_| self.step());
    }

    /// Spoils the joint with the cause of a code; `false` mends it. `None` where the cause is what the
    /// last life ended with, which the boot tells.
    pub fn spoil(&mut self, code: Code, bad: bool) -> Option<()> {
        let choose = |ill: f32, well: f32| if bad { ill } else { well };
        let loop_flag = |flags: LoopFlags| if bad { flags } else { LoopFlags::empty() };
        let flag = |flags: Flags| if bad { flags } else { Flags::empty() };
        let seen = &mut self.seen;
        match code {
            Code::CommandTimeout => self.commanded = !bad,
            Code::HeartbeatLost => seen.heartbeat_lost = bad,
            Code::CanBusOff => seen.can = if bad { CanState::Off } else { CanState::Active },
            Code::Overcurrent => {
                seen.phase_currents_a = Some([choose(-40.0, 39.9), choose(20.0, -20.0), -20.0]);
                // The bridge is off when it is mended.
                if !bad {
                    *seen = well();
                }
            }
            Code::CurrentSensorInvalid => {
                seen.phase_currents_a = Some([0.1, choose(f32::NAN, 0.0), -0.1]);
            }
            Code::CurrentOffset => seen.phase_currents_a = Some([choose(1.0, 0.5), 0.0, 0.0]),
            Code::PhaseLost => {
                seen.current_setpoint_a = choose(6.0, 0.0);
                seen.current_a = choose(2.0, 0.0);
                seen.phase_currents_a = Some([0.0, choose(2.0, 0.0), choose(-2.0, 0.0)]);
            }
            Code::BusOvervoltage => seen.bus_voltage_v = Some(choose(60.0, 56.0)),
            Code::BusUndervoltage => seen.bus_voltage_v = Some(choose(36.0, 40.0)),
            Code::GateDriverFault => seen.gate_driver_fault = bad,
            Code::SystemBreak => seen.system_break = bad,
            Code::BridgeOvertemperature => seen.bridge_temperature_c = Some(choose(100.0, 95.0)),
            Code::MotorOvertemperature => seen.motor_temperature_c = Some(choose(120.0, 115.0)),
            Code::MotorAgainst => seen.motor_against = bad,
            Code::MotorStands => seen.motor_stands = bad,
            Code::Stalled => seen.stalled = bad,
            Code::OverCompensated => seen.over_compensated = bad,
            Code::RadialForceStuck => seen.radial_force_stuck = bad,
            Code::PressureStuck => seen.pressure_stuck = bad,
            Code::EncoderLost => seen.loop_flags = loop_flag(LoopFlags::ENCODER_LOST),
            Code::EncoderJump => seen.loop_flags = loop_flag(LoopFlags::ENCODER_IMPLAUSIBLE),
            Code::AdcTimeout => seen.sample_age_us = Some(if bad { 1000 } else { 999 }),
            Code::Overspeed => seen.velocity_rad_s = choose(-14.0, -12.5),
            Code::LoopOverrun => self.overruns = if bad { 3 } else { 0 },
            Code::ModelNotFinite => seen.compensator = flag(Flags::MODEL_NOT_FINITE),
            Code::StoreDamaged => {
                self.supervisor.store(if bad { Health::Damaged } else { Health::Sound });
            }
            Code::SelfTestFailed => self.supervisor.self_test(!bad),
            Code::NotCommissioned => self.supervisor.commissioned(!bad),
            Code::StackOverflow => seen.stack_intact = !bad,
            Code::Internal => seen.loop_flags = loop_flag(LoopFlags::NOT_FINITE),
            Code::WatchdogReset | Code::PanicBeforeReset => return None,
            Code::LoopLate => self.overruns = u32::from(bad),
            Code::ParametersDefault => {
                self.supervisor.parameters(if bad { InUse::Default } else { InUse::Set });
            }
            Code::ParametersRefused => {
                self.supervisor.parameters(if bad { InUse::DefaultRefused } else { InUse::Set });
            }
            Code::VelocityInvalid => {
                seen.compensator = flag(Flags::VELOCITY_INVALID | Flags::REFERENCE_INVALID);
            }
            Code::StoreReduced => {
                self.supervisor.store(if bad { Health::Reduced } else { Health::Sound });
            }
            Code::CanErrorPassive => {
                seen.can = if bad { CanState::Passive } else { CanState::Active };
            }
            Code::VoltageLimited => seen.loop_flags = loop_flag(LoopFlags::VOLTAGE_LIMITED),
            Code::CurrentLimited => seen.compensator = flag(Flags::CURRENT_LIMITED),
            Code::CurrentImbalance => seen.loop_flags = loop_flag(LoopFlags::CURRENT_IMBALANCE),
            Code::Derated => seen.motor_temperature_c = Some(choose(100.0, 95.0)),
            Code::TemperatureUnknown => seen.bridge_temperature_c = Some(choose(f32::NAN, 30.0)),
            Code::EncoderCoasting => seen.loop_flags = loop_flag(LoopFlags::ENCODER_COASTING),
            Code::SetpointInvalid => seen.loop_flags = loop_flag(LoopFlags::SETPOINT_INVALID),
            Code::CompensationLimited => seen.compensator = flag(Flags::TORQUE_LIMITED),
            Code::CompensationSlewed => seen.compensator = flag(Flags::SLEW_LIMITED),
            Code::RadialForceStale => seen.compensator = flag(Flags::RADIAL_FORCE_STALE),
            Code::PressureStale => seen.compensator = flag(Flags::PRESSURE_INVALID),
            Code::TemperatureStale => seen.compensator = flag(Flags::TEMPERATURE_STALE),
            Code::OtherInputStale => seen.compensator = flag(Flags::LOAD_TORQUE_STALE),
            Code::ModelOutOfBand => seen.model_in_band = Some(!bad),
        }
        Some(())
    }
}

/// What a boot tells that raises a code.
pub fn boot_with(code: Code) -> Option<Boot> {
    let boot = Boot::default();
    Some(match code {
        Code::WatchdogReset => Boot { reset: ResetCause::Watchdog, ..boot },
        Code::PanicBeforeReset => Boot { panicked: true, ..boot },
        Code::StackOverflow => Boot { stack_overflowed: true, ..boot },
        Code::SelfTestFailed => Boot { self_test_passed: false, ..boot },
        Code::StoreDamaged => Boot { store: Health::Damaged, ..boot },
        Code::StoreReduced => Boot { store: Health::Reduced, ..boot },
        Code::ParametersDefault => Boot { parameters: InUse::Default, ..boot },
        Code::ParametersRefused => Boot { parameters: InUse::DefaultRefused, ..boot },
        _ => return None,
    })
}
