//! All questions at once: products of every column with every other, block by block.
//!
//! A linear model's fit, its error on rows it has not seen, its standard errors under correlated noise,
//! its fate in a resampled log: all of them need only the products `X'X` of the columns over blocks of
//! rows. So the log is walked once, the products are kept per block, and then thousands of fits are
//! small systems of equations.
//!
//! A block is a stretch of time several times as long as the residual remembers. Blocks, not rows, are
//! the observations: neighbouring rows repeat each other.
//!
//! *Significance.* With the block's score `u_b` (what it says of the effect, all parameters of the base
//! given their say first), `T = u' V^-1 u`, `u = sum u_b`, `V = sum u_b u_b'` is large when the blocks
//! agree. Data with nothing hidden are the same log with the residual's sign flipped block by block, at
//! random: whatever the noise is, it stays, and what hangs together over blocks is gone. The
//! largest `T` among *all* candidates in such logs is what the `T` of a finding has to beat.

use super::chance::{BlockScores, Chance, probability};
use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};
use std::ops::Range;

/// Added to the diagonal of products of unit columns, as if each column were expected to explain about as
/// much as there is, and there were so many independent rows: directions the log does not determine
/// stay where the fit left them instead of running wild on rows left out.
const RIDGE: f64 = 3e-5;

/// Logs with nothing hidden that a finding is held against.
const FLIPS: usize = 400;

/// Products of some rows.
#[derive(Clone, Debug)]
pub struct Block {
    /// Index of the run the rows are of.
    pub run: usize,
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
    /// The products, block by block, of columns scaled to unit length.
    pub blocks: Vec<Block>,
    /// Their sum.
    pub total: DMatrix<f64>,
    /// What each column was divided by.
    pub length: Vec<f64>,
    /// Rows in all.
    pub rows: usize,
    folds: Vec<Vec<usize>>,
}

/// What the linear fit of a candidate beside the base says.
#[derive(Clone, Debug)]
pub struct CandidateFit {
    /// Which.
    pub candidate: usize,
    /// Coefficients of its columns, in their own units.
    pub coefficients: Vec<f64>,
    /// Fall of the sum of squares, Nm^2.
    pub gain: f64,
    /// Fall of the sum of squares on rows left out of the fit, Nm^2.
    pub gain_unseen: f64,
    /// Probability that the blocks agree so well by chance, for this candidate alone.
    pub p_alone: f64,
    /// The same for the best of all candidates, against logs with nothing hidden.
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
    let error = total.nrows() - 1;
    let n = columns.len();
    let system = system(total, columns);
    let right = DVector::from_fn(n, |i, _| total[(columns[i], error)]);
    let coefficients = Cholesky::new(system)?.solve(&right);
    let sse = total[(error, error)] - coefficients.dot(&right);
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
    /// Puts blocks together. The columns are `base` of the base, then `widths` of each candidate,
    /// then the residual.
    pub fn new(base: usize, widths: &[usize], mut blocks: Vec<Block>) -> Self {
        let mut candidates = Vec::with_capacity(widths.len());
        let mut next = base;
        for width in widths {
            candidates.push(next..next + width);
            next += width;
        }
        let size = next + 1;
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
        let folds = folds(&blocks);
        Self {
            base: (0..base).collect(),
            candidates,
            total: sum(&blocks),
            rows: blocks.iter().map(|block| block.rows).sum(),
            blocks,
            length,
            folds,
        }
    }

    fn with(&self, candidate: usize) -> Vec<usize> {
        self.base.iter().copied().chain(self.candidates[candidate].clone()).collect()
    }

    /// Sum of squares of the residual, the base refitted.
    pub fn sse(&self) -> f64 {
        fit(&self.total, &self.base).map_or(0.0, |fit| fit.sse)
    }

    /// Sum of squares on rows left out, fold by fold.
    fn unseen(&self, columns: &[usize]) -> f64 {
        let sse = |fold: &Vec<usize>| {
            let held = fold.iter().fold(
                DMatrix::zeros(self.total.nrows(), self.total.nrows()),
                |sum: DMatrix<f64>, block| sum + &self.blocks[*block].products,
            );
            let fit = fit(&(&self.total - &held), columns)?;
            Some(error_on(&held, columns, &fit.coefficients))
        };
        self.folds.iter().filter_map(sse).sum()
    }

    /// Tries every candidate. `candidates[i]`'s significance is that of the family of all.
    ///
    /// `comparisons[i]` is how many candidates the `i`-th was chosen from for its agreement with the residual.
    pub fn try_all(&self, comparisons: &[f64], seed: u64) -> Vec<CandidateFit> {
        let base = self.sse();
        let base_unseen = self.unseen(&self.base);
        let scores: Vec<_> = (0..self.candidates.len()).map(|i| self.scores(i)).collect();
        let chance = self.chance(&scores, seed);
        (0..self.candidates.len())
            .map(|candidate| {
                let columns = self.with(candidate);
                let found = fit(&self.total, &columns);
                let own = self.candidates[candidate].clone();
                let coefficients = own
                    .clone()
                    .zip(self.base.len()..)
                    .map(|(column, at)| {
                        found.as_ref().map_or(0.0, |f| f.coefficients[at] / self.length[column])
                    })
                    .collect();
                let p_alone = found.as_ref().map_or(1.0, |found| {
                    self.probability_by_blocks(candidate, found, &scores[candidate])
                });
                let p_alone = (p_alone * comparisons[candidate]).min(1.0);
                CandidateFit {
                    candidate,
                    coefficients,
                    gain: base - found.map_or(base, |f| f.sse),
                    gain_unseen: base_unseen - self.unseen(&columns),
                    p_alone,
                    p_value: chance.of(p_alone),
                    stability: 0.0,
                }
            })
            .collect()
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

    fn scores(&self, candidate: usize) -> BlockScores {
        let error = self.total.nrows() - 1;
        let own: Vec<usize> = self.candidates[candidate].clone().collect();
        let (p, k) = (self.base.len(), own.len());
        // What of the candidate's columns the base has: C = J A + rest.
        let system = system(&self.total, &self.base);
        let right = DMatrix::from_fn(p, k, |i, j| self.total[(self.base[i], own[j])]);
        let shared = Cholesky::new(system).map_or(DMatrix::zeros(p, k), |c| c.solve(&right));
        let already = fit(&self.total, &self.base);
        let per_block = self
            .blocks
            .iter()
            .map(|block| {
                // Of the residual, what the base refitted leaves.
                let left = |row: usize| {
                    let mut value = block.products[(row, error)];
                    if let Some(fit) = &already {
                        for (at, column) in self.base.iter().enumerate() {
                            value -= fit.coefficients[at] * block.products[(row, *column)];
                        }
                    }
                    value
                };
                let of_base = DVector::from_fn(p, |i, _| left(self.base[i]));
                DVector::from_fn(k, |j, _| left(own[j]) - shared.column(j).dot(&of_base))
            })
            .collect();
        BlockScores::new(per_block, shared)
    }

    /// How surely the blocks say the candidate is there, their scatter taken from the residual that is
    /// left with the candidate in: an effect that shows in a few blocks only (the fast runs, say) must
    /// not count as scatter itself.
    fn probability_by_blocks(&self, candidate: usize, found: &Fit, scores: &BlockScores) -> f64 {
        let columns = self.with(candidate);
        let error = self.total.nrows() - 1;
        let own = &columns[self.base.len()..];
        let k = own.len();
        let left = |block: &Block, row: usize| {
            let explained = columns.iter().enumerate();
            explained.fold(block.products[(row, error)], |left, (at, column)| {
                left - found.coefficients[at] * block.products[(row, *column)]
            })
        };
        let mut scatter: DMatrix<f64> = DMatrix::zeros(k, k);
        for block in &self.blocks {
            let of_base = DVector::from_fn(self.base.len(), |i, _| left(block, self.base[i]));
            let score = DVector::from_fn(k, |j, _| {
                left(block, own[j]) - scores.shared.column(j).dot(&of_base)
            });
            scatter += &score * score.transpose();
        }
        let largest = scatter.diagonal().max().max(f64::MIN_POSITIVE);
        scatter += DMatrix::identity(k, k) * (1e-9 * largest);
        let sum: DVector<f64> =
            scores.blocks.iter().fold(DVector::zeros(k), |sum, score| sum + score);
        let wald = Cholesky::new(scatter).map_or(0.0, |c| sum.dot(&c.solve(&sum)));
        let n = self.blocks.len() as f64;
        let freedom = n - k as f64;
        if freedom < 3.0 {
            return 1.0;
        }
        let ratio = wald * freedom / (k as f64 * n);
        FisherSnedecor::new(k as f64, freedom).map_or(1.0, |f| f.sf(ratio.max(0.0)))
    }

    /// As the blocks' probability, with whole runs as the observations and the residual that is left
    /// with the candidate in: what pressure does is seen once a run, if every run has one pressure. Few
    /// runs can say little: fewer than five say nothing here.
    pub fn probability_by_runs(&self, candidate: usize) -> f64 {
        let runs: std::collections::BTreeSet<usize> = self.blocks.iter().map(|b| b.run).collect();
        let own: Vec<usize> = self.candidates[candidate].clone().collect();
        let (count, k) = (runs.len(), own.len());
        if count < 5 || k > 2 || count < k + 4 {
            return 0.0;
        }
        let columns = self.with(candidate);
        let n = columns.len();
        let error = self.total.nrows() - 1;
        let Some(found) = fit(&self.total, &columns) else { return 1.0 };
        let system = system(&self.total, &columns);
        let Some(inverse) = Cholesky::new(system).map(|c| c.inverse()) else { return 1.0 };
        let mut meat: DMatrix<f64> = DMatrix::zeros(n, n);
        for run in &runs {
            let mut score: DVector<f64> = DVector::zeros(n);
            for block in self.blocks.iter().filter(|block| block.run == *run) {
                for (i, a) in columns.iter().enumerate() {
                    score[i] += block.products[(*a, error)];
                    for (j, b) in columns.iter().enumerate() {
                        score[i] -= found.coefficients[j] * block.products[(*a, *b)];
                    }
                }
            }
            meat += &score * score.transpose();
        }
        let correction = count as f64 / (count as f64 - 1.0);
        let covariance = &inverse * meat * &inverse * correction;
        let first = self.base.len();
        let own_covariance = covariance.view((first, first), (k, k)).into_owned();
        let own_value = found.coefficients.rows(first, k).into_owned();
        let Some(inverse) = Cholesky::new(own_covariance) else { return 0.0 };
        let wald = own_value.dot(&inverse.solve(&own_value));
        let freedom = (count - k) as f64;
        let ratio = wald / k as f64 * freedom / (count as f64 - 1.0);
        FisherSnedecor::new(k as f64, freedom).map_or(1.0, |f| f.sf(ratio))
    }

    fn chance(&self, scores: &[BlockScores], seed: u64) -> Chance {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut largest = Vec::with_capacity(FLIPS);
        for _ in 0..FLIPS {
            let signs: Vec<f64> = (0..self.blocks.len())
                .map(|_| if random.random::<bool>() { 1.0 } else { -1.0 })
                .collect();
            let best = scores
                .iter()
                .map(|s| {
                    let p = probability(s.agreement(Some(&signs)), s.width(), self.blocks.len());
                    -p.max(f64::MIN_POSITIVE).ln()
                })
                .fold(0.0, f64::max);
            largest.push(best);
        }
        Chance::of_largest(&largest)
    }
}

/// Fewer runs than this are too unlike each other to stand in for one another: without the only run
/// that shows the bristles, nothing is known of them.
const FOLDS_BY_RUN: usize = 8;

/// Whole runs where there are enough of them, else blocks in turn.
fn folds(blocks: &[Block]) -> Vec<Vec<usize>> {
    const MOST: usize = 8;
    let runs: std::collections::BTreeSet<usize> = blocks.iter().map(|block| block.run).collect();
    let by_run = runs.len() >= FOLDS_BY_RUN;
    let count = if by_run { runs.len().min(MOST) } else { MOST.min(blocks.len()) };
    let order: Vec<usize> = runs.into_iter().collect();
    let mut folds = vec![Vec::new(); count.max(1)];
    for (index, block) in blocks.iter().enumerate() {
        let at = if by_run {
            order.iter().position(|run| *run == block.run).unwrap_or_default()
        } else {
            index
        };
        folds[at % count.max(1)].push(index);
    }
    folds
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A log of `blocks` blocks: base column 1, candidates a (true, in the residual) and b (noise).
    fn gram(blocks: usize, size: f64, seed: u64) -> GramBlocks {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut normal = move || (0..12).map(|_| random.random_range(-0.5..0.5f64)).sum::<f64>();
        let block = |run: usize| {
            let mut products = DMatrix::zeros(4, 4);
            for _ in 0..50 {
                let (a, b) = (normal(), normal());
                let row = DVector::from_vec(vec![1.0, a, b, size * a + normal()]);
                products += &row * row.transpose();
            }
            Block { run: run / 4, products, rows: 50 }
        };
        GramBlocks::new(1, &[1, 1], (0..blocks).map(block).collect())
    }

    #[test]
    fn what_is_there_is_found_with_its_size() {
        let fits = gram(60, 0.2, 1).try_all(&[1.0, 1.0], 0);
        assert!((fits[0].coefficients[0] - 0.2).abs() < 0.06, "{:?}", fits[0]);
        assert!(fits[0].p_value < 1e-3 && fits[0].gain_unseen > 0.0, "{:?}", fits[0]);
        assert!(fits[1].p_value > 0.01, "{:?}", fits[1]);
    }

    #[test]
    fn nothing_hidden_is_seldom_significant() {
        let false_alarms = (0..200)
            .filter(|seed| {
                gram(60, 0.0, *seed).try_all(&[1.0, 1.0], *seed).iter().any(|t| t.p_value < 0.05)
            })
            .count();
        assert!((1..=24).contains(&false_alarms), "{false_alarms} of 200 at 5 %");
    }

    #[test]
    fn a_copy_of_a_column_is_confusable_and_another_is_not() {
        let mut gram = gram(40, 0.5, 3);
        assert!(gram.confusion(0, 1).0 < 0.1);
        for block in gram.blocks.iter_mut().map(|b| &mut b.products).chain([&mut gram.total]) {
            let column = block.column(1).into_owned();
            block.set_column(2, &column);
            let row = block.row(1).into_owned();
            block.set_row(2, &row);
            block[(2, 2)] = block[(1, 1)];
        }
        assert!(gram.confusion(0, 1).0 > 0.999);
    }
}
