//! All questions at once: products of every column with every other, block by block.
//!
//! A linear model's fit, its error on rows it has not seen, its fate in a resampled log: all of them need
//! only the products `X'X` of the columns over blocks of rows. So the log is walked once, the products are
//! kept per block, and then thousands of fits are small systems of equations.
//!
//! A block is a stretch of time several times as long as the residual remembers. Blocks, not rows, are
//! the observations: neighbouring rows repeat each other.
//!
//! *Unseen rows.* Every block is judged by a fit that has not seen it, in two ways ([`LeftOut`]). Where an eighth of
//! every run is left out at a time, a cause must *describe* what happens within the runs it was fitted on;
//! where whole runs are left out, it must *extrapolate* to runs that no fit has used. A covariate that is constant in
//! each of a few runs can only be shown to describe.

use super::error_reduction::ErrorReduction;
use super::thresholds::{ALIKE, BETTER};
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::ops::Range;

/// Added to the diagonal of products of unit columns, as if each column were expected to explain about as
/// much as there is, and there were so many independent rows: directions the log does not determine
/// stay where the fit left them instead of running wild on rows left out.
const RIDGE: f64 = 3e-5;

/// Into so many stretches, one behind the other, the rows of each run are cut; one of each is left out at a time.
pub const STRETCHES: usize = 8;

/// Most groups of runs that are left out, one after the other: with more runs, several go together.
pub const MOST_GROUPS: usize = 16;

/// What is left out of a fit at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeftOut {
    /// A stretch of every run: shows whether a model describes.
    Stretches,
    /// Whole runs: shows whether it extrapolates.
    Runs,
}

/// Products of some rows.
#[derive(Clone, Debug)]
pub struct Block {
    /// Index of the run the rows are of.
    pub run: usize,
    /// Which of the run's stretches they lie in, below [`STRETCHES`].
    pub stretch: usize,
    /// Products of all columns; the last column is the residual.
    pub products: DMatrix<f64>,
    /// Number of rows.
    pub rows: usize,
}

/// The columns of a base model, of candidates, and the residual, as products.
#[derive(Clone, Debug)]
pub struct GramBlocks {
    /// Columns of the base.
    pub base: Vec<usize>,
    /// Columns of each candidate.
    pub candidates: Vec<Range<usize>>,
    /// Columns of other laws ([`super::other_laws`]).
    pub others: Range<usize>,
    /// The products, block by block, of columns scaled to unit length.
    pub blocks: Vec<Block>,
    /// Their sum.
    pub total: DMatrix<f64>,
    /// What each column was divided by.
    pub length: Vec<f64>,
    /// Rows in all.
    pub rows: usize,
    by_stretch: Vec<Fold>,
    by_run: Vec<Fold>,
}

/// Blocks that are left out together, and the sum of their products.
#[derive(Clone, Debug)]
struct Fold {
    blocks: Vec<usize>,
    held: DMatrix<f64>,
}

/// Options of a candidate's evaluation.
#[derive(Clone, Copy, Debug)]
pub struct CandidateOptions {
    /// Number of alternatives it was chosen from by its agreement with the residual.
    pub comparisons: f64,
    /// True if the more certain of two block weightings may be used ([`ErrorReduction::block_weighted_error`]).
    pub block_weighted: bool,
}

/// What the linear fit of a candidate beside the base says.
#[derive(Clone, Debug, Default)]
pub struct CandidateFit {
    /// Which.
    pub candidate: usize,
    /// Coefficients of its columns, in their own units.
    pub coefficients: Vec<f64>,
    /// Change of each free parameter of the base beside it.
    pub base_change: Vec<f64>,
    /// Reduction of the sum of squares, Nm^2.
    pub gain: f64,
    /// Reduction of the sum of squares on held-out stretches.
    pub unseen: ErrorReduction,
    /// Reduction on held-out runs; `None` if there are fewer than three runs.
    pub unseen_runs: Option<ErrorReduction>,
    /// Probability that the best of all candidates gains so much on unseen rows where nothing is hidden.
    pub p_value: f64,
    /// Share of the resampled logs in which it has the largest gain; set by [`GramBlocks::stability`].
    pub stability: f64,
}

/// A fit of some columns to the residual.
struct Fit {
    coefficients: DVector<f64>,
    sse: f64,
}

/// Products of some columns with each other, held by the ridge.
fn system(total: &DMatrix<f64>, columns: &[usize]) -> DMatrix<f64> {
    let n = columns.len();
    DMatrix::from_fn(n, n, |i, j| {
        total[(columns[i], columns[j])] + if i == j { RIDGE } else { 0.0 }
    })
}

fn fit(total: &DMatrix<f64>, columns: &[usize]) -> Option<Fit> {
    fit_to(&|i, j| total[(i, j)], total.nrows() - 1, columns)
}

/// Fits columns to the column `error`, whose products are given.
fn fit_to(products: &impl Fn(usize, usize) -> f64, error: usize, columns: &[usize]) -> Option<Fit> {
    let n = columns.len();
    let ridge = |i: usize, j: usize| if i == j { RIDGE } else { 0.0 };
    let system = DMatrix::from_fn(n, n, |i, j| products(columns[i], columns[j]) + ridge(i, j));
    let right = DVector::from_fn(n, |i, _| products(columns[i], error));
    let coefficients = Cholesky::new(system)?.solve(&right);
    let sse = products(error, error) - coefficients.dot(&right);
    Some(Fit { coefficients, sse })
}

/// Sum of squares on rows with these products, of coefficients found elsewhere.
fn error_on(products: &DMatrix<f64>, columns: &[usize], coefficients: &DVector<f64>) -> f64 {
    let error = products.nrows() - 1;
    let mut sse = products[(error, error)];
    for (i, a) in columns.iter().enumerate() {
        sse -= 2.0 * coefficients[i] * products[(*a, error)];
        for (j, b) in columns.iter().enumerate() {
            sse += coefficients[i] * coefficients[j] * products[(*a, *b)];
        }
    }
    sse
}

impl GramBlocks {
    /// Puts blocks together. The columns are `base` of the base, then `widths` of each candidate, then those of other laws,
    /// then the residual.
    pub fn new(base: usize, widths: &[usize], mut blocks: Vec<Block>) -> Self {
        let mut candidates = Vec::with_capacity(widths.len());
        let mut next = base;
        for width in widths {
            candidates.push(next..next + width);
            next += width;
        }
        let size = blocks.first().map_or(next + 1, |block| block.products.nrows());
        let sum = |blocks: &[Block]| {
            blocks.iter().fold(DMatrix::zeros(size, size), |sum, block| sum + &block.products)
        };
        let raw: DMatrix<f64> = sum(&blocks);
        let mut length: Vec<f64> = raw.diagonal().iter().map(|d| d.max(0.0).sqrt()).collect();
        // The residual keeps its unit: gains are in it.
        length[size - 1] = 1.0;
        for l in &mut length {
            if *l == 0.0 {
                *l = 1.0;
            }
        }
        for block in &mut blocks {
            block.products = DMatrix::from_fn(size, size, |i, j| {
                block.products[(i, j)] / (length[i] * length[j])
            });
        }
        let stretch = |block: &Block| block.stretch;
        let runs: std::collections::BTreeSet<usize> = blocks.iter().map(|b| b.run).collect();
        let place: Vec<usize> = runs.into_iter().collect();
        let group =
            |block: &Block| place.binary_search(&block.run).unwrap_or_default() % MOST_GROUPS;
        let by_run = folds(&blocks, place.len().min(MOST_GROUPS), group);
        let mut by_stretch = folds(&blocks, STRETCHES, stretch);
        // Of short runs with a long memory each is one block, all in the middle stretch: left out together they would leave
        // nothing to fit on, and no cause would gain anything. Such runs are left out instead.
        let held = |fold: &Fold| fold.blocks.iter().map(|block| blocks[*block].rows).sum::<usize>();
        let all: usize = blocks.iter().map(|block| block.rows).sum();
        if by_run.len() > 1 && by_stretch.iter().any(|fold| 2 * held(fold) > all) {
            by_stretch.clone_from(&by_run);
        }
        Self {
            by_stretch,
            by_run,
            base: (0..base).collect(),
            candidates,
            others: next..size - 1,
            total: sum(&blocks),
            rows: blocks.iter().map(|block| block.rows).sum(),
            blocks,
            length,
        }
    }

    fn with(&self, candidate: usize) -> Vec<usize> {
        self.base.iter().copied().chain(self.candidates[candidate].clone()).collect()
    }

    /// Sum of squares of the residual, the base refitted.
    pub fn sse(&self) -> f64 {
        fit(&self.total, &self.base).map_or(0.0, |fit| fit.sse)
    }

    /// Squared error of every block, the columns fitted on blocks that were not left out with it.
    fn unseen(&self, columns: &[usize], left_out: LeftOut) -> Vec<f64> {
        self.unseen_from(columns, left_out, None)
    }

    /// The same with coefficients counted from `origin`.
    fn unseen_from(
        &self,
        columns: &[usize],
        left_out: LeftOut,
        origin: Option<&DVector<f64>>,
    ) -> Vec<f64> {
        let mut errors = vec![0.0; self.blocks.len()];
        let folds = match left_out {
            LeftOut::Stretches => &self.by_stretch,
            LeftOut::Runs => &self.by_run,
        };
        for fold in folds {
            let without = |i: usize, j: usize| self.total[(i, j)] - fold.held[(i, j)];
            let fit = fit_to(&without, self.total.nrows() - 1, columns).map(|mut fit| {
                if let Some(origin) = origin {
                    fit.coefficients -= origin;
                }
                fit
            });
            for block in &fold.blocks {
                let products = &self.blocks[*block].products;
                let last = products.nrows() - 1;
                errors[*block] = match &fit {
                    Some(fit) => error_on(products, columns, &fit.coefficients),
                    None => products[(last, last)],
                };
            }
        }
        errors
    }

    /// How many runs there are, or groups of them.
    pub fn groups(&self) -> usize {
        self.by_run.len()
    }

    /// The squared error of every block of a model that has been fitted, its derivatives being the base: to first
    /// order, how far would a fit without the block lie off? Where the model is not at its optimum, the step it
    /// has not taken is not counted as taken.
    pub fn model_unseen(&self, left_out: LeftOut) -> Vec<f64> {
        let open = fit(&self.total, &self.base).map(|fit| fit.coefficients);
        self.unseen_from(&self.base, left_out, open.as_ref())
    }

    /// Sums what blocks say over the runs they are of.
    pub fn per_group(&self, by_block: &[f64]) -> Vec<f64> {
        let sum = |fold: &Fold| fold.blocks.iter().map(|block| by_block[*block]).sum();
        self.by_run.iter().map(sum).collect()
    }

    /// Tries every candidate, each with its `options`; a probability pays for all of them.
    pub fn try_all(&self, options: &[CandidateOptions]) -> Vec<CandidateFit> {
        let base = self.sse();
        let stretches = self.unseen(&self.base, LeftOut::Stretches);
        let runs = self.unseen(&self.base, LeftOut::Runs);
        let runs = (self.groups() >= 3).then(|| self.per_group(&runs));
        let all = self.candidates.len() as f64;
        (0..self.candidates.len())
            .map(|candidate| {
                let columns = self.with(candidate);
                let found = fit(&self.total, &columns);
                let own = self.candidates[candidate].clone();
                let width = own.len();
                let coefficients = own
                    .zip(self.base.len()..)
                    .map(|(column, at)| {
                        found.as_ref().map_or(0.0, |f| f.coefficients[at] / self.length[column])
                    })
                    .collect();
                let base_change = (0..self.base.len())
                    .map(|at| found.as_ref().map_or(0.0, |f| f.coefficients[at] / self.length[at]))
                    .collect();
                let after = self.unseen(&columns, LeftOut::Stretches);
                let CandidateOptions { comparisons, block_weighted } = options[candidate];
                let weigh = |fall: ErrorReduction| {
                    if block_weighted { fall.block_weighted_error() } else { fall }
                };
                let unseen = weigh(ErrorReduction::between(&stretches, &after));
                let unseen_runs = runs.as_ref().map(|before| {
                    let after = self.per_group(&self.unseen(&columns, LeftOut::Runs));
                    weigh(ErrorReduction::between(before, &after))
                });
                CandidateFit {
                    candidate,
                    coefficients,
                    base_change,
                    gain: base - found.map_or(base, |f| f.sse),
                    unseen,
                    unseen_runs,
                    p_value: unseen.probability(width, all * comparisons),
                    stability: 0.0,
                }
            })
            .collect()
    }

    /// Returns the sum of squares of the residual with the base refitted beside the columns of other laws.
    pub fn sse_beside_other_laws(&self) -> f64 {
        let laws: Vec<usize> = self.base.iter().copied().chain(self.others.clone()).collect();
        fit(&self.total, &laws).map_or_else(|| self.sse(), |fit| fit.sse)
    }

    /// By how much a candidate is better on stretches left out where laws of other shapes have taken theirs.
    pub fn beside_other_laws(&self, candidate: usize) -> ErrorReduction {
        let laws: Vec<usize> = self.base.iter().copied().chain(self.others.clone()).collect();
        let both: Vec<usize> =
            laws.iter().copied().chain(self.candidates[candidate].clone()).collect();
        let unseen = |columns: &[usize]| self.unseen(columns, LeftOut::Stretches);
        ErrorReduction::between(&unseen(&laws), &unseen(&both))
    }

    /// Share of the candidate's effect another one can take over: 1 where no data of this kind
    /// could tell them apart, and by how many standard errors of blocks the candidate is better.
    pub fn confusion(&self, candidate: usize, other: usize) -> (f64, f64) {
        let (mine, theirs) = (self.with(candidate), self.with(other));
        let Some(found) = fit(&self.total, &mine) else { return (0.0, f64::INFINITY) };
        let own: Vec<usize> = self.candidates[candidate].clone().collect();
        let size = self.total.nrows();
        // The effect as a column: its products with every other column.
        let effect = DVector::from_fn(size, |row, _| {
            own.iter()
                .zip(self.base.len()..)
                .map(|(column, at)| found.coefficients[at] * self.total[(row, *column)])
                .sum()
        });
        let power: f64 = own
            .iter()
            .zip(self.base.len()..)
            .map(|(column, at)| found.coefficients[at] * effect[*column])
            .sum();
        let left = |columns: &[usize]| -> f64 {
            let n = columns.len();
            let system = system(&self.total, columns);
            let right = DVector::from_fn(n, |i, _| effect[columns[i]]);
            let solved = Cholesky::new(system).map(|c| c.solve(&right));
            power - solved.map_or(0.0, |s| s.dot(&right))
        };
        let (alone, with_other) = (left(&self.base), left(&theirs));
        let share = if alone > 0.0 { 1.0 - (with_other / alone).clamp(0.0, 1.0) } else { 1.0 };
        let Some(rival) = fit(&self.total, &theirs) else { return (share, f64::INFINITY) };
        let differences: Vec<f64> = self
            .blocks
            .iter()
            .map(|block| {
                error_on(&block.products, &theirs, &rival.coefficients)
                    - error_on(&block.products, &mine, &found.coefficients)
            })
            .collect();
        let n = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / n;
        let variance =
            differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let error = (variance / n).sqrt();
        (share, if error > 0.0 { mean / error } else { f64::INFINITY })
    }

    /// The share of the candidate's effect another one can take over, where that is so much, and the candidate so
    /// little better, that the log does not tell them apart.
    pub fn alike(&self, candidate: usize, other: usize) -> Option<f64> {
        /// Shared part of the effect above which two causes count as identical, whatever the noise is.
        const INDISTINGUISHABLE_SHARE: f64 = 0.995;
        let (share, better) = self.confusion(candidate, other);
        (share > INDISTINGUISHABLE_SHARE || (share > ALIKE && better < BETTER)).then_some(share)
    }

    /// In what share of resampled logs each candidate has the largest gain; `weight` scales a gain
    /// before it is compared.
    pub fn stability(
        &self,
        resamples: usize,
        seed: u64,
        weight: impl Fn(usize) -> f64,
    ) -> Vec<f64> {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut wins = vec![0.0; self.candidates.len()];
        let size = self.total.nrows();
        for _ in 0..resamples {
            let mut total = DMatrix::zeros(size, size);
            for _ in 0..self.blocks.len() {
                total += &self.blocks[random.random_range(0..self.blocks.len())].products;
            }
            let base = fit(&total, &self.base).map_or(0.0, |f| f.sse);
            let best = (0..self.candidates.len())
                .filter_map(|c| {
                    let gain = base - fit(&total, &self.with(c))?.sse;
                    Some((c, gain * weight(c)))
                })
                .max_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((best, _)) = best {
                wins[best] += 1.0 / resamples.max(1) as f64;
            }
        }
        wins
    }
}

/// Blocks by what they are left out with.
fn folds(blocks: &[Block], count: usize, place: impl Fn(&Block) -> usize) -> Vec<Fold> {
    let size = blocks.first().map_or(0, |block| block.products.nrows());
    let empty = || Fold { blocks: Vec::new(), held: DMatrix::zeros(size, size) };
    let mut folds: Vec<Fold> = (0..count).map(|_| empty()).collect();
    for (index, block) in blocks.iter().enumerate() {
        let fold = &mut folds[place(block)];
        fold.blocks.push(index);
        fold.held += &block.products;
    }
    folds.retain(|fold| !fold.blocks.is_empty());
    folds
}

#[cfg(test)]
mod tests;
