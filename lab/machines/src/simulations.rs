//! The list of the simulations that `host-sim simulate` adds to those of [`simulated_machines`].

mod damper;
mod manipulator;

use damper::Damper;
use manipulator::Manipulator;
use simulated_machines::Simulation;

/// All simulations.
pub const SIMULATIONS: &[&dyn Simulation] = &[&Damper, &Manipulator];
