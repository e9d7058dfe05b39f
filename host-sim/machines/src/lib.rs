//! Simulated machines for independent tests of the friction models.
//!
//! This package does not depend on `compensator-core`, so an agreement of both is not due to shared code. There are two kinds
//! of joint, in double precision and with integrators of their own:
//!
//! - [`scenarios`] impose the motion of a seal with the published friction. Its state is the bristle deflection `z` in rad,
//!   and the travel is the independent variable. The core uses another state, a table, and steps of a sample period.
//! - [`joint_plant`] is driven by a motor with its current loop, and has friction of another family. It hides the same effects
//!   but a delayed channel, a level that follows the load, and those outside the catalogue.

pub mod conditions;
pub mod effects;
pub mod friction;
pub mod imposed;
pub mod joint;
pub mod joint_plant;
pub mod log;
pub mod motion;
pub mod outside;
pub mod sampler;
pub mod sampling;
pub mod scenarios;
pub mod simulation;
pub mod simulations;
pub mod underwater_joint;

pub use log::{Log, LoggedRun};
pub use simulation::{Request, Simulated, Simulation, SimulationError};
pub use simulations::SIMULATIONS;
pub use underwater_joint::{Recording, Truth, record};

#[cfg(test)]
use friction::Seal;
#[cfg(test)]
#[path = "../../../tests/seal_equation.rs"]
mod seal_equation;
