//! Result of a fit: every parameter with its standard error and whether the data determine it.
//!
//! A fit always returns numbers. [`State`] tells for each parameter whether its value is meaningful, and
//! [`Outcome::verdicts`] explains the result in sentences. "Not determined" does not mean "wrong": in steady sliding
//! the bristle stiffness does not affect the output, so any value fits.

use super::metrics::Metrics;
use super::reason::Reason;
use super::simulate::Resolution;
use crate::spec::Spec;
use compensator_core::{ParameterId, Parameters};
use nalgebra::DMatrix;

/// Maximum difference of a parameter from that of a simpler law which errs as little, as a share of the latter.
const MAX_DISAGREEMENT: f64 = 0.05;

/// Whether the data determine a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// The error is small enough, and the value is possible, shown by the log and repeated (`determined`).
    Determined,
    /// Very different values fit equally well, or the value is not one of the joint: [`Estimate::reason`].
    NotDetermined,
    /// The value did not change from its start, because no row depends on it.
    AtStart,
    /// The best value lies at a bound.
    AtBound,
}

impl State {
    /// Returns the name used in `fit.json`.
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
    /// The parameter.
    pub id: ParameterId,
    /// Value, in the parameter's unit.
    pub value: f64,
    /// Standard error; `None` if the parameter was fixed.
    pub std_error: Option<f64>,
    /// Whether the data determine it.
    pub state: State,
    /// Why the data do not determine it; `None` in any other state, and where the passive form moved it.
    pub reason: Option<Reason>,
}

/// Complete result of a fit.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The model.
    pub spec: Spec,
    /// The fitted parameters, valid in the core. The law may be active: a driver runs [`Outcome::for_driver`].
    pub parameters: Parameters<f64>,
    /// Estimates of all parameters of the model.
    pub estimates: Vec<Estimate>,
    /// Correlation of the estimates with a standard error, in the order of `estimates`.
    pub correlation: DMatrix<f64>,
    /// Errors on the training rows.
    pub train: Metrics,
    /// Errors on the held-out rows.
    pub test: Metrics,
    /// `n ln(SSE/n) + k ln n` of the training rows: smaller is better.
    pub bic: f64,
    /// Duration of the fit, s.
    pub seconds: f64,
    /// Number of simulations with derivatives, over all starts and refinements.
    pub evaluations: usize,
    /// Resolution of the simulation.
    pub resolution: Resolution,
    /// Number of neighbouring rows that count as one observation in the standard errors.
    pub autocorrelation_time: f64,
    /// True if the optimiser converged.
    pub converged: bool,
    /// Notes for the user, one sentence each.
    pub verdicts: Vec<String>,
    /// The passive form, if the rows alone determine an active law and the passive form is clearly worse.
    pub driver_form: Option<Box<DriverForm>>,
}

/// A fitted law for a joint driver.
#[derive(Clone, Debug)]
pub struct DriverForm {
    /// Its parameters.
    pub parameters: Parameters<f64>,
    /// Estimates of all its parameters. Those that differ from the fit to the rows alone are not determined.
    pub estimates: Vec<Estimate>,
    /// Errors on the training rows.
    pub train: Metrics,
    /// Errors on the held-out rows.
    pub test: Metrics,
}

impl Outcome {
    /// Marks the parameters as not determined to which a simpler law, which errs as little on held-out rows, gives another value.
    pub fn doubt_beside(&mut self, simpler: &Outcome) {
        for estimate in
            self.estimates.iter_mut().filter(|estimate| estimate.state == State::Determined)
        {
            let other = simpler.estimates.iter().find(|other| other.id == estimate.id);
            let Some(other) = other.filter(|other| other.state == State::Determined) else {
                continue;
            };
            if (estimate.value - other.value).abs() > MAX_DISAGREEMENT * other.value.abs() {
                (estimate.state, estimate.reason) =
                    (State::NotDetermined, Some(Reason::SimplerLawDisagrees));
                let why = Reason::SimplerLawDisagrees.in_words();
                self.verdicts.push(format!("{}: not determined{why}", estimate.id.name()));
            }
        }
    }

    /// Returns what a joint driver runs: the passive form, if there is one, or else this fit.
    pub fn for_driver(&self) -> DriverForm {
        let this = || DriverForm {
            parameters: self.parameters.clone(),
            estimates: self.estimates.clone(),
            train: self.train,
            test: self.test,
        };
        self.driver_form.as_deref().cloned().unwrap_or_else(this)
    }
}
