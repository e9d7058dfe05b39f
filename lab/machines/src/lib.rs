//! The machines of two published papers: a banded friction damper and a manipulator with fluidic muscles.
//!
//! The papers' experiments are repeated on them, and `host-sim simulate` offers them. Like [`simulated_machines`], this
//! package does not depend on `compensator-core`: whatever evaluates a model is not built from it.

mod banded_damper;
pub mod manipulator;
mod simulations;

pub use simulations::SIMULATIONS;
