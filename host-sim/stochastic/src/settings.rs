//! Settings of a certificate.

use super::levels::{Counts, Levels};
use friction_fit::Resolution;
use joint_log::JointKind;

/// Definition of the coefficient of variation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// `sigma / |mean|`, the coefficient of variation.
    #[default]
    SigmaOverMean,
    /// `sigma^2 / |mean|`, as eq. 8 is printed. Its value depends on the unit of the parameter.
    PrintedVarianceOverMean,
}

impl Form {
    /// Returns the name used in result files.
    pub fn name(self) -> &'static str {
        match self {
            Self::SigmaOverMean => "sigma-over-mean",
            Self::PrintedVarianceOverMean => "printed-variance-over-mean",
        }
    }

    /// Converts a coefficient of variation `cv` (sigma over mean) of a parameter with this value to this form.
    pub fn of(self, cv: f64, value: f64) -> f64 {
        match self {
            Self::SigmaOverMean => cv,
            Self::PrintedVarianceOverMean => cv * cv * value.abs(),
        }
    }
}

/// Settings of a certificate.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Confidence and accuracy.
    pub levels: Levels,
    /// The form of eq. 8.
    pub form: Form,
    /// Sampled vectors and trials; `None` for the counts that the levels require, but at least those of the paper.
    pub counts: Option<Counts>,
    /// Number of samples of a trial.
    pub samples_per_run: usize,
    /// `W`: number of evenly spaced monitoring times of a trial.
    pub monitoring_times: usize,
    /// Resolution of the fit, with which the residual is computed.
    pub resolution: Resolution,
    /// Seed of the random sampler.
    pub seed: u64,
    /// Kind of joint, which determines the unit in the names of speed classes.
    pub joint: JointKind,
    /// Maximum number of speed classes.
    pub max_classes: usize,
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
            joint: JointKind::Revolute,
            max_classes: 3,
        }
    }
}

impl Settings {
    /// Returns the numbers of sampled vectors and trials.
    pub fn counts(&self) -> Counts {
        self.counts.unwrap_or_else(|| self.levels.counts().at_least(Counts::PAPER))
    }
}
