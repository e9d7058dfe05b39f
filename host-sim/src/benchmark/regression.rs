//! The rival: an afternoon's regression, least squares on columns, without any friction law of the core's.
//!
//! ```text
//! base     an elastic sign s (a stop: s <- clamp(s + dq / travel, -1, 1), one of ten travels by its error), viscous,
//!          a Stribeck peak (s exp(-(v/v_s)^2), one of three v_s or none), the rigid-body parts
//! causes   each a few columns beside that ([`super::cause_columns`])
//! forward  the cause that gains most on rows left out, three at most; every run left out once, eight blocks where
//!          runs are few; it enters if all folds together gain 3 % and two standard errors
//! ```
//!
//! Everything is done on products of columns by fold (a Gram matrix each), so a choice costs no pass over the rows.
//! What a diagnosis must do better than.

use super::cause_columns::causes;
use super::stop_operator::{displacements, stop};
use friction_identification::data::{Dataset, Quantity, Run};
use nalgebra::{DMatrix, DVector};
use std::ops::Range;

/// What the regression says.
#[derive(Clone, Debug)]
pub struct Regression {
    /// Causes in the order they entered.
    pub named: Vec<&'static str>,
    /// Share of the error on rows left out that they take, 1 - RMSE after / RMSE before.
    pub gain: f64,
    /// RMSE on rows left out with all of them, unit of the torque.
    pub rmse: f64,
    /// The base that was chosen, in words.
    pub base: String,
    /// The best of all causes beside the base alone: name, gain as a share of the squared error, and that
    /// over its standard error.
    pub heard: Vec<(&'static str, f64, f64)>,
}

impl Regression {
    /// The base and the best causes beside it, a line.
    pub fn words(&self) -> String {
        let heard = self
            .heard
            .iter()
            .map(|(name, share, errors)| format!("{name} {share:.3} ({errors:.1} errors)"));
        format!("{}: {}", self.base, heard.collect::<Vec<_>>().join("; "))
    }
}

/// Causes at most.
const MOST: usize = 3;
/// A cause takes at least this share of the squared error on rows left out.
const LEAST_SHARE: f64 = 0.03;
/// And gains at least so many standard errors over the folds.
const LEAST_ERRORS: f64 = 2.0;
/// Candidates that are told of.
const HEARD: usize = 5;
/// Runs from which each is left out once; blocks where there are fewer.
const RUNS: usize = 4;
const BLOCKS: usize = 8;
/// Travels of the elastic sign, of the middle run's span; the first is as good as a sign. More than the four of
/// an afternoon: with those, the shape they miss was called backlash in two worlds of three.
const TRAVELS: [f64; 10] = [1e-6, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0];
/// Stribeck velocities, of the 95th percentile of speed; 0 for no peak.
const PEAKS: [f64; 4] = [0.0, 0.01, 0.05, 0.2];

/// A column over all rows of the data.
pub(super) type Column = Vec<f64>;

/// The data as the regression sees them: long columns, and where runs begin.
pub(super) struct Rows<'a> {
    pub data: &'a Dataset,
    /// Rows of each run in the long columns.
    pub runs: Vec<Range<usize>>,
    pub velocity: Column,
    pub torque: Column,
    /// Displacement since the row before, 0 at a run's first.
    pub displacement: Column,
    /// Median displacement span of a run.
    pub span: f64,
    /// 95th percentile of speed.
    pub speed: f64,
}

impl<'a> Rows<'a> {
    fn new(data: &'a Dataset) -> Self {
        let mut at = 0;
        let runs = data.runs.iter().map(|run| {
            at += run.len();
            at - run.len()..at
        });
        let runs: Vec<Range<usize>> = runs.collect();
        let long =
            |of: &dyn Fn(&Run) -> Vec<f64>| data.runs.iter().flat_map(of).collect::<Column>();
        let displacement = long(&displacements);
        let mut spans: Vec<f64> = runs
            .iter()
            .map(|run| {
                let (mut place, mut least, mut most) = (0.0f64, 0.0f64, 0.0f64);
                for step in &displacement[run.clone()] {
                    place += step;
                    (least, most) = (least.min(place), most.max(place));
                }
                most - least
            })
            .collect();
        spans.sort_by(f64::total_cmp);
        let velocity = long(&|run| run.velocity.clone());
        let mut speeds: Vec<f64> = velocity.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        let speed = speeds.get(speeds.len() * 95 / 100).copied().unwrap_or(1.0);
        Self {
            data,
            torque: long(&|run| run.torque.clone()),
            displacement,
            span: spans.get(spans.len() / 2).copied().unwrap_or(1.0).max(1e-12),
            speed: speed.max(1e-12),
            velocity,
            runs,
        }
    }

    /// A quantity over all rows, where every run has it.
    pub fn quantity(&self, quantity: Quantity) -> Option<Column> {
        let runs = self.data.runs.iter().map(|run| run.get(quantity));
        Some(runs.collect::<Option<Vec<&[f64]>>>()?.concat())
    }

    /// The elastic sign of a travel, with a gap in it.
    pub fn stop(&self, travel: f64, gap: f64) -> Column {
        let runs = self.runs.iter();
        runs.flat_map(|run| stop(&self.displacement[run.clone()], travel, gap)).collect()
    }

    /// The acceleration, measured or derived.
    pub fn acceleration(&self) -> Column {
        self.data.runs.iter().flat_map(|run| run.acceleration_or_derived().into_owned()).collect()
    }

    /// A function of each row's number, in their order.
    pub fn map(&self, of: impl FnMut(usize) -> f64) -> Column {
        (0..self.velocity.len()).map(of).collect()
    }

    /// The derivative of a column by time, within runs.
    pub fn derivative(&self, column: &[f64]) -> Column {
        let mut slopes = vec![0.0; column.len()];
        for (run, rows) in self.data.runs.iter().zip(&self.runs) {
            for at in 1..rows.len().saturating_sub(1) {
                let row = rows.start + at;
                let seconds = run.time_s[at + 1] - run.time_s[at - 1];
                slopes[row] =
                    if seconds > 0.0 { (column[row + 1] - column[row - 1]) / seconds } else { 0.0 };
            }
        }
        slopes
    }

    fn folds(&self) -> Vec<Range<usize>> {
        if self.runs.len() >= RUNS {
            return self.runs.clone();
        }
        let rows = self.velocity.len();
        (0..BLOCKS).map(|at| at * rows / BLOCKS..(at + 1) * rows / BLOCKS).collect()
    }
}

/// The base columns with a travel and a Stribeck velocity.
pub(super) struct Base {
    pub travel: f64,
    pub sign: Column,
    columns: Vec<Column>,
    words: String,
}

fn base(rows: &Rows, rigid_body: &[&str], travel: f64, peak: f64) -> Base {
    let sign = rows.stop(travel, 0.0);
    let mut columns = vec![sign.clone(), rows.velocity.clone()];
    if peak > 0.0 {
        columns.push(rows.map(|at| sign[at] * (-(rows.velocity[at] / peak).powi(2)).exp()));
    }
    for part in rigid_body {
        match *part {
            "inertia" => columns.push(rows.acceleration()),
            "gravity" => {
                if let Some(angle) = rows.quantity(Quantity::Position) {
                    columns.push(angle.iter().map(|q| q.sin()).collect());
                    columns.push(angle.iter().map(|q| q.cos()).collect());
                }
            }
            "load" => columns.extend(rows.quantity(Quantity::LoadTorque)),
            _ => columns.push(vec![1.0; rows.velocity.len()]),
        }
    }
    let words = format!(
        "travel {:.1e} of the span, Stribeck {:.2e} of the speed",
        travel / rows.span,
        peak / rows.speed
    );
    Base { travel, sign, columns, words }
}

/// Products of all columns and the torque (the last) over the rows of each fold, and over all.
struct Products {
    folds: Vec<DMatrix<f64>>,
    all: DMatrix<f64>,
}

impl Products {
    fn new(columns: &[&Column], torque: &Column, folds: &[Range<usize>]) -> Self {
        /// Rows taken at a time: they stay in the cache.
        const ROWS: usize = 2048;
        let width = columns.len() + 1;
        let product = |rows: &Range<usize>| {
            let mut sum = DMatrix::zeros(width, width);
            for from in rows.clone().step_by(ROWS) {
                let to = (from + ROWS).min(rows.end);
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

    /// Squared error of each fold when the columns were fitted on all others.
    fn left_out(&self, columns: &[usize]) -> Vec<f64> {
        let errors =
            self.folds.iter().map(|fold| squared_error(fold, &(&self.all - fold), columns));
        errors.collect()
    }
}

/// Squared error of a fit on the rows of `train` over the rows of `test`.
fn squared_error(test: &DMatrix<f64>, train: &DMatrix<f64>, columns: &[usize]) -> f64 {
    /// What is added to a diagonal of ones, so that columns which go together have an answer.
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

/// The base of the least error on the rows it was fitted to.
fn best_base(rows: &Rows, rigid_body: &[&str]) -> Base {
    let whole = 0..rows.velocity.len();
    let mut best: Option<(f64, Base)> = None;
    for travel in TRAVELS {
        for peak in PEAKS {
            let tried = base(rows, rigid_body, travel * rows.span, peak * rows.speed);
            let columns: Vec<&Column> = tried.columns.iter().collect();
            let products = Products::new(&columns, &rows.torque, std::slice::from_ref(&whole));
            let all: Vec<usize> = (0..columns.len()).collect();
            let error = squared_error(&products.all, &products.all, &all);
            if best.as_ref().is_none_or(|(least, _)| error < *least) {
                best = Some((error, tried));
            }
        }
    }
    best.map_or_else(|| base(rows, rigid_body, rows.span, 0.0), |(_, base)| base)
}

/// Mean gain of the folds, each as a share of its own error, over its standard error: runs differ in size by far
/// more than a gain does from run to run.
fn errors_of(before: &[f64], after: &[f64]) -> f64 {
    let shares = before.iter().zip(after).filter(|(b, _)| **b > 0.0);
    let shares: Vec<f64> = shares.map(|(b, a)| ((b - a) / b).max(-1.0)).collect();
    let count = shares.len() as f64;
    let mean = shares.iter().sum::<f64>() / count;
    let variance = shares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0);
    let error = (variance / count).sqrt();
    if error > 0.0 { mean / error } else { 0.0 }
}

/// A cause beside what was chosen before.
struct Tried {
    name: &'static str,
    /// Gain on rows left out, of the squared error.
    share: f64,
    /// The same over its standard error.
    errors: f64,
    after: Vec<f64>,
    columns: Vec<usize>,
}

/// Names what a log shows; `rigid_body` are the parts of the torque column that are not friction.
pub fn regression(data: &Dataset, rigid_body: &[&str]) -> Regression {
    let rows = Rows::new(data);
    let base = best_base(&rows, rigid_body);
    let causes = causes(&rows, &base, rigid_body);
    let own = base.columns.len();
    let columns: Vec<&Column> = base.columns.iter().chain(&causes.columns).collect();
    let products = Products::new(&columns, &rows.torque, &rows.folds());
    let mut chosen: Vec<usize> = (0..own).collect();
    let mut errors = products.left_out(&chosen);
    let begin: f64 = errors.iter().sum();
    let (mut named, mut heard) = (Vec::new(), Vec::new());
    while named.len() < MOST {
        let before: f64 = errors.iter().sum();
        let tried = causes.causes.iter().filter(|(name, _)| !named.contains(name));
        let tried = tried.map(|(name, places)| {
            let places = places.iter().map(|place| own + place);
            let new = places.filter(|place| !chosen.contains(place));
            let with: Vec<usize> = chosen.iter().copied().chain(new).collect();
            (*name, products.left_out(&with), with)
        });
        let mut tried: Vec<Tried> = tried
            .map(|(name, after, columns)| Tried {
                name,
                share: 1.0 - after.iter().sum::<f64>() / before,
                errors: errors_of(&errors, &after),
                after,
                columns,
            })
            .collect();
        tried.sort_by(|a, b| b.share.total_cmp(&a.share));
        if named.is_empty() {
            heard = tried.iter().take(HEARD).map(|t| (t.name, t.share, t.errors)).collect();
        }
        let passes = |t: &Tried| t.share >= LEAST_SHARE && t.errors >= LEAST_ERRORS;
        let Some(best) = tried.into_iter().find(passes) else { break };
        named.push(best.name);
        (errors, chosen) = (best.after, best.columns);
    }
    let left: f64 = errors.iter().sum();
    Regression {
        named,
        gain: if begin > 0.0 { 1.0 - (left / begin).sqrt() } else { 0.0 },
        rmse: (left / rows.velocity.len().max(1) as f64).sqrt(),
        base: base.words.clone(),
        heard,
    }
}
