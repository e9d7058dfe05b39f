//! What can be simulated: one list, which `host-sim simulate` offers.
//!
//! A new machine, or a new experiment on one, is a file here with a [`Simulation`] and its line in the list.

mod damper;
mod manipulator;
mod pool_tests;
mod underwater_joint;

use crate::simulation::Simulation;
use damper::Damper;
use manipulator::Manipulator;
use pool_tests::{Impact, JointBench, LowSpeed, VelocityTracking};
use underwater_joint::UnderwaterJoint;

/// Every simulation there is.
pub const SIMULATIONS: &[&dyn Simulation] =
    &[&UnderwaterJoint, &VelocityTracking, &LowSpeed, &Impact, &JointBench, &Damper, &Manipulator];
