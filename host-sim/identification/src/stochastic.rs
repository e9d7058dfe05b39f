//! The stochastic extension of a model (paper 0, eq. 2-8): how far may each parameter vary before
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
mod study;
pub mod trials;
pub mod verdict;

pub use calibrate::{Calibrated, calibrated_verdict, certify_calibrated};
pub use certificate::{CV_MOST, Certificate, LeftOut};
pub use levels::{Campaign, Counts, Levels};
pub use verdict::reading;

use crate::data::Joint;
use crate::fit::{Resolution, Track};
use compensator_core::{ParameterId, Parameters};

/// How a permitted variance is made a number without a unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// `sigma / |mean|`, the coefficient of variation.
    #[default]
    SigmaOverMean,
    /// `sigma^2 / |mean|`, as eq. 8 is printed: it has the parameter's unit and changes with it.
    PrintedVarianceOverMean,
}

impl Form {
    /// As in result files.
    pub fn name(self) -> &'static str {
        match self {
            Self::SigmaOverMean => "sigma-over-mean",
            Self::PrintedVarianceOverMean => "printed-variance-over-mean",
        }
    }
}

/// How a certificate is made.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Confidence and accuracy.
    pub levels: Levels,
    /// The form of eq. 8.
    pub form: Form,
    /// Sampled vectors and trials; `None` for what the levels ask for, and never fewer than the
    /// paper took.
    pub counts: Option<Counts>,
    /// Samples of a trial.
    pub samples_per_run: usize,
    /// `W`: monitoring times of a trial, evenly spread.
    pub monitoring_times: usize,
    /// How finely the fit stepped; the residual is taken so.
    pub resolution: Resolution,
    /// Seed of everything drawn.
    pub seed: u64,
    /// What the joint does: the unit its speed classes are named in.
    pub joint: Joint,
    /// The most speed classes runs are sorted into.
    pub most_classes: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            levels: Levels::default(),
            form: Form::default(),
            counts: None,
            samples_per_run: 500,
            monitoring_times: 50,
            resolution: Resolution { substeps: 2, extrapolated: true },
            seed: 0,
            joint: Joint::Revolute,
            most_classes: 3,
        }
    }
}

impl Settings {
    /// Sampled vectors and trials.
    pub fn counts(&self) -> Counts {
        self.counts.unwrap_or_else(|| self.levels.counts().at_least(Counts::PAPER))
    }
}

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
