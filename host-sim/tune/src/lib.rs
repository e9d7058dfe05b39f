//! Tunes a joint over the bus, and proves that it moves better.
//!
//! ```text
//! before     identity, limits, stop reactions, parameters         preflight
//! baseline   the motion of the trial with the former set           motion, master, recording, score
//! learn      motions that show what friction depends on            experiment, learn
//!            the response from current to velocity                 frequency
//! try        rounds of blocks with each set                       trial_set, session, gain, proof
//! save       on a proven gain; else the former set is back
//! ```
//! [`tune`] runs a session on any bus. The bus defines the time, so that a session in virtual time takes seconds. All moves go
//! through [`Master`], which the command `move` uses too.

pub mod driver_file;
pub mod experiment;
pub mod frequency;
pub mod gain;
pub mod learn;
pub mod master;
pub mod motion;
pub mod names;
mod perform;
pub mod preflight;
pub mod proof;
pub mod recording;
pub mod results;
pub mod score;
pub mod session;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;
pub mod trial_set;

pub use master::{Master, MasterError};
pub use motion::{Motion, MotionLimits};
pub use perform::{MoveOptions, Moved, perform};
pub use session::{Session, TuneError, TuneOptions, TuneUser, tune};
