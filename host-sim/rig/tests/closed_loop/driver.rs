//! The driver of the scenarios: the firmware's library. `tests/emulator` includes the scenarios with another one.

pub use joint_rig::run_from_power_up as power_up;
