//! Simulated machines for independent tests of the friction models.
//!
//! This package does not depend on `compensator-core`, so an agreement of both is not due to shared code. The friction
//! is the published differential equation. Its state is the bristle deflection `z` in rad. It uses the exact
//! exponential, double precision, and fourth-order Runge-Kutta steps of a hundredth of a log's sample period. The core
//! uses another state, another integration scheme, a table, and steps of a whole sample period.

pub mod friction;
pub mod joint_plant;
pub mod log;
pub mod motion;
pub mod scenarios;
pub mod simulation;
pub mod simulations;
pub mod two_sided_joint;
pub mod underwater_joint;

pub use log::{Log, LoggedRun};
pub use simulation::{Request, Simulated, Simulation};
pub use simulations::SIMULATIONS;
pub use underwater_joint::{Recording, Truth, record};
