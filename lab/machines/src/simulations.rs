//! The list of the simulations that `host-sim simulate` adds to those of [`simulated_machines`].

mod damper;
mod joint_bench;
mod manipulator;

use damper::DAMPER;
use joint_bench::JOINT_BENCH;
use manipulator::MANIPULATOR;
use simulated_machines::Simulation;

/// All simulations.
pub const SIMULATIONS: &[Simulation] = &[DAMPER, JOINT_BENCH, MANIPULATOR];
