//! What the supervisor is told: once at the start, and once a millisecond.

use crate::control::LoopFlags;
use crate::store::Health;
use compensator_core::Flags;

/// Why the processor started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResetCause {
    /// Power came, or came back.
    #[default]
    PowerOn,
    /// The reset pin.
    Pin,
    /// The firmware asked for it.
    Software,
    /// A watchdog.
    Watchdog,
    /// None of these, or it was not found out.
    Unknown,
}

/// Which parameters are in use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InUse {
    /// Stored ones, or ones set since.
    #[default]
    Set,
    /// Default ones, because none were ever saved.
    Default,
    /// Default ones, because the stored ones are refused.
    DefaultRefused,
}

/// What is known at the start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Boot {
    /// Why the processor started.
    pub reset: ResetCause,
    /// A panic was noted before it did.
    pub panicked: bool,
    /// A stack overflow was noted before it did.
    pub stack_overflowed: bool,
    /// What the parameter store was found like.
    pub store: Health,
    /// Which parameters are in use.
    pub parameters: InUse,
    /// Somebody confirmed that the joint is wired as its parameters say.
    pub commissioned: bool,
    /// How the self-test ended.
    pub self_test_passed: bool,
}

impl Default for Boot {
    /// A start with nothing to report.
    fn default() -> Self {
        Self {
            reset: ResetCause::PowerOn,
            panicked: false,
            stack_overflowed: false,
            store: Health::Sound,
            parameters: InUse::Set,
            commissioned: true,
            self_test_passed: true,
        }
    }
}

/// How the CAN controller takes part in its bus (ISO 11898-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CanState {
    /// As it should.
    #[default]
    Active,
    /// It has seen so many errors that it may no longer show them to others.
    Passive,
    /// It has left.
    Off,
}

/// What was measured. `None` is a quantity this board does not measure and is never watched; one that
/// is measured but gave no number is NaN.
#[derive(Clone, Copy, Debug)]
pub struct Observation {
    /// Bus voltage, V.
    pub bus_voltage_v: Option<f32>,
    /// Phase currents, A: the latest.
    pub phase_currents_a: Option<[f32; 3]>,
    /// Torque-making current, A: the latest.
    pub current_a: f32,
    /// What it should be, A, after all limits.
    pub current_setpoint_a: f32,
    /// Joint velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Temperature of the bridge, deg C.
    pub bridge_temperature_c: Option<f32>,
    /// Temperature of the motor, deg C.
    pub motor_temperature_c: Option<f32>,
    /// Temperature of the copper by its model, deg C.
    pub winding_temperature_c: Option<f32>,
    /// The induced voltage has the other sign than the speed.
    pub motor_against: bool,
    /// The joint stands under current, and has not moved since it was armed.
    pub motor_stands: bool,
    /// It stands under current, and has moved.
    pub stalled: bool,
    /// The model has more friction than the joint, and less of it is compensated.
    pub over_compensated: bool,
    /// The sensor of side load no longer measures.
    pub radial_force_stuck: bool,
    /// The sensor of pressure no longer measures.
    pub pressure_stuck: bool,
    /// Age of the latest conversion, us.
    pub sample_age_us: Option<u32>,
    /// The gate driver reports a fault.
    pub gate_driver_fault: bool,
    /// The chip opened the bridge by itself.
    pub system_break: bool,
    /// The guard below the stack is as it was painted.
    pub stack_intact: bool,
    /// The CAN controller.
    pub can: CanState,
    /// A heartbeat that is awaited stays away.
    pub heartbeat_lost: bool,
    /// Every flag the current loop has shown since the last observation.
    pub loop_flags: LoopFlags,
    /// Every flag the compensator has shown since the last observation.
    pub compensator: Flags,
    /// Whether the residual is in the promised band; `None` while that is not known.
    pub model_in_band: Option<bool>,
}

impl Default for Observation {
    /// Nothing measured and nothing wrong.
    fn default() -> Self {
        Self {
            bus_voltage_v: None,
            phase_currents_a: None,
            current_a: 0.0,
            current_setpoint_a: 0.0,
            velocity_rad_s: 0.0,
            bridge_temperature_c: None,
            motor_temperature_c: None,
            winding_temperature_c: None,
            motor_against: false,
            motor_stands: false,
            stalled: false,
            over_compensated: false,
            radial_force_stuck: false,
            pressure_stuck: false,
            sample_age_us: None,
            gate_driver_fault: false,
            system_break: false,
            stack_intact: true,
            can: CanState::Active,
            heartbeat_lost: false,
            loop_flags: LoopFlags::empty(),
            compensator: Flags::empty(),
            model_in_band: None,
        }
    }
}
