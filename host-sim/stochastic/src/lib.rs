//! Stochastic extension of a model (Ding et al., eq. 2-8): how far each parameter may vary before the model leaves the
//! range of the measurement.
//!
//! ```text
//! runs -> speed classes (Table II: 35, 70, 100 rpm)                            classes
//!      -> m trials, W monitoring times each, the data's range at each (eq. 2)  trials, range
//!      -> violation probability of a parameter vector (eq. 3)                  ensemble
//!      -> n sampled vectors; P0, the (1 - alpha) quantile, <= rho (eq. 4)      draw, search
//!      -> largest permitted spreads, alone and together (eq. 5)                search, study
//!      -> CV = sigma / |mean|, per parameter and class (eq. 8)                 certificate
//!      -> verdict of the paper's rule                                          verdict
//! ```
//!
//! The logarithms of the parameters vary, because variances in Nm and in Nm/rad cannot be added in a trace. Every simulation
//! uses the core's step in `f32`, as a driver does at the log's rate. A large permitted spread usually means that *the
//! data do not determine* the parameter, not that its physics is wrong; [`reading`] explains this for each result.
//! Method, interpretation of the paper and measurements: `docs/src/explanation/stochastic-extension.md`.

#[cfg(test)]
#[path = "../../../tests/message.rs"]
mod message;
#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;

pub mod certificate;
pub mod classes;
pub mod draw;
pub mod ensemble;
pub mod levels;
pub mod range;
mod search;
pub mod settings;
pub mod study;
pub mod trials;
pub mod verdict;

pub use certificate::{Certificate, ExcludedParameter, MAX_CV};
pub use levels::{Counts, Levels};
pub use settings::{Form, Settings};
pub use verdict::reading;

use compensator_core::{ParameterId, Parameters};
use friction_fit::Track;

/// Computes how far the free parameters may vary before the model leaves the data, per speed class.
///
/// `parameters` are those of a fit to these or similar tracks, and `free` those to be certified. Parameters without a
/// relative spread are excluded and listed ([`Certificate::left_out`]).
pub fn certify(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    settings: &Settings,
) -> Certificate {
    study::CertificateStudy::new(parameters, free, tracks, settings).certify()
}
