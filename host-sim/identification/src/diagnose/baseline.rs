//! The model a log is held against first.
//!
//! The simplest law the log supports: linear, then with the Stribeck curve, then with bristles. A law
//! with more parameters is taken if it lowers `n ln(SSE) + k ln n`, with `n` the number of *independent*
//! rows. A log of steady sliding gets no bristles, and no cause that only bristles could show.

use super::log::Log;
use super::model::Fitted;
use crate::fit::outcome::predict;
use crate::fit::statistics::autocorrelation_time;
use crate::fit::{FitOptions, fit};
use crate::spec::{Spec, SpecError};
use compensator_core::{LawKind, Parameters};

/// The laws, the simplest first.
const LADDER: [LawKind; 3] = [LawKind::Linear, LawKind::Stribeck, LawKind::Lugre];

/// Starting points of a baseline's fit that go all the way.
const STARTS: usize = 2;

/// Fits a law, from scratch or from given parameters.
///
/// # Errors
/// If there are more terms than the core takes.
fn fitted(log: &Log, spec: &Spec, start: Option<&Parameters<f64>>) -> Result<Fitted, SpecError> {
    let base = match start {
        Some(start) => start.clone(),
        None => spec.parameters()?,
    };
    let options = FitOptions { starts: STARTS, start: start.cloned(), ..FitOptions::default() };
    let solution = fit(spec, &base, log.train_rows(), &options);
    Ok(Fitted {
        spec: spec.clone(),
        parameters: solution.parameters(),
        free: solution.coordinates.ids().collect(),
        fixed: Vec::new(),
        resolution: solution.resolution,
        sse: solution.reduced.sum_of_squares(),
        follows: None,
    })
}

/// Chooses a law.
///
/// # Errors
/// If the rigid-body parts alone are more terms than the core takes.
pub fn choose(log: &mut Log) -> Result<Fitted, SpecError> {
    let best = climb(log, &LADDER)?;
    if leave_out_rest(log, &best) {
        // A law with bristles has just been found no better: what is left are the others.
        return climb(log, &LADDER[..2]);
    }
    Ok(best)
}

/// Fits a law that was asked for, from given parameters or from scratch.
///
/// # Errors
/// If there are more terms than the core takes.
pub fn asked_for(
    log: &mut Log,
    spec: &Spec,
    start: Option<&Parameters<f64>>,
) -> Result<Fitted, SpecError> {
    let first = fitted(log, spec, start)?;
    if leave_out_rest(log, &first) { fitted(log, spec, start) } else { Ok(first) }
}

/// See [`Log::leave_out_rest`]; a law with bristles has something to say of rest.
fn leave_out_rest(log: &mut Log, model: &Fitted) -> bool {
    let squares = |log: &Log| {
        let metrics = predict(&model.parameters, log.train_rows(), model.resolution).metrics;
        (metrics.sse, metrics.rows)
    };
    !model.spec.law.has_bristles() && log.leave_out_rest(squares)
}

fn climb(log: &Log, ladder: &[LawKind]) -> Result<Fitted, SpecError> {
    let mut best: Option<Fitted> = None;
    for law in ladder {
        let next = fitted(log, &Spec::law(*law).on(&log.rigid_body), None)?;
        best = match best {
            Some(best) if !is_worth_it(log, &best, &next) => Some(best),
            _ => Some(next),
        };
    }
    best.map_or_else(|| fitted(log, &Spec::law(LawKind::Linear), None), Ok)
}

fn is_worth_it(log: &Log, simple: &Fitted, rich: &Fitted) -> bool {
    let predicted = predict(&rich.parameters, log.train_rows(), rich.resolution);
    let memory = autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice));
    let rows = predicted.metrics.rows as f64 / memory;
    let more = rich.free.len() as f64 - simple.free.len() as f64;
    let ratio = simple.sse.max(f64::MIN_POSITIVE) / rich.sse.max(f64::MIN_POSITIVE);
    rows * ratio.ln() > more * rows.max(2.0).ln()
}
