//! The list of all simulations of `host-sim simulate`.
//!
//! A new machine or experiment needs a file with a [`Simulation`] and an entry in the list.

mod damper;
mod manipulator;
mod pool_tests;
mod underwater_joint;

use crate::simulation::Simulation;
use damper::Damper;
use manipulator::Manipulator;
use pool_tests::{Impact, JointBench, LowSpeed, VelocityTracking};
use underwater_joint::UnderwaterJoint;

/// All simulations.
pub const SIMULATIONS: &[&dyn Simulation] =
    &[&UnderwaterJoint, &VelocityTracking, &LowSpeed, &Impact, &JointBench, &Damper, &Manipulator];
