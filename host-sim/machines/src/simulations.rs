//! The list of the simulations of `host-sim simulate`. `lab/machines` adds those of two papers.
//!
//! A new machine or experiment needs a file with a [`Simulation`] and an entry in the list.

mod pool_tests;
mod underwater_joint;

use crate::simulation::Simulation;
use pool_tests::{Impact, JointBench, LowSpeed, VelocityTracking};
use underwater_joint::UnderwaterJoint;

/// All simulations.
pub const SIMULATIONS: &[&dyn Simulation] =
    &[&UnderwaterJoint, &VelocityTracking, &LowSpeed, &Impact, &JointBench];
