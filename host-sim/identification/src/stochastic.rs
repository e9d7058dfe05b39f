//! The stochastic extension of a model (Ding et al., eq. 2-8): how far may each parameter vary before
//! the model leaves what was measured?
//!
//! ```text
//! runs -> speed classes (Table II: 35, 70, 100 rpm)                            classes
//!      -> m trials, W monitoring times each, the data's range at each (eq. 2)  trials, range
//!      -> violation probability of a parameter vector (eq. 3)                  ensemble
//!      -> n sampled vectors; P0, the (1 - alpha) quantile, <= rho (eq. 4)      draw, search
//!      -> largest permitted spreads, alone and together (eq. 5)                search
//!      -> CV = sigma / |mean|, per parameter and class (eq. 8)                 certificate
//!      -> what the paper's rule makes of it, literally and calibrated          verdict, calibrate
//! ```
//!
//! Parameters vary by their logarithm: a variance of Nm and one of Nm/rad cannot be added up in a trace.
//! Every simulation is the core's own step in `f32`, as a driver takes it at the log's rate.
//! A large permitted spread mostly says that *the data do not determine* the parameter, not that its
//! physics is wrong; [`reading`] says so beside the number. Method, readings of the print and measurements:
//! `docs/stochastic-extension.md`.

pub mod calibrate;
pub mod certificate;
pub mod classes;
pub mod draw;
pub mod ensemble;
pub mod levels;
pub mod range;
mod search;
pub mod settings;
mod study;
pub mod trials;
pub mod verdict;

pub use calibrate::{Calibrated, calibrated_verdict, certify_calibrated};
pub use certificate::{CV_MOST, Certificate, LeftOut};
pub use levels::{Campaign, Counts, Levels};
pub use settings::{Form, Settings};
pub use verdict::reading;

use crate::fit::Track;
use compensator_core::{ParameterId, Parameters};

/// How far the free parameters may vary before the model leaves the data, per speed class.
///
/// `parameters` are those of a fit on these or like tracks; `free` those to be certified. Parameters that
/// have no relative spread are left out and named ([`Certificate::left_out`]).
pub fn certify(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    settings: &Settings,
) -> Certificate {
    let begin = std::time::Instant::now();
    let study = study::Study::new(parameters, free, tracks, settings);
    let mut certificate = study.certify(study::Residual::Measured);
    certificate.seconds = begin.elapsed().as_secs_f64();
    certificate
}
