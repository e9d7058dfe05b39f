//! Simulated machines: what judges a model must not be built from it.
//!
//! Nothing in here can see `compensator-core`: this package does not depend on it. The friction is the published differential equation in its
//! own state (bristle deflection `z` in rad), with the exact exponential, in double precision, by a
//! fourth-order Runge-Kutta step that is a hundredth of a log's sample. The core is another state,
//! another scheme, a table, and a step as long as the sample. Where the two agree it is not because they
//! are the same code.

mod banded_damper;
pub mod friction;
pub mod joint_plant;
pub mod log;
pub mod manipulator;
pub mod motion;
pub mod scenarios;
pub mod simulation;
pub mod simulations;
pub mod underwater_joint;

pub use log::{Log, LoggedRun};
pub use simulation::{Request, Simulated, Simulation};
pub use simulations::SIMULATIONS;
pub use underwater_joint::{Recording, Truth, record};
