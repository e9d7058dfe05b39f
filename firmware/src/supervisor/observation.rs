//! Inputs of the supervisor: the start conditions once, an observation every millisecond.

use super::SelfTest;
use crate::control::LoopFlags;
use crate::sensors::enclosure::Findings;
use crate::store::StoreHealth;
use compensator_core::Flags;

/// Why the processor started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResetCause {
    /// Power was applied.
    #[default]
    PowerOn,
    /// The supply fell below the level at which the processor is held in reset, and RAM kept its contents.
    BrownOut,
    /// The reset pin.
    Pin,
    /// The firmware requested it.
    Software,
    /// A watchdog.
    Watchdog,
    /// Another cause, or unknown.
    Unknown,
}

/// Source of the parameters in use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ParameterSource {
    /// Stored parameters, or parameters set since the start.
    #[default]
    Set,
    /// Defaults, because no parameters were ever saved.
    Default,
    /// Defaults, because the stored parameters are refused.
    DefaultRefused,
}

with_defaults! {
    /// Conditions at the start.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub struct SupervisorBoot {
        /// Why the processor started.
        pub reset: ResetCause,
        /// True if a panic ended the previous run.
        pub panicked: bool,
        /// True if the stack overflowed in the previous run.
        pub stack_overflowed: bool,
        /// Health of the parameter store.
        pub store: StoreHealth = StoreHealth::Sound,
        /// Source of the parameters in use.
        pub parameters: ParameterSource,
        /// True if the wiring of the joint is confirmed.
        pub commissioned: bool = true,
        /// First test of the board that failed.
        pub failed_self_test: Option<SelfTest>,
    }
    /// A start with nothing to report.
}

/// Error state of the CAN controller (ISO 11898-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CanState {
    /// Error active: normal operation.
    #[default]
    Active,
    /// Error passive: after many errors, the controller may not signal errors to other nodes.
    Passive,
    /// Bus-off: the controller has left the bus.
    Off,
}

with_defaults! {
    /// Measurements and states since the last observation.
    ///
    /// `None` marks a quantity that the board does not measure; it is not monitored. NaN marks a quantity that
    /// is measured but gave no valid value.
    #[derive(Clone, Copy, Debug)]
    pub struct Observation {
        /// Bus voltage, V.
        pub bus_voltage_v: Option<f32>,
        /// Latest phase currents, A.
        pub phase_currents_a: Option<[f32; 3]>,
        /// Latest torque-producing current, A.
        pub current_a: f32,
        /// Set-point of that current after all limits, A.
        pub current_setpoint_a: f32,
        /// Joint velocity, rad/s.
        pub velocity_rad_s: f32,
        /// Temperature of the bridge, deg C.
        pub bridge_temperature_c: Option<f32>,
        /// Temperature of the motor, deg C.
        pub motor_temperature_c: Option<f32>,
        /// Winding temperature from the thermal model, deg C.
        pub winding_temperature_c: Option<f32>,
        /// True if the induced voltage and the speed have opposite signs.
        pub motor_against: bool,
        /// True if the rotor turns while its encoder stands.
        pub turns_unseen: bool,
        /// True if the joint carries current, has not moved since it was armed, and its wiring is not proven.
        pub motor_stands: bool,
        /// True if the position is required and unknown, and the drive is not in homing mode.
        pub position_missing: bool,
        /// True if the position is too far from its demand for too long, or the two sides of the gear are too far apart.
        pub following_error: bool,
        /// True if the joint carries current and does not move, and it has moved or its wiring is proven.
        pub stalled: bool,
        /// True if the holding brake slipped in its last test, or could not be tested.
        pub brake_test_failed: bool,
        /// True if the model predicts more friction than the joint has, and the compensation is reduced.
        pub over_compensated: bool,
        /// True if the reading of the side-load sensor is stuck.
        pub radial_force_stuck: bool,
        /// True if the reading of the pressure sensor is stuck.
        pub pressure_stuck: bool,
        /// Age of the latest conversion, us.
        pub sample_age_us: Option<u32>,
        /// True if the gate driver reports a fault.
        pub gate_driver_fault: bool,
        /// True if the microcontroller opened the bridge by hardware.
        pub system_break: bool,
        /// True if an encoder reports a fault of its magnet or its signals.
        pub magnet_fault: bool,
        /// What is wrong with the dry side, and whether safe torque off is active.
        pub enclosure: Findings,
        /// True if the low sides are shorted, so that a current flows without being armed.
        pub bridge_shorted: bool,
        /// True if the guard words below the stack are intact.
        pub stack_intact: bool = true,
        /// Error state of the CAN controller.
        pub can: CanState,
        /// True if the monitored heartbeat is missing.
        pub heartbeat_lost: bool,
        /// All flags of the current loop since the last observation.
        pub loop_flags: LoopFlags,
        /// All flags of the compensator since the last observation.
        pub compensator: Flags,
        /// True if the residual is inside the band of the model; `None` if that is not known.
        pub model_in_band: Option<bool>,
    }
    /// Nothing is measured and nothing is wrong.
}
