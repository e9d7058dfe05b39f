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
//! exact (`dual`). Coordinates keep the parameters within their bounds.
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

mod channel;
pub mod clock;
mod coordinates;
mod dataset_tracks;
mod delayed;
mod determined;
mod dual;
mod gradient;
mod identify;
mod initial_heat;
mod initial_state;
mod legal;
pub mod linear;
mod measurement;
mod metrics;
mod minimise;
mod outcome;
mod parameter_file_error;
pub mod params;
mod passive;
mod predict;
pub mod prediction;
mod reason;
mod reduce;
mod robust;
mod scales;
mod settled;
mod simulate;
mod solve;
pub mod spec;
mod start;
mod statistics;
mod stepper;
mod streaming_qr;
mod torque_low_pass;
mod track;
mod treatment;
mod verdict;

// The rows of a log.
pub use dataset_tracks::{campaign_start, tracks, tracks_since, tracks_with};
pub use initial_heat::record_earlier_stretches;
pub use track::{Rows, Track, run_count};

// Between the shaft and the log.
pub use channel::{TrackLowPass, filter_column, noise_autocorrelation};
pub use measurement::{ChannelGain, Measurement};
pub use torque_low_pass::{LowPassShape, TorqueLowPass};

// A fit and its result.
pub use identify::identify;
pub use outcome::{DriverForm, Estimate, Outcome, State};
pub use reason::Reason;
pub use robust::{Loss, Weighting, identify_robustly};
pub use scales::{Scales, white_noise};
pub use solve::{
    COMPARISON_STAGNATION, COMPARISON_TOLERANCE, FitOptions, Solution, fit, free_parameters,
};
pub use treatment::{Treatment, treatment_of, typical_value};

// A model along rows, with derivatives, and its errors.
pub use dual::Dual;
pub use gradient::{Differentiable, GradientRow, Simulation, TorqueAt};
pub use initial_state::initial_state;
pub use metrics::{Metrics, WeighedRow};
pub use predict::{Predicted, predict};
pub use simulate::{Resolution, simulate};
pub use statistics::autocorrelation_time;
