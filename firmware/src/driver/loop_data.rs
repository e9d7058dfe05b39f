//! What the driver and its current loop exchange.
//!
//! The current loop runs in an interrupt and owns its state. The driver runs in the background and owns the bus.
//! They exchange whole values: [`LoopCommands`] to the loop once a millisecond, and a [`LoopReport`] back every
//! [`REPORT_PERIOD_S`]. Nothing is shared, so no value is read half-written. [`crate::loop_link`] has the queues.

use crate::control::probe::{ProbeCommand, ProbeReport};
use crate::control::{Covariates, LoopFlags, Setpoint};
use compensator_core::Flags;
use compensator_core::network::Factors;

/// Time between two reports of the current loop, s.
pub const REPORT_PERIOD_S: f32 = 1e-3;

/// Commands to the current loop, valid until the next ones.
#[derive(Clone, Copy, Debug)]
pub struct LoopCommands {
    /// Set-point of the joint.
    pub setpoint: Setpoint,
    /// Covariates: what is measured of the joint besides its encoder.
    pub covariates: Covariates,
    /// True if the bridge may be on.
    pub bridge: bool,
    /// True if the low sides may be shorted when the bridge stops.
    pub brake: bool,
    /// True if friction may be compensated.
    pub compensation: bool,
    /// Share of the current limit that the temperature permits, 0..=1.
    pub current_share: f32,
    /// Share of the compensation in use, 0..=1. It is less than 1 if the model was found to have more friction
    /// than the joint.
    pub compensation_share: f32,
    /// Factors of a network for the law's levels and stiffness; `None` for the law's constants.
    pub factors: Option<Factors<f32>>,
    /// Counts requests to put the gate driver to sleep, which clears a latched fault.
    pub gate_resets: u8,
    /// Counts parameter sets: when it changes, the loop receives the parts of the new set.
    pub set_number: u32,
    /// Home position that was set last.
    pub home: Home,
    /// Measurement of the motor: a voltage along a field replaces the current loop. It also ends with the age of
    /// the set-point.
    pub probe: Option<ProbeCommand>,
}

/// Position of the joint, set by a caller who knows it. An encoder on the motor gives the angle within a motor
/// turn only.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Home {
    /// Position at the time it was set, rad.
    pub position_rad: f32,
    /// Counts the calls that set it: when it changes, the joint is at this position now.
    pub number: u32,
}

/// Report of the current loop and its board since the last report.
#[derive(Clone, Copy, Debug)]
pub struct LoopReport {
    /// Bus voltage, V; `None` if it is not measured.
    pub bus_voltage_v: Option<f32>,
    /// Phase currents, A; `None` if they are not measured.
    pub phase_currents_a: Option<[f32; 3]>,
    /// Torque-producing current, A.
    pub current_a: f32,
    /// Current along the magnet, A; about 0 unless the bus voltage limits the current.
    pub current_d_a: f32,
    /// Reference of the torque-producing current, A.
    pub current_reference_a: f32,
    /// Voltage along q, V, in the motor's sign; 0 with the bridge open.
    pub voltage_q_v: f32,
    /// Joint velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Joint position, rad; NaN if whole turns are unknown.
    pub position_rad: f32,
    /// Joint position from an arbitrary zero, rad; valid as long as the encoder is.
    pub turned_rad: f32,
    /// Torque of the measured current at the joint, Nm.
    pub motor_torque_nm: f32,
    /// Friction torque of the model, Nm.
    pub friction_torque_nm: f32,
    /// Compensation current, A.
    pub feed_forward_current_a: f32,
    /// Residual torque that the model does not explain, Nm.
    pub residual_torque_nm: f32,
    /// Torque held by the model's deflected bristles, Nm.
    pub bristle_torque_nm: f32,
    /// All flags of the loop since the last report.
    pub loop_flags: LoopFlags,
    /// All flags of the compensator since the last report.
    pub flags: Flags,
    /// Temperature of the bridge, deg C; `None` if it is not measured.
    pub bridge_temperature_c: Option<f32>,
    /// Temperature of the motor, deg C; `None` if it is not measured.
    pub motor_temperature_c: Option<f32>,
    /// Age of the latest conversion, us.
    pub sample_age_us: Option<u32>,
    /// The gate driver reports a fault.
    pub gate_driver_fault: bool,
    /// The chip opened the bridge by itself: supply, clock, memory or processor.
    pub system_break: bool,
    /// The encoder reports that its magnet is too weak, too strong or misplaced.
    pub magnet_fault: bool,
    /// The low sides are shorted: the phase currents are those of the braking motor.
    pub bridge_shorted: bool,
    /// The guard below the stack is intact.
    pub stack_intact: bool,
    /// Maximum number of consecutive overruns since the last report.
    pub overruns_in_a_row: u32,
    /// Result of the last block of a motor measurement.
    pub probe: ProbeReport,
}

impl Default for LoopReport {
    /// Nothing is measured and there are no faults.
    fn default() -> Self {
        Self {
            bus_voltage_v: None,
            phase_currents_a: None,
            current_a: 0.0,
            current_d_a: 0.0,
            current_reference_a: 0.0,
            voltage_q_v: 0.0,
            velocity_rad_s: 0.0,
            position_rad: f32::NAN,
            turned_rad: 0.0,
            motor_torque_nm: f32::NAN,
            friction_torque_nm: 0.0,
            feed_forward_current_a: 0.0,
            residual_torque_nm: f32::NAN,
            bristle_torque_nm: 0.0,
            loop_flags: LoopFlags::empty(),
            flags: Flags::DISABLED,
            bridge_temperature_c: None,
            motor_temperature_c: None,
            sample_age_us: None,
            gate_driver_fault: false,
            system_break: false,
            magnet_fault: false,
            bridge_shorted: false,
            stack_intact: true,
            overruns_in_a_row: 0,
            probe: ProbeReport::default(),
        }
    }
}
