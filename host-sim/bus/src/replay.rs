//! Replay: a recorded trace, played to a joint driver, every answer held against the core.
//!
//! ```text
//! log -> [plan]   what is sent, and when          bus -> driver
//!                     |                                    |
//!        [check]  the core, on the same frames  ==  Answer, Status, Telemetry
//!                     |
//!        [report] equal or not; lost, twice, late; lateness, jitter, round trip, load
//! ```
//!
//! The check is an equality of bits, not a tolerance: driver and core run the same code on the same
//! frames (see [`firmware::hil`]). [`setup`] brings the driver to where this holds: fed by the bus,
//! the trace's period, the same parameters, armed. [`mod@play`] keeps the time: as recorded, faster, or as fast
//! as the driver answers.

pub mod check;
mod in_process;
pub mod plan;
pub mod play;
pub mod real_time;
pub mod report;
pub mod setup;

pub use check::{Check, Tally};
pub use in_process::{InProcessError, in_process};
pub use plan::{Plan, PlanError};
pub use play::{Played, Rate, play};
pub use report::Report;
pub use setup::{Setup, SetupError, set_up};
