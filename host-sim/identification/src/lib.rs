//! Friction models fitted to measured logs, and what they get wrong named.
//!
//! ```text
//! data -> fit (over compensator-core's own step) -> diagnose -> params
//! ```
//!
//! [`data`] reads logs by the contract; [`spec`] names a model; [`mod@fit`] fits it; [`mod@diagnose`] says what it
//! gets wrong, why, and what a better one gains; [`stochastic`] sets the published method beside that;
//! [`params`] writes the parameters as a driver reads them. Nothing here prints, plots or opens a bus.

pub mod data;
pub mod diagnose;
pub mod dual;
pub mod fit;
pub mod number;
pub mod params;
pub mod spec;
pub mod stochastic;
