//! A model on its way: fitted, extended by a candidate, shortened by a term.
//!
//! A search asks for the same fit again and again: after a claim has fallen it begins anew, and comes by the models
//! it has seen. [`Fits`] keeps what was fitted on its log, by where each fit began.

use super::candidate::{Candidate, InitialGuess};
use super::gram_blocks::CandidateFit;
use super::train_test::Follows;
use super::train_test::TrainTest;
use crate::fit::predict::{Predicted, predict};
use crate::fit::simulate::Resolution;
use crate::fit::solve::ENOUGH_TO_COMPARE;
use crate::fit::{FitOptions, Rows, fit};
use crate::spec::{Spec, SpecError};
use compensator_core::{ParameterId, Parameters, TermKind};
use std::cell::RefCell;

/// Simulations per parameter of a fit that only has to tell causes apart; what is reported is fitted to
/// the end.
const PATIENCE: usize = 3;

/// A fit goes on, so many times, while it gains less than this share of what the linear fit promised,
const MORE_FITS: usize = 4;

const PROMISED: f64 = 0.95;

/// and gets so much nearer to it each time: what a bend of the law takes back from the promise no more fits bring.
const NEARER: f64 = 0.1;

/// A model on its way.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Law, terms, rigid body.
    pub spec: Spec,
    /// Values.
    pub parameters: Parameters<f64>,
    /// Parameters that were fitted.
    pub free: Vec<ParameterId>,
    /// Parameters that are kept.
    pub fixed: Vec<ParameterId>,
    /// How finely it was stepped.
    pub resolution: Resolution,
    /// Sum of squares on the training rows.
    pub sse: f64,
    /// The column one of its terms follows, if that may follow any.
    pub follows: Option<Follows>,
}

impl Fitted {
    /// What it makes of the training rows.
    pub fn on_train(&self, log: &TrainTest) -> Predicted {
        let log = log.following(self.follows.as_ref());
        predict(&self.parameters, log.train_rows(), self.resolution)
    }

    /// What it makes of the held-out rows.
    pub fn on_test(&self, log: &TrainTest) -> Predicted {
        let log = log.following(self.follows.as_ref());
        predict(&self.parameters, log.test_rows(), self.resolution)
    }
}

/// Where a fit begins, and what it keeps.
#[derive(Clone, Debug, PartialEq)]
struct Start {
    spec: Spec,
    parameters: Parameters<f64>,
    fixed: Vec<ParameterId>,
    /// The column one of the terms follows, if that may follow any.
    follows: Option<Follows>,
    resolution: Resolution,
}

/// What was fitted on a log.
pub struct Fits<'a> {
    log: &'a TrainTest,
    made: RefCell<Vec<(Start, Fitted)>>,
}

impl<'a> Fits<'a> {
    /// None yet.
    pub fn new(log: &'a TrainTest) -> Self {
        Self { log, made: RefCell::default() }
    }

    /// The fit from a start, made once.
    fn from(&self, start: &Start) -> Fitted {
        let known =
            self.made.borrow().iter().find(|(own, _)| own == start).map(|(_, fit)| fit.clone());
        known.unwrap_or_else(|| {
            let fitted = refit(&self.log.following(start.follows.as_ref()), start);
            self.made.borrow_mut().push((start.clone(), fitted.clone()));
            fitted
        })
    }
}

/// Fits a model from a start, at a resolution known to do. The log follows what the model follows.
fn refit(log: &TrainTest, start: &Start) -> Fitted {
    let options = FitOptions {
        starts: 1,
        start: Some(start.parameters.clone()),
        fixed: start.fixed.clone(),
        resolution: Some(start.resolution),
        patience: PATIENCE,
        enough: ENOUGH_TO_COMPARE,
        ..FitOptions::default()
    };
    let solution = fit(&start.spec, &start.parameters, log.train_rows(), &options);
    Fitted {
        spec: start.spec.clone(),
        parameters: solution.parameters(),
        free: solution.coordinates.ids().collect(),
        fixed: start.fixed.clone(),
        resolution: solution.resolution,
        sse: solution.reduced.sum_of_squares(),
        follows: start.follows.clone(),
    }
}

/// The same model fitted to other rows, from where it stands.
pub fn again(rows: Rows, model: &Fitted) -> Fitted {
    let options = FitOptions {
        starts: 1,
        start: Some(model.parameters.clone()),
        fixed: model.fixed.clone(),
        resolution: Some(model.resolution),
        patience: PATIENCE,
        enough: ENOUGH_TO_COMPARE,
        ..FitOptions::default()
    };
    let solution = fit(&model.spec, &model.parameters, rows, &options);
    let parameters = solution.parameters();
    let free = solution.coordinates.ids().collect();
    Fitted { parameters, free, sse: solution.reduced.sum_of_squares(), ..model.clone() }
}

/// Puts a candidate's term into a model and fits everything again.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn with_candidate(
    fits: &Fits,
    model: &Fitted,
    candidate: &Candidate,
    linear: &CandidateFit,
) -> Result<Fitted, SpecError> {
    let mut spec = model.spec.clone();
    spec.terms.push(candidate.term);
    let mut parameters = spec.parameters()?;
    for id in model.parameters.active() {
        parameters.set(id, model.parameters.get(id));
    }
    parameters.choices = model.parameters.choices;
    for (id, seed) in &candidate.guesses {
        let value = match seed {
            InitialGuess::At(value) => *value,
            InitialGuess::Times(column, factor) => linear.coefficients[*column] * factor,
        };
        let info = id.info();
        parameters.set(*id, value.clamp(info.lower, info.upper));
    }
    let mut fixed = model.fixed.clone();
    fixed.extend(&candidate.fixed);
    let follows = candidate.follows.clone().or_else(|| model.follows.clone());
    let mut start = Start { spec, parameters, fixed, follows, resolution: model.resolution };
    let mut fitted = fits.from(&start);
    // A short fit may stop on its way: what the linear fit promised should at least be kept.
    for _ in 0..MORE_FITS {
        let missing = PROMISED * linear.gain - (model.sse - fitted.sse);
        if missing <= 0.0 {
            break;
        }
        let before = fitted.sse;
        start.parameters = fitted.parameters;
        fitted = fits.from(&start);
        if before - fitted.sse < f64::max(NEARER * missing, 0.001 * before) {
            break;
        }
    }
    Ok(fitted)
}

/// The model without one of its terms, everything else fitted again. `follows` is the column that is still
/// followed then.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn without(
    fits: &Fits,
    model: &Fitted,
    term: TermKind,
    follows: Option<&Follows>,
) -> Result<Fitted, SpecError> {
    let mut spec = model.spec.clone();
    spec.terms.retain(|own| *own != term);
    let mut parameters = spec.parameters()?;
    for id in parameters.clone().active() {
        parameters.set(id, model.parameters.get(id));
    }
    parameters.choices = model.parameters.choices;
    let fixed: Vec<ParameterId> = model
        .fixed
        .iter()
        .copied()
        .filter(|id| parameters.active().any(|own| own == *id) || !term.parameters().contains(id))
        .collect();
    let (follows, resolution) = (follows.cloned(), model.resolution);
    let start = Start { spec, parameters, fixed, follows, resolution };
    Ok(fits.from(&start))
}
