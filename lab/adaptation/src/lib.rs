//! Grades the adaptation of the core ([`compensator_core::adaptation`]) on simulated joints whose friction drifts, and on
//! inputs that lie.
//!
//! Plant, loops, compensator and adaptation run in one process, without the firmware. The plant has friction of a family
//! that the law was not built from, with this package's integrator. The driver sees an encoder and a current with noise.
//!
//! | module | contents |
//! |---|---|
//! | [`plant`], [`motion`] | the joint, and how it moves in service |
//! | [`encoder`], [`drive`] | what the driver sees, its loops and the aids against friction |
//! | [`joint`] | a drawn joint, its first campaign, and the gains that fit its true friction |
//! | [`drift`] | drifts, and the grade of each arm at several moments |
//! | [`lies`] | sensors and surroundings that lie |
//! | [`summary`] | figures beside their goals |

pub mod drift;
pub mod drive;
pub mod encoder;
mod error;
pub mod joint;
pub mod lies;
pub mod motion;
pub mod plant;
pub mod summary;

pub use error::GradeError;
