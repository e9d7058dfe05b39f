//! A model on its way: fitted, extended by a candidate, shortened by a term.

use super::candidate::{Candidate, Follows, Seed};
use super::found::Found;
use super::log::Log;
use super::panel::Trial;
use crate::fit::simulate::Resolution;
use crate::fit::{FitOptions, fit};
use crate::spec::{Spec, SpecError};
use compensator_core::{ParameterId, Parameters};

/// Simulations per parameter of a fit that only has to tell causes apart; what is reported is fitted to
/// the end.
const PATIENCE: usize = 3;

/// A fit goes on, so many times, while it gains less than this share of what the panel promised.
const MORE_FITS: usize = 4;

const PROMISED: f64 = 0.95;

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

/// Fits a model from a start, at a resolution known to do.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn refit(
    log: &Log,
    spec: &Spec,
    start: &Parameters<f64>,
    fixed: &[ParameterId],
    resolution: Option<Resolution>,
) -> Fitted {
    let options = FitOptions {
        starts: 1,
        start: Some(start.clone()),
        fixed: fixed.to_vec(),
        resolution,
        patience: PATIENCE,
        ..FitOptions::default()
    };
    let solution = fit(spec, start, log.train_rows(), &options);
    Fitted {
        spec: spec.clone(),
        parameters: solution.parameters(),
        free: solution.coordinates.ids().collect(),
        fixed: fixed.to_vec(),
        resolution: solution.resolution,
        sse: solution.reduced.sum_of_squares(),
        follows: None,
    }
}

/// Puts a candidate's term into a model and fits everything again.
pub fn with_candidate(
    log: &mut Log,
    model: &Fitted,
    candidate: &Candidate,
    trial: &Trial,
) -> Result<Fitted, SpecError> {
    let mut spec = model.spec.clone();
    spec.terms.push(candidate.term);
    let mut start = spec.parameters()?;
    for id in model.parameters.active() {
        start.set(id, model.parameters.get(id));
    }
    start.choices = model.parameters.choices;
    for (id, seed) in &candidate.seeds {
        let value = match seed {
            Seed::At(value) => *value,
            Seed::Times(column, factor) => trial.coefficients[*column] * factor,
        };
        let info = id.info();
        start.set(*id, value.clamp(info.lower, info.upper));
    }
    let mut fixed = model.fixed.clone();
    fixed.extend(&candidate.fixed);
    if let Some(follows) = candidate.follows.as_ref().filter(|follows| follows.extra) {
        log.follow(Some(&follows.column));
    }
    let mut fitted = refit(log, &spec, &start, &fixed, Some(model.resolution));
    // A short fit may stop on its way: what the linear panel promised should at least be kept.
    for _ in 0..MORE_FITS {
        if model.sse - fitted.sse > PROMISED * trial.gain {
            break;
        }
        let before = fitted.sse;
        fitted = refit(log, &spec, &fitted.parameters, &fixed, Some(model.resolution));
        if fitted.sse > 0.999 * before {
            break;
        }
    }
    fitted.follows = candidate.follows.clone().or_else(|| model.follows.clone());
    Ok(fitted)
}

/// The model without one of the causes found, everything else fitted again.
pub fn without(log: &Log, model: &Fitted, gone: &Found) -> Result<Fitted, SpecError> {
    let mut spec = model.spec.clone();
    spec.terms.retain(|term| *term != gone.term);
    let mut start = spec.parameters()?;
    for id in start.clone().active() {
        start.set(id, model.parameters.get(id));
    }
    start.choices = model.parameters.choices;
    let fixed: Vec<ParameterId> = model
        .fixed
        .iter()
        .copied()
        .filter(|id| start.active().any(|own| own == *id) || !gone.term.parameters().contains(id))
        .collect();
    let mut fitted = refit(log, &spec, &start, &fixed, Some(model.resolution));
    fitted.follows = model.follows.clone().filter(|_| gone.follows.is_none());
    Ok(fitted)
}
