//! What a fit says: every parameter with its error and whether the data determine it at all.
//!
//! A fit always returns numbers. Whether they mean anything is told per parameter ([`State`]) and, for
//! what a person would want to know, in words ([`Outcome::verdicts`]). "Not determined" is not
//! "wrong": in steady sliding the bristle stiffness does not reach the output, so any value fits.

use super::metrics::Metrics;
use super::simulate::Resolution;
use crate::spec::Spec;
use compensator_core::{ParameterId, Parameters};
use nalgebra::DMatrix;

/// What the data say of a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It has a value and an error that is small beside what matters.
    Determined,
    /// Values far apart fit as well.
    NotDetermined,
    /// It never moved from where the fit began: nothing depends on it.
    AtStart,
    /// The best value lies at the edge of what is allowed.
    AtBound,
}

impl State {
    /// As in `fit.json`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Determined => "determined",
            Self::NotDetermined => "not-determined",
            Self::AtStart => "at-start",
            Self::AtBound => "at-bound",
        }
    }
}

/// A fitted parameter.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Which.
    pub id: ParameterId,
    /// Its value, in its unit.
    pub value: f64,
    /// Standard error, `None` where it was kept fixed.
    pub std_error: Option<f64>,
    /// What the data say of it.
    pub state: State,
}

/// A fit, whole.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The model.
    pub spec: Spec,
    /// The fitted parameters, ready for the core.
    pub parameters: Parameters<f64>,
    /// Each parameter of the model.
    pub estimates: Vec<Estimate>,
    /// Correlation of the estimates that have an error, in their order.
    pub correlation: DMatrix<f64>,
    /// Errors on the rows fitted on.
    pub train: Metrics,
    /// Errors on the rows held out.
    pub test: Metrics,
    /// `n ln(SSE/n) + k ln n` of the training rows: smaller is better.
    pub bic: f64,
    /// Time the fit took, s.
    pub seconds: f64,
    /// Simulations with derivatives the best start and its refinements took.
    pub evaluations: usize,
    /// How finely the simulation stepped.
    pub resolution: Resolution,
    /// Neighbouring rows that count as one observation in the standard errors.
    pub autocorrelation_time: f64,
    /// Whether the optimiser converged.
    pub converged: bool,
    /// What a person should know, a sentence each.
    pub verdicts: Vec<String>,
}
