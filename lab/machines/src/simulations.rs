//! The list of the simulations that `host-sim simulate` adds to those of [`simulated_machines`].

mod damper;
mod manipulator;

use damper::DAMPER;
use manipulator::MANIPULATOR;
use simulated_machines::Simulation;

/// All simulations.
pub const SIMULATIONS: &[Simulation] = &[DAMPER, MANIPULATOR];
