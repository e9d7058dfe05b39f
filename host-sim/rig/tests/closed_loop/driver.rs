//! The driver of the scenarios: the firmware's library. `tests/emulator` includes the scenarios with another one.

pub use joint_rig::run_from_power_up as power_up;

/// Number of random motors in scenario 4.
pub const MOTORS: usize = 20;

/// Returns true if scenario 14 runs with this stiffness of the coupling, Nm/rad (0: rigid), and share of the friction.
pub const fn has_model_error(_stiffness: f64, _level: f32) -> bool {
    true
}
