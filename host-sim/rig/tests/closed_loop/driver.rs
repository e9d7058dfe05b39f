//! The driver of the scenarios: the firmware's library. `tests/emulator` includes the scenarios with another one.

pub use joint_rig::{run_compact_from_power_up as compact_power_up, run_from_power_up as power_up};

/// Number of random motors in scenario 4.
pub const MOTORS: usize = 20;

/// Every fault of every kind of encoder is simulated.
pub const ALL_ENCODER_FAULTS: bool = true;

/// Number of sensors that are reported as stuck if side load and pressure on the bus are.
pub const STUCK_SENSORS: f64 = 2.0;
