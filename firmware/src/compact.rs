//! A joint driver for chips whose flash or RAM is too small for [`crate::driver`].
//!
//! It has the current loop, the compensator, the supervisor, the process frames, the parameter set and its store. Each object
//! that it serves ([`is_compact`](crate::node::dictionary::is_compact)) has the index, type and meaning of the whole driver's,
//! so that the tools of a PC load, commit and save a set in the same way. It leaves out drive modes (CiA 402), program updates, access levels,
//! scope, HIL, adaptation, trials, commissioning measurements, CAN FD, LSS, mapping of PDOs, networks, holding brake, ramps
//! and the sensors of the dry side.
//!
//! ```text
//! frame -> receive -> network command · object -> staging, store, supervisor
//!                  -> Command, Seal, Surroundings <-> current loop
//!                  -> SYNC -> Motion, Torque, Answer, Status, Telemetry
//! tick  -> heartbeat, timeouts, supervisor -> emergencies
//! ```

mod device;
pub mod objects;
mod process;
mod requests;

use crate::joint_node::JointNode;

pub use device::Device;

/// A joint driver without the parts that a small chip has no room for.
pub type CompactNode<F> = JointNode<Device<F>>;
