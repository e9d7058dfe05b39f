//! Fitting a model to measured runs.
//!
//! ```text
//! Dataset -> tracks (unbroken stretches, as the core's samples)      track
//!         -> core model stepped along each, with derivatives         simulate, stepper, settled, delayed
//!            (what a track at rest holds is solved for on the way: initial_state)
//!         -> residual and Jacobian, reduced to a small triangle      reduce, streaming_qr
//!         -> bounded Levenberg-Marquardt from several starts         scales, coordinates, start, minimise, solve
//!         -> on held-out rows                                        predict, metrics
//!         -> parameters, errors, verdicts                            statistics, identify, outcome, verdict
//! ```
//!
//! The simulation is the core's step, so what is identified is what is flashed. Derivatives are exact
//! ([`crate::dual`]). Bounds are kept by coordinates that cannot leave them.

pub mod channel;
pub mod coordinates;
mod delayed;
pub mod identify;
pub mod initial_state;
pub mod metrics;
pub mod minimise;
pub mod outcome;
pub mod predict;
pub mod reduce;
pub mod scales;
mod settled;
pub mod simulate;
pub mod solve;
pub mod start;
pub mod statistics;
mod stepper;
pub mod streaming_qr;
pub mod track;
pub mod treatment;
mod verdict;
pub mod warmth;

pub use identify::identify;
pub use metrics::Metrics;
pub use outcome::{Estimate, Outcome, State};
pub use predict::{Predicted, predict};
pub use simulate::Resolution;
pub use solve::{FitOptions, fit};
pub use track::{Rows, Track, tracks, tracks_with};
