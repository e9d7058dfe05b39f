//! What one cycle of the current loop takes and gives.

use super::Bridge;
use super::flags::LoopFlags;
use super::transform::Rotating;
use compensator_core::Flags;

/// Set-point of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Motor current before compensation, A, positive towards positive joint position.
    pub current_a: f32,
    /// Reference velocity, rad/s; NaN if no reference is given.
    pub velocity_reference_rad_s: f32,
    /// Time since the set-point was confirmed, s: by its command frame, or by a target, a controlword, a heartbeat
    /// or an order of the master. 0 if it needs no confirmation; negative or NaN if it was never confirmed.
    pub age_s: f32,
}

impl Setpoint {
    /// No set-point was confirmed.
    pub const NONE: Self = Self { current_a: 0.0, velocity_reference_rad_s: f32::NAN, age_s: -1.0 };
}

/// Result of one current-loop cycle. All values are finite.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CycleResult {
    /// State of the bridge in the next period.
    pub bridge: Bridge,
    /// Current along the magnet, A.
    pub current_d_a: f32,
    /// Torque-producing current, A, in the joint's sign.
    pub current_q_a: f32,
    /// Reference of the torque-producing current, A, after compensation and limits.
    pub current_reference_a: f32,
    /// Reference of the current along the magnet, A; 0 unless it weakens the field or burns braking power.
    pub current_d_reference_a: f32,
    /// Applied voltage, V, in the motor's sign, without what compensates the dead time.
    pub voltage_v: Rotating,
    /// Bus voltage used for the duties, V; 0 if unknown.
    pub bus_v: f32,
    /// Joint position, rad; see [`LoopFlags::POSITION_UNREFERENCED`].
    pub position_rad: f32,
    /// Joint velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Joint acceleration, rad/s^2.
    pub acceleration_rad_s2: f32,
    /// Friction torque of the model, Nm, unscaled.
    pub friction_torque_nm: f32,
    /// Compensation current, A, cross-fade included.
    pub feed_forward_current_a: f32,
    /// Torque of the measured current at the joint, Nm.
    pub motor_torque_nm: f32,
    /// Residual, Nm: motor torque less inertia, load torque and friction. A load torque that was never received
    /// counts as 0.
    pub residual_torque_nm: f32,
    /// True if all parts of the residual were measured and the model was running.
    pub residual_valid: bool,
    /// Values that the loop replaced, limited or refused.
    pub flags: LoopFlags,
    /// Flags of the compensator.
    pub compensator: Flags,
}
