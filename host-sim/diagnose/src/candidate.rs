//! One way a cause may enter the driver's law: regressors beside the base model's, and where a fit with it begins.
//!
//! A candidate is a term of the core with the regressors by which the torque would change if it acted. A linear fit gives their
//! coefficients, where the fit of the whole model begins. A term with a parameter that does not enter linearly, such as the time
//! constant of a run-in, has a candidate for each setting of a coarse grid. The orders of a ripple and the gap of a backlash come
//! from the contest instead ([`Detail`]). A cause whose log column is missing or constant has no candidate.

use super::contest::Detail;
use super::sensitivities::{Exact, Sensitivities};
use super::train_test::{FollowedColumn, TrainTest};
use compensator_core::{ParameterId, Parameters, Sample, TermKind};
use friction_fit::spec::Spec;

/// One row as a regressor sees it.
pub struct Row<'a> {
    /// The core's input.
    pub sample: &'a Sample<f64>,
    /// Change of the torque per increase of the levels, Nm/Nm.
    pub added: f64,
    /// Change of the torque per relative increase of the levels, Nm.
    pub level: f64,
    /// Viscous torque, Nm.
    pub viscous: f64,
    /// Value of the followed extra covariate, in its own unit; 0 without one.
    pub extra: f64,
}

/// Change of the torque along a log per unit of a coefficient.
pub enum Regressor {
    /// Computed from each row.
    Row(Box<dyn Fn(&Row) -> f64 + Send + Sync>),
    /// Simulated, for an effect that changes the state of the law.
    Exact(Exact),
}

/// Returns a regressor that is computed from each row.
pub fn row(f: impl Fn(&Row) -> f64 + Send + Sync + 'static) -> Regressor {
    Regressor::Row(Box::new(f))
}

/// How a parameter is set from the linear fit's coefficients.
#[derive(Clone, Debug)]
pub enum InitialGuess {
    /// To this value.
    At(f64),
    /// To this multiple of the coefficient of a regressor, by its place in the candidate.
    Times { regressor: usize, factor: f64 },
}

impl InitialGuess {
    /// Sets a parameter to this multiple of the coefficient of the first regressor.
    pub const fn first_times(factor: f64) -> Self {
        Self::Times { regressor: 0, factor }
    }
}

/// One way a residual may be explained.
pub struct Candidate {
    /// The term that takes it into the model.
    pub term: TermKind,
    /// Columns of the log that it needs.
    pub columns: Vec<String>,
    /// What it follows, for a cause that may follow any column.
    pub follows: Option<FollowedColumn>,
    /// One regressor for each coefficient.
    pub regressors: Vec<Regressor>,
    /// Values at which a fit with it begins.
    pub guesses: Vec<(ParameterId, InitialGuess)>,
    /// Parameters of the term that a fit keeps.
    pub fixed: Vec<ParameterId>,
}

impl Candidate {
    /// Creates a candidate that acts through a term, by these regressors, one for each coefficient.
    pub fn new(term: TermKind, columns: &[&str], regressors: Vec<Regressor>) -> Self {
        Self {
            term,
            columns: columns.iter().map(|&name| name.to_owned()).collect(),
            follows: None,
            regressors,
            guesses: Vec::new(),
            fixed: Vec::new(),
        }
    }

    /// Creates a candidate with one regressor.
    pub fn single(term: TermKind, columns: &[&str], regressor: Regressor) -> Self {
        Self::new(term, columns, vec![regressor])
    }

    /// Sets the values at which a fit with it begins. Each regressor of a guess must be one of the candidate.
    #[must_use]
    pub fn starting_at(mut self, guesses: &[(ParameterId, InitialGuess)]) -> Self {
        let is_known = |guess: &InitialGuess| match guess {
            InitialGuess::At(_) => true,
            InitialGuess::Times { regressor, .. } => *regressor < self.regressors.len(),
        };
        assert!(guesses.iter().all(|(_, guess)| is_known(guess)), "a guess without its regressor");
        self.guesses = guesses.to_vec();
        self
    }

    /// Sets the parameters of the term that a fit keeps.
    #[must_use]
    pub fn keeping(mut self, fixed: &[ParameterId]) -> Self {
        self.fixed = fixed.to_vec();
        self
    }

    /// Sets the column that it follows.
    #[must_use]
    pub fn following(mut self, follows: FollowedColumn) -> Self {
        self.follows = Some(follows);
        self
    }

    /// Sets the parameters of its term, given the coefficients of its regressors. A guess beyond the range of its
    /// parameter is limited to it, because a fit cannot begin there.
    pub fn set(&self, parameters: &mut Parameters<f64>, coefficients: &[f64]) {
        for (id, guess) in &self.guesses {
            let value = match guess {
                InitialGuess::At(value) => *value,
                InitialGuess::Times { regressor, factor } => coefficients[*regressor] * factor,
            };
            let info = id.info();
            parameters.set(*id, value.clamp(info.lower, info.upper));
        }
    }
}

/// A log, and the model fitted to it, for which candidates are built.
pub struct FitContext<'a> {
    /// The log.
    pub log: &'a TrainTest,
    /// The model.
    pub spec: &'a Spec,
    /// Sensitivities of the model along the log.
    pub at: &'a Sensitivities,
    /// What the contest has found of the cause: the orders of a ripple, the gap of a backlash.
    pub found: &'a Detail,
}

impl FitContext<'_> {
    /// Returns true if the model has this term already, as such or in its law.
    pub fn has(&self, term: TermKind) -> bool {
        let spec = self.spec;
        spec.terms.contains(&term) || spec.rigid_body.contains(&term) || spec.law.includes(term)
    }
}
