//! The reference method: stepwise least squares on a few regressors per cause, without a friction law of the core.
//!
//! ```text
//! base     an elastic sign s (a stop: s <- clamp(s + dq / travel, -1, 1), one of ten travels by its error), viscous,
//!          a Stribeck peak (s exp(-(v/v_s)^2), one of three v_s or none), the rigid-body parts
//! causes   a few regressors each, beside the base ([`super::cause_regressors`])
//! forward  the cause with the largest held-out gain, at most three; every run left out once, or eight blocks if
//!          runs are few; a cause enters if the gain over all folds is at least 3 % and two standard errors
//! ```
//!
//! All fits use products of regressors by fold (a Gram matrix each), so that a selection needs no pass over the rows. The
//! diagnosis must do better than this method.

use super::cause_regressors::cause_regressors;
use super::regressors::{BaseModel, LongData, Regressor, base_model};
use compensator_core::TermKind;
use joint_log::Dataset;
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// Result of the regression.
#[derive(Clone, Debug)]
pub struct Regression {
    /// Causes in order of selection.
    pub named: Vec<&'static str>,
    /// Reduction of the held-out error, 1 - RMSE after / RMSE before.
    pub gain: f64,
    /// Held-out RMSE with all selected causes, in the unit of the torque.
    pub rmse: f64,
    /// Description of the selected base.
    pub base: String,
    /// Best causes beside the base alone: name, gain as a share of the squared error, and gain over its standard error.
    pub candidates: Vec<(&'static str, f64, f64)>,
}

impl Regression {
    /// Describes the base and the best causes, one line.
    pub fn describe(&self) -> String {
        let candidates = self
            .candidates
            .iter()
            .map(|(name, share, errors)| format!("{name} {share:.3} ({errors:.1} errors)"));
        format!("{}: {}", self.base, candidates.collect::<Vec<_>>().join("; "))
    }
}

/// Maximum number of selected causes.
const MAX_CAUSES: usize = 3;
/// Minimum gain of a cause, as a share of the held-out squared error.
const MIN_GAIN_SHARE: f64 = 0.03;
/// Minimum gain of a cause over the folds, in standard errors.
const MIN_GAIN_ERRORS: f64 = 2.0;
/// Number of reported candidates.
const REPORTED_CANDIDATES: usize = 5;
/// Minimum number of runs for one fold per run; with fewer runs the folds are blocks.
const MIN_RUN_FOLDS: usize = 4;
const BLOCK_FOLDS: usize = 8;
/// Travels of the elastic sign, relative to the median run's span; the first one is practically a sign function. The grid is
/// fine because a wrong travel looks like backlash.
const TRAVELS: [f64; 10] = [1e-6, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0];
/// Stribeck velocities, relative to the 95th percentile of speed; 0 for no peak.
const PEAKS: [f64; 4] = [0.0, 0.01, 0.05, 0.2];

/// Returns the folds: one per run, or blocks if the log has few runs.
fn folds(data: &LongData) -> Vec<Range<usize>> {
    if data.runs.len() >= MIN_RUN_FOLDS {
        return data.runs.clone();
    }
    let rows = data.velocity.len();
    (0..BLOCK_FOLDS).map(|at| at * rows / BLOCK_FOLDS..(at + 1) * rows / BLOCK_FOLDS).collect()
}

/// Products of all regressors and the torque (the last) in the rows of each fold, and in all rows.
struct Products {
    folds: Vec<DMatrix<f64>>,
    all: DMatrix<f64>,
}

impl Products {
    fn new(columns: &[&Regressor], torque: &Regressor, folds: &[Range<usize>]) -> Self {
        /// Rows processed at once, so that they stay in the cache.
        const CHUNK_ROWS: usize = 2048;
        let width = columns.len() + 1;
        let product = |rows: &Range<usize>| {
            let mut sum = DMatrix::zeros(width, width);
            for from in rows.clone().step_by(CHUNK_ROWS) {
                let to = (from + CHUNK_ROWS).min(rows.end);
                let part = DMatrix::from_fn(to - from, width, |row, column| {
                    columns.get(column).map_or(torque[from + row], |column| column[from + row])
                });
                sum.gemm_tr(1.0, &part, &part, 1.0);
            }
            sum
        };
        let folds: Vec<DMatrix<f64>> = folds.iter().map(product).collect();
        let all = folds.iter().fold(DMatrix::zeros(width, width), |sum, fold| sum + fold);
        Self { folds, all }
    }

    /// Returns the squared error of each fold with a fit to all others.
    fn held_out_errors(&self, columns: &[usize]) -> Vec<f64> {
        let errors =
            self.folds.iter().map(|fold| squared_error(fold, &(&self.all - fold), columns));
        errors.collect()
    }
}

/// Returns the squared error in the rows of `test` with a fit to those of `train`.
fn squared_error(test: &DMatrix<f64>, train: &DMatrix<f64>, columns: &[usize]) -> f64 {
    /// Added to the unit diagonal, so that dependent regressors have a solution.
    const RIDGE: f64 = 1e-9;
    let (count, target) = (columns.len(), train.ncols() - 1);
    let scale = |at: usize| {
        let square = train[(columns[at], columns[at])];
        if square > 0.0 { square.sqrt() } else { 1.0 }
    };
    let scales: Vec<f64> = (0..count).map(scale).collect();
    let normal = DMatrix::from_fn(count, count, |a, b| {
        let ridge = if a == b { RIDGE } else { 0.0 };
        train[(columns[a], columns[b])] / (scales[a] * scales[b]) + ridge
    });
    let right = DVector::from_fn(count, |a, _| train[(columns[a], target)] / scales[a]);
    let Some(solved) = normal.cholesky() else { return test[(target, target)] };
    let found = solved.solve(&right);
    let found: Vec<f64> = (0..count).map(|at| found[at] / scales[at]).collect();
    let mut error = test[(target, target)];
    for a in 0..count {
        error -= 2.0 * found[a] * test[(columns[a], target)];
        for b in 0..count {
            error += found[a] * found[b] * test[(columns[a], columns[b])];
        }
    }
    error.max(0.0)
}

/// Returns the base with the smallest error on its fitted rows.
fn best_base(rows: &LongData, rigid_body: &[TermKind]) -> BaseModel {
    let whole = 0..rows.velocity.len();
    let mut best: Option<(f64, BaseModel)> = None;
    for travel in TRAVELS {
        for peak in PEAKS {
            let tried = base_model(rows, rigid_body, travel * rows.span, peak * rows.speed);
            let columns: Vec<&Regressor> = tried.regressors.iter().collect();
            let products = Products::new(&columns, &rows.torque, std::slice::from_ref(&whole));
            let all: Vec<usize> = (0..columns.len()).collect();
            let error = squared_error(&products.all, &products.all, &all);
            if best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, tried));
            }
        }
    }
    best.map_or_else(|| base_model(rows, rigid_body, rows.span, 0.0), |(_, base)| base)
}

/// Returns the mean relative gain of the folds over its standard error. Gains are relative because runs differ in size by far
/// more than gains do.
fn gain_in_errors(before: &[f64], after: &[f64]) -> f64 {
    let shares = before.iter().zip(after).filter(|(b, _)| **b > 0.0);
    let shares: Vec<f64> = shares.map(|(b, a)| ((b - a) / b).max(-1.0)).collect();
    let count = shares.len() as f64;
    let mean = shares.iter().sum::<f64>() / count;
    let variance = shares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let error = (variance / count).sqrt();
    if error > 0.0 { mean / error } else { 0.0 }
}

/// A candidate cause beside the selected ones.
struct CandidateCause {
    name: &'static str,
    /// Held-out gain, as a share of the squared error.
    share: f64,
    /// Gain over its standard error.
    errors: f64,
    after: Vec<f64>,
    columns: Vec<usize>,
}

/// Names the causes in a log; `rigid_body` lists the parts of the torque column that are not friction.
pub fn regress(data: &Dataset, rigid_body: &[TermKind]) -> Regression {
    let rows = LongData::new(data);
    let base = best_base(&rows, rigid_body);
    let causes = cause_regressors(&rows, &base, rigid_body);
    let base_count = base.regressors.len();
    let columns: Vec<&Regressor> = base.regressors.iter().chain(&causes.regressors).collect();
    let products = Products::new(&columns, &rows.torque, &folds(&rows));
    let mut chosen: Vec<usize> = (0..base_count).collect();
    let mut errors = products.held_out_errors(&chosen);
    let begin: f64 = errors.iter().sum();
    let (mut named, mut candidates) = (Vec::new(), Vec::new());
    while named.len() < MAX_CAUSES {
        let before: f64 = errors.iter().sum();
        let tried = causes.causes.iter().filter(|(name, _)| !named.contains(name));
        let tried = tried.map(|(name, places)| {
            let places = places.iter().map(|place| base_count + place);
            let new = places.filter(|place| !chosen.contains(place));
            let with: Vec<usize> = chosen.iter().copied().chain(new).collect();
            (*name, products.held_out_errors(&with), with)
        });
        let mut tried: Vec<CandidateCause> = tried
            .map(|(name, after, columns)| CandidateCause {
                name,
                share: 1.0 - after.iter().sum::<f64>() / before,
                errors: gain_in_errors(&errors, &after),
                after,
                columns,
            })
            .collect();
        tried.sort_by(|a, b| b.share.total_cmp(&a.share));
        if named.is_empty() {
            candidates = tried
                .iter()
                .take(REPORTED_CANDIDATES)
                .map(|t| (t.name, t.share, t.errors))
                .collect();
        }
        let passes = |t: &CandidateCause| t.share >= MIN_GAIN_SHARE && t.errors >= MIN_GAIN_ERRORS;
        let Some(best) = tried.into_iter().find(passes) else { break };
        named.push(best.name);
        (errors, chosen) = (best.after, best.columns);
    }
    let left: f64 = errors.iter().sum();
    Regression {
        named,
        gain: if begin > 0.0 { 1.0 - (left / begin).sqrt() } else { 0.0 },
        rmse: (left / rows.velocity.len().max(1) as f64).sqrt(),
        base: base.description.clone(),
        candidates,
    }
}
