//! Fitting a model to measured runs.
//!
//! ```text
//! Dataset -> tracks (unbroken stretches, as the core's samples)      dataset_tracks, track
//!         -> core model stepped along each, with derivatives         simulate, stepper, settled, delayed
//!            (with the initial bristle torque and heat)              initial_state, initial_heat
//!            (filtered as the logged torque)                         torque_low_pass, channel
//!         -> residual and Jacobian, reduced to a small triangle      reduce, streaming_qr
//!         -> bounded Levenberg-Marquardt from several starts         scales, coordinates, start, minimise, solve
//!            (repeated with Huber's weights for a robust loss)       robust
//!         -> on held-out rows                                        predict, metrics
//!         -> parameters, errors, verdicts                            statistics, determined, identify, outcome, verdict
//!            (with the passive form for a driver)                    passive
//! ```
//!
//! The simulation uses the core's step, so that the identified model is the one that a driver runs. Derivatives are
//! exact ([`dual`]). Coordinates keep the parameters within their bounds.
//!
//! [`spec`] parses the name of a model, such as `lugre+pressure-coulomb`. [`params`] writes the parameters in the driver's format,
//! and [`prediction`] gives the torque of a fitted model on every row of a log. The package
//! `friction-network` does so for `lugre-lstm`.

#[cfg(test)]
#[path = "../../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;

pub mod channel;
pub mod clock;
pub mod coordinates;
pub mod dataset_tracks;
mod delayed;
pub mod determined;
pub mod dual;
pub mod gradient;
pub mod identify;
pub mod initial_heat;
pub mod initial_state;
mod legal;
pub mod linear;
pub mod measurement;
pub mod metrics;
pub mod minimise;
pub mod outcome;
pub mod params;
mod passive;
pub mod predict;
pub mod prediction;
pub mod reason;
pub mod reduce;
pub mod robust;
pub mod scales;
mod settled;
pub mod simulate;
pub mod solve;
pub mod spec;
pub mod start;
pub mod statistics;
mod stepper;
pub mod streaming_qr;
pub mod torque_low_pass;
pub mod track;
pub mod treatment;
mod verdict;

pub use dataset_tracks::{tracks, tracks_with};
pub use identify::identify;
pub use metrics::Metrics;
pub use outcome::{DriverForm, Estimate, Outcome, State};
pub use predict::{Predicted, predict};
pub use robust::{Loss, identify_robustly};
pub use simulate::Resolution;
pub use solve::{FitOptions, fit};
pub use track::{Rows, Track};
