//! One way a cause may enter the driver's law: columns beside the base model's, and where a fit with it begins.
//!
//! A candidate is a term of the core at rest (its size 0) with the columns by which the torque would
//! change if it acted. Where a term has a parameter that does not enter linearly (the order of a ripple,
//! the time constant of a run-in), there are several candidates of one cause, one for each setting of a
//! coarse grid; the fit moves on from the best. A cause whose column is not in the log, or does not vary
//! there, has no candidate: nothing is invented.

use super::contest::Gap;
use super::sensitivities::{Exact, Sensitivities};
use super::train_test::{FollowedColumn, TrainTest};
use compensator_core::{ParameterId, Parameters, Sample, TermKind};
use friction_fit::spec::Spec;

/// One row as a regressor sees it.
pub struct Row<'a> {
    /// The core's input.
    pub sample: &'a Sample<f64>,
    /// Change of the torque where the levels are raised by 1 Nm.
    pub added: f64,
    /// Change of the torque where the level is scaled.
    pub level: f64,
    /// The viscous part, Nm.
    pub viscous: f64,
    /// The followed covariate.
    pub extra: f64,
}

/// A column of a candidate.
pub enum Regressor {
    /// From what is known of each row.
    Row(Box<dyn Fn(&Row) -> f64 + Send + Sync>),
    /// Simulated for itself.
    Exact(Exact),
}

/// A column from what is known of each row.
pub fn row(f: impl Fn(&Row) -> f64 + Send + Sync + 'static) -> Regressor {
    Regressor::Row(Box::new(f))
}

/// How a parameter is set from the linear fit's coefficients.
#[derive(Clone, Debug)]
pub enum InitialGuess {
    /// To this value.
    At(f64),
    /// To this multiple of the coefficient of this column.
    Times(usize, f64),
}

/// One way a residual may be explained.
pub struct Candidate {
    /// The term that takes it into the model.
    pub term: TermKind,
    /// Columns of the log it needs.
    pub columns: Vec<String>,
    /// What it follows, for a cause that may follow any column.
    pub follows: Option<FollowedColumn>,
    /// Its columns.
    pub regressors: Vec<Regressor>,
    /// Where a fit with it begins.
    pub guesses: Vec<(ParameterId, InitialGuess)>,
    /// Parameters of the term a fit keeps.
    pub fixed: Vec<ParameterId>,
    /// Index of the extra covariate it reads.
    pub extra: Option<usize>,
}

impl Candidate {
    /// A candidate that acts through a term, by these regressors, one for each coefficient.
    pub fn new(term: TermKind, columns: &[&str], regressors: Vec<Regressor>) -> Self {
        Self {
            term,
            columns: columns.iter().map(|&name| name.to_owned()).collect(),
            follows: None,
            regressors,
            guesses: Vec::new(),
            fixed: Vec::new(),
            extra: None,
        }
    }

    /// A candidate with one regressor.
    pub fn single(term: TermKind, columns: &[&str], regressor: Regressor) -> Self {
        Self::new(term, columns, vec![regressor])
    }

    /// Where a fit with it begins.
    #[must_use]
    pub fn starting_at(mut self, guesses: &[(ParameterId, InitialGuess)]) -> Self {
        self.guesses = guesses.to_vec();
        self
    }

    /// Parameters of the term a fit keeps.
    #[must_use]
    pub fn keeping(mut self, fixed: &[ParameterId]) -> Self {
        self.fixed = fixed.to_vec();
        self
    }

    /// The column it follows; its index, where that is an extra covariate.
    #[must_use]
    pub fn following(mut self, follows: FollowedColumn, extra: Option<usize>) -> Self {
        (self.follows, self.extra) = (Some(follows), extra);
        self
    }

    /// Sets the parameters of its term, given the coefficients of its regressors.
    pub fn set(&self, parameters: &mut Parameters<f64>, coefficients: &[f64]) {
        for (id, guess) in &self.guesses {
            let value = match guess {
                InitialGuess::At(value) => *value,
                InitialGuess::Times(column, factor) => coefficients[*column] * factor,
            };
            let info = id.info();
            parameters.set(*id, value.clamp(info.lower, info.upper));
        }
    }
}

/// What candidates stand beside: a log, and a model that has been fitted to it.
pub struct FitContext<'a> {
    /// The log.
    pub log: &'a TrainTest,
    /// The model.
    pub spec: &'a Spec,
    /// What it does, row by row.
    pub at: &'a Sensitivities,
    /// What the contest has found of causes that enter nonlinearly.
    pub found: FoundSettings,
}

/// Settings of nonlinear causes that are known before a fit.
#[derive(Clone, Debug, Default)]
pub struct FoundSettings {
    /// Orders of a ripple, 1/rad or 1/m.
    pub orders: Vec<f64>,
    /// Gap of a backlash.
    pub gap: Option<Gap>,
}

impl FitContext<'_> {
    /// Whether the model has this term already, as such or in its law.
    pub fn has(&self, term: TermKind) -> bool {
        let spec = self.spec;
        spec.terms.contains(&term) || spec.rigid_body.contains(&term) || spec.law.includes(term)
    }
}
