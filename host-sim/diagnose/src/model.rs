//! Fitted models of a search: a base law, extended by a candidate or reduced by a term.
//!
//! A search repeats fits. After a rejected cause it starts again and reaches models that it has
//! already fitted. [`FitCache`] stores the fits on its log by their starting point.

use super::candidate::Candidate;
use super::gram_blocks::CandidateFit;
use super::train_test::FollowedColumn;
use super::train_test::TrainTest;
use compensator_core::{ParameterId, Parameters, TermKind};
use friction_fit::predict::{Predicted, predict};
use friction_fit::simulate::Resolution;
use friction_fit::solve::{COMPARISON_STAGNATION, COMPARISON_TOLERANCE};
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{FitOptions, Rows, fit};
use std::cell::RefCell;

/// Simulations per parameter in a fit of the search, which only has to distinguish causes. Reported
/// models are fitted to convergence.
const PATIENCE: usize = 3;

/// Largest number of additional fits after a fit that ended early.
const MORE_FITS: usize = 2;

/// Share of the linear fit's gain at which no additional fit is made.
const PROMISED: f64 = 0.9;

/// Smallest progress of an additional fit, as a share of the missing gain. Below it, the
/// nonlinearity of the law causes the difference, and additional fits do not remove it.
const NEARER: f64 = 0.1;

/// A fitted model of a search.
#[derive(Clone, Debug)]
pub struct FittedModel {
    /// Law, terms and rigid body.
    pub spec: Spec,
    /// Parameter values.
    pub parameters: Parameters<f64>,
    /// Parameters that the fit determined.
    pub free: Vec<ParameterId>,
    /// Parameters that the fit kept constant.
    pub fixed: Vec<ParameterId>,
    /// Time resolution of the simulation.
    pub resolution: Resolution,
    /// Sum of squares on the training rows, Nm^2.
    pub sse: f64,
    /// Column that one of its terms follows, for a term that may follow any column.
    pub follows: Option<FollowedColumn>,
}

impl FittedModel {
    /// Returns the prediction of the training rows.
    pub fn on_train(&self, log: &TrainTest) -> Predicted {
        let log = log.following(self.follows.as_ref());
        predict(&self.parameters, log.train_rows(), self.resolution)
    }

    /// Returns the prediction of the held-out rows.
    pub fn on_test(&self, log: &TrainTest) -> Predicted {
        let log = log.following(self.follows.as_ref());
        predict(&self.parameters, log.test_rows(), self.resolution)
    }
}

/// Starting point of a fit, and the parameters that it keeps constant.
#[derive(Clone, Debug, PartialEq)]
struct Start {
    spec: Spec,
    parameters: Parameters<f64>,
    fixed: Vec<ParameterId>,
    /// Column that one of the terms follows, for a term that may follow any column.
    follows: Option<FollowedColumn>,
    resolution: Resolution,
}

/// Fits on one log, by their starting point.
pub struct FitCache<'a> {
    log: &'a TrainTest,
    made: RefCell<Vec<(Start, FittedModel)>>,
}

impl<'a> FitCache<'a> {
    /// Creates an empty cache.
    pub fn new(log: &'a TrainTest) -> Self {
        Self { log, made: RefCell::default() }
    }

    /// Returns the fit from a start. A repeated call returns the stored fit.
    fn from(&self, start: &Start) -> FittedModel {
        let known =
            self.made.borrow().iter().find(|(own, _)| own == start).map(|(_, fit)| fit.clone());
        known.unwrap_or_else(|| {
            let fitted = refit(&self.log.following(start.follows.as_ref()), start);
            self.made.borrow_mut().push((start.clone(), fitted.clone()));
            fitted
        })
    }
}

/// Returns the fit from a start at a sufficient time resolution. `log` must follow the column of
/// the start.
fn refit(log: &TrainTest, start: &Start) -> FittedModel {
    let options = FitOptions {
        starts: 1,
        start: Some(start.parameters.clone()),
        fixed: start.fixed.clone(),
        resolution: Some(start.resolution),
        patience: PATIENCE,
        tolerance: COMPARISON_TOLERANCE,
        stagnation: COMPARISON_STAGNATION,
        ..FitOptions::default()
    };
    let solution = fit(&start.spec, &start.parameters, log.train_rows(), &options);
    FittedModel {
        spec: start.spec.clone(),
        parameters: solution.parameters(),
        free: solution.coordinates.ids().collect(),
        fixed: start.fixed.clone(),
        resolution: solution.resolution,
        sse: solution.reduced.sum_of_squares(),
        follows: start.follows.clone(),
    }
}

/// Returns the model refitted to other rows, starting from its parameters.
pub fn again(rows: Rows, model: &FittedModel) -> FittedModel {
    let options = FitOptions {
        starts: 1,
        start: Some(model.parameters.clone()),
        fixed: model.fixed.clone(),
        resolution: Some(model.resolution),
        patience: PATIENCE,
        tolerance: COMPARISON_TOLERANCE,
        stagnation: COMPARISON_STAGNATION,
        ..FitOptions::default()
    };
    let solution = fit(&model.spec, &model.parameters, rows, &options);
    let parameters = solution.parameters();
    let free = solution.coordinates.ids().collect();
    FittedModel { parameters, free, sse: solution.reduced.sum_of_squares(), ..model.clone() }
}

/// Returns the model with the candidate's term and all parameters refitted.
///
/// # Errors
/// Returns an error if there are more terms than the core accepts.
pub fn with_candidate(
    fits: &FitCache,
    model: &FittedModel,
    candidate: &Candidate,
    linear: &CandidateFit,
) -> Result<FittedModel, SpecError> {
    let mut spec = model.spec.clone();
    spec.terms.push(candidate.term);
    let mut parameters = spec.parameters()?;
    for id in model.parameters.active() {
        parameters.set(id, model.parameters.get(id));
    }
    parameters.choices = model.parameters.choices;
    candidate.set(&mut parameters, &linear.coefficients);
    let mut fixed = model.fixed.clone();
    fixed.extend(&candidate.fixed);
    let follows = candidate.follows.clone().or_else(|| model.follows.clone());
    let start = Start { spec, parameters, fixed, follows, resolution: model.resolution };
    let fitted = continued(fits, start.clone(), model.sse, linear.gain);
    if model.sse - fitted.sse >= KEPT * linear.gain {
        return Ok(fitted);
    }
    // Beside a strong effect, the other parameters are far from their values.
    let start = Start { parameters: changed(&start.parameters, model, linear), ..start };
    let other = continued(fits, start, model.sse, linear.gain);
    Ok(if other.sse < fitted.sse { other } else { fitted })
}

/// Share of the linear fit's gain below which a fit starts again from all parameters of the linear fit.
const KEPT: f64 = 0.5;

/// Largest ratio by which the linear fit changes a positive parameter of a start.
const MAX_CHANGE: f64 = 3.0;

/// Returns the fit from a start. A short fit may end early. Additional fits continue it until it keeps the gain of the
/// linear fit.
fn continued(fits: &FitCache, mut start: Start, before_sse: f64, linear_gain: f64) -> FittedModel {
    let mut fitted = fits.from(&start);
    for _ in 0..MORE_FITS {
        let missing = PROMISED * linear_gain - (before_sse - fitted.sse);
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
    fitted
}

/// Returns the parameters of a start with the changes of the linear fit in the parameters of the model.
fn changed(start: &Parameters<f64>, model: &FittedModel, linear: &CandidateFit) -> Parameters<f64> {
    let mut parameters = start.clone();
    for (id, change) in model.free.iter().zip(&linear.base_change) {
        let (value, info) = (model.parameters.get(*id), id.info());
        let mut next = value + change;
        if value > 0.0 && info.lower >= 0.0 {
            next = next.clamp(value / MAX_CHANGE, value * MAX_CHANGE);
        }
        parameters.set(*id, next.clamp(info.lower, info.upper));
    }
    parameters
}

/// Returns the model without one of its terms and all other parameters refitted. `follows` is the
/// column that the remaining terms follow.
///
/// # Errors
/// Returns an error if there are more terms than the core accepts.
pub fn without(
    fits: &FitCache,
    model: &FittedModel,
    term: TermKind,
    follows: Option<&FollowedColumn>,
) -> Result<FittedModel, SpecError> {
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
