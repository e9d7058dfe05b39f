//! Replay: a recorded trace is sent to a joint driver, and every answer is compared with the core.
//!
//! ```text
//! log -> [plan]   frames and their times          bus -> driver
//!                     |                                    |
//!        [check]  the core with the same frames ==  Answer, Status, Telemetry
//!                     |
//!        [report] equality; lost, duplicated, late; lateness, jitter, round trip, load
//! ```
//!
//! The check requires equal bits, because driver and core run the same code on the same frames (see [`firmware::hil`]).
//! That includes a driver that adapts its levels: the frames hold the measured torque, from which both learn the same gains.
//! [`setup`] prepares the driver: inputs from the bus, the period of the trace, the same parameters, armed. [`mod@play`]
//! keeps the time: as recorded, at a multiple of it, or as fast as the driver answers.

pub mod check;
mod core_joint;
mod in_process;
pub mod plan;
pub mod play;
pub mod real_time;
pub mod report;
pub mod setup;

pub use check::{Check, Tally};
pub use core_joint::CoreJoint;
pub use in_process::in_process;
pub use plan::{Plan, PlanError};
pub use play::{PlayResult, Rate, play};
pub use report::ReplayReport;
pub use setup::{ReplaySetup, SetupError, set_up};
