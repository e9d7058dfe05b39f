//! The machines of published papers: a banded friction damper, a manipulator with fluidic muscles, and the test stand of the
//! underwater joint.
//!
//! The papers' experiments are repeated on them, and `host-sim simulate` offers them. Like [`simulated_machines`], this
//! package does not depend on `compensator-core`: whatever evaluates a model is not built from it.

mod banded_damper;
pub mod bench;
pub mod manipulator;
mod simulations;

pub use simulations::SIMULATIONS;
