//! The joint driver between its bus and its current loop.
//!
//! A driver does all work that is not done in every period of the current loop. It processes frames, serves its
//! objects, keeps the parameters, supervises the joint and commands the current loop. Time is passed in with
//! every call, so that a PC runs the same code in virtual time. The boards and `host-sim node`
//! own a [`Driver`] each and add only hardware access.
//!
//! ```text
//! frame -> receive -> network command · object -> staging, store, supervisor
//!                  -> PDO, SYNC      -> HIL joint (source: bus)   -> Answer, Status, Telemetry
//!                                    -> received inputs (source: sensors) <-> current loop
//! tick  -> heartbeat, timeouts, supervisor -> emergencies
//! ```

pub mod angle;
pub mod commissioning;
pub(crate) mod counters;
pub(crate) mod device;
pub mod holding_brake;
mod home;
pub mod loop_data;
mod motion;
pub(crate) mod motor_watch;
pub(crate) mod objects;
pub mod over_compensation;
pub mod passivity;
pub mod profile;
pub mod received;
pub mod staging;
pub mod trajectory;
mod unseen_turning;

pub use crate::joint_node::{Boot, Identity};
pub use counters::Counters;
pub use device::Device;
pub use home::{KeptHome, MOVED_MAX_TURNS};
pub use loop_data::{
    Home, LoopCommands, LoopOutput, LoopReport, NumberedGains, REPORT_PERIOD_S, TouchEdges,
};
pub(crate) use loop_data::{PeriodValues, ReportStatus, ReportedAngle};

use crate::joint_node::JointNode;

/// A joint driver: the whole device on its bus.
pub type Driver<F> = JointNode<Device<F>>;
