//! Fitting a model to measured runs.
//!
//! ```text
//! Dataset -> tracks (unbroken stretches, as the core's samples)      track
//!         -> core model stepped along each, with derivatives         simulate
//!            (what a track at rest holds is solved for on the way: rest)
//!         -> residual and Jacobian, reduced to a small triangle      triangle
//!         -> bounded Levenberg-Marquardt from several starts         coordinates, start, solve
//!         -> parameters, errors, verdicts, metrics                   statistics, outcome
//! ```
//!
//! The simulation is the core's step, so what is identified is what is flashed. Derivatives are exact
//! ([`crate::dual`]). Bounds are kept by coordinates that cannot leave them.

pub mod coordinates;
pub mod metrics;
pub mod outcome;
pub mod rest;
pub mod simulate;
pub mod solve;
pub mod start;
pub mod statistics;
pub mod track;
pub mod triangle;
mod verdict;

pub use metrics::Metrics;
pub use outcome::{Estimate, Outcome, State, identify};
pub use simulate::Resolution;
pub use solve::{FitOptions, Rows, fit};
pub use track::{Track, tracks, tracks_with};
