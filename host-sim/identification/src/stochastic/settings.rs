//! How a certificate is made.

use super::levels::{Counts, Levels};
use crate::data::JointKind;
use crate::fit::Resolution;

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

    /// A coefficient of variation `cv` (sigma over mean) of a parameter with this value, in this form.
    pub fn of(self, cv: f64, value: f64) -> f64 {
        match self {
            Self::SigmaOverMean => cv,
            Self::PrintedVarianceOverMean => cv * cv * value.abs(),
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
    pub joint: JointKind,
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
            joint: JointKind::Revolute,
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
