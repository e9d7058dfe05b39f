//! The list of the simulations of `host-sim simulate`. `lab/machines` adds others of the papers.
//!
//! A new machine or experiment needs a file with a [`Simulation`] and an entry in the list.

mod pool_tests;
mod underwater_joint;

use crate::simulation::Simulation;
use pool_tests::{IMPACT, LOW_SPEED, VELOCITY_TRACKING};
use underwater_joint::UNDERWATER_JOINT;

/// All simulations.
pub const SIMULATIONS: &[Simulation] = &[UNDERWATER_JOINT, VELOCITY_TRACKING, LOW_SPEED, IMPACT];
