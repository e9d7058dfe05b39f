//! Products of all columns of one correction and law, block by block, and the held-out error of any set of them.
//!
//! Least squares needs the products `X'X`, `X'y` and `y'y` alone. They add up over blocks, so a fold is left out by a
//! subtraction, and a set of causes is a choice of rows and columns of one matrix:
//!
//! ```text
//! error of fold f = y'y(f) - 2 b'X'y(f) + b'X'X(f) b,    b = (X'X - X'X(f))^-1 (X'y - X'y(f))
//! ```
//!
//! One pass over the rows serves every hypothesis of the bank; a score takes some tens of microseconds whatever the length of
//! the log. Columns are scaled to an RMS of one, and a ridge of 1e-6 keeps dependent columns finite.

use super::rows::Rows;
use super::solve::{LANES, Lanes, dot, lanes, solve_in_place};
use joint_log::work::checkpoint;
use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ops::Range;

/// Ridge relative to the mean of the diagonal.
const RIDGE: f64 = 1e-6;

/// Rows whose products are computed at once: they fit into a processor's cache.
const ROWS_AT_ONCE: usize = 128;

/// The products of all columns, the torque last: `X'X`, `X'y` and `y'y` in one symmetric matrix.
#[derive(Clone, Debug)]
pub struct Bank {
    scale: Vec<f64>,
    /// True for a column whose coefficient cannot be negative, such as a friction level.
    non_negative: Vec<bool>,
    blocks: Vec<DMatrix<f64>>,
    total: DMatrix<f64>,
    /// Products over the rows of each fold, [`LANES`] folds side by side. At least one lane has no rows.
    folds: Vec<Vec<Lanes>>,
    fold_count: usize,
    fold_of: Vec<usize>,
}

/// Buffers of a solution.
#[derive(Clone, Debug, Default)]
pub struct Workspace {
    matrix: Vec<Lanes>,
    /// Coefficients without each fold, for each group of folds.
    coefficients: Vec<Vec<Lanes>>,
}

impl Bank {
    /// Computes the products of columns, given in all rows of the log, over the judged rows.
    pub fn new(rows: &Rows, columns: &[impl AsRef<[f64]> + Sync]) -> Self {
        Self::of_target(rows, columns, &rows.torque, &rows.fold_of_block)
    }

    /// Computes the products for another target, in all rows, and other folds of the blocks.
    pub fn of_target(
        rows: &Rows,
        columns: &[impl AsRef<[f64]> + Sync],
        target: &[f64],
        fold_of_block: &[usize],
    ) -> Self {
        let size = columns.len() + 1;
        let scale: Vec<f64> = columns.par_iter().map(|column| rms(rows, column.as_ref())).collect();
        let scaled = columns.iter().zip(&scale);
        let scaled =
            scaled.map(|(column, scale)| Scaled { column: column.as_ref(), by: 1.0 / scale });
        let scaled: Vec<Scaled> = scaled.chain([Scaled { column: target, by: 1.0 }]).collect();
        let block = |judged: &Range<usize>| products(rows, &scaled, judged.clone());
        let blocks: Vec<DMatrix<f64>> = rows.blocks.par_iter().map(block).collect();
        let fold_count = fold_of_block.iter().max().map_or(0, |most| most + 1);
        let mut total = DMatrix::zeros(size, size);
        let mut sums = vec![DMatrix::zeros(size, size); fold_count];
        for (fold, block) in fold_of_block.iter().zip(&blocks) {
            total += block;
            sums[*fold] += block;
        }
        let at = |fold: usize, index: usize| sums.get(fold).map_or(0.0, |sum| sum[index]);
        let group = |group: usize| {
            let lane = |index: usize| lanes(|lane| at(group * LANES + lane, index));
            (0..size * size).map(lane).collect()
        };
        let folds = (0..=fold_count / LANES).map(group).collect();
        let fold_of = fold_of_block.to_vec();
        let non_negative = vec![false; columns.len()];
        Self { scale, non_negative, blocks, total, folds, fold_count, fold_of }
    }

    /// Sets which of the first columns cannot have a negative coefficient. A column that would have one is left out.
    #[must_use]
    pub fn with_non_negative(mut self, first: impl IntoIterator<Item = bool>) -> Self {
        self.non_negative
            .iter_mut()
            .zip(first)
            .for_each(|(is_non_negative, value)| *is_non_negative = value);
        self
    }

    /// Returns the held-out squared error of some columns. Their coefficients are then those of [`Self::sizes`].
    pub fn error(&self, columns: &[usize], work: &mut Workspace) -> f64 {
        self.solve(columns, work);
        let groups = self.folds.iter().zip(&work.coefficients);
        groups
            .flat_map(|(fold, coefficients)| {
                square_errors(fold, self.stride(), columns, coefficients)
            })
            .sum()
    }

    /// Returns the held-out squared error of some columns in every block.
    pub fn block_errors(&self, columns: &[usize]) -> Vec<f64> {
        let mut work = Workspace::default();
        self.solve(columns, &mut work);
        let error = |(block, fold): (&DMatrix<f64>, &usize)| {
            let coefficients = &work.coefficients[fold / LANES];
            let coefficients: Vec<[f64; 1]> =
                coefficients.iter().map(|lanes| [lanes[fold % LANES]]).collect();
            let products = block.as_slice().as_chunks().0;
            square_errors(products, self.stride(), columns, &coefficients)[0]
        };
        self.blocks.iter().zip(&self.fold_of).map(error).collect()
    }

    /// Returns the coefficients of some columns, fitted to all rows, in the columns' own units.
    pub fn fit(&self, columns: &[usize]) -> Vec<f64> {
        let mut work = Workspace::default();
        self.solve(columns, &mut work);
        self.sizes(columns, &work)
    }

    /// Returns the coefficients of the columns that were evaluated last, fitted to all rows, in the columns' own units.
    pub fn sizes(&self, columns: &[usize], work: &Workspace) -> Vec<f64> {
        self.sizes_without(self.fold_count, columns, work)
    }

    /// Returns the coefficients of some columns, fitted without each fold, in the columns' own units.
    pub fn fits_without_fold(&self, columns: &[usize]) -> Vec<Vec<f64>> {
        let mut work = Workspace::default();
        self.solve(columns, &mut work);
        (0..self.fold_count).map(|fold| self.sizes_without(fold, columns, &work)).collect()
    }

    fn sizes_without(&self, fold: usize, columns: &[usize], work: &Workspace) -> Vec<f64> {
        let coefficients = columns.iter().zip(&work.coefficients[fold / LANES]);
        coefficients.map(|(column, lanes)| lanes[fold % LANES] / self.scale[*column]).collect()
    }

    fn stride(&self) -> usize {
        self.total.nrows()
    }

    /// Solves for the coefficients of some columns without each fold. Those that would be negative and cannot be are 0: the
    /// most negative column is left out of all folds, and the rest is solved again.
    fn solve(&self, columns: &[usize], work: &mut Workspace) {
        self.solve_all(columns, work);
        if !columns.iter().any(|column| self.non_negative[*column]) {
            return;
        }
        let mut kept: Vec<usize> = (0..columns.len()).collect();
        let (group, lane) = (self.fold_count / LANES, self.fold_count % LANES);
        loop {
            let coefficients = &work.coefficients[group];
            let size = |at: &usize| coefficients[*at][lane];
            let negative = (0..kept.len())
                .filter(|at| self.non_negative[columns[kept[*at]]] && size(at) < 0.0);
            let Some(most) = negative.min_by(|a, b| size(a).total_cmp(&size(b))) else { break };
            kept.remove(most);
            let columns: Vec<usize> = kept.iter().map(|at| columns[*at]).collect();
            self.solve_all(&columns, work);
        }
        if kept.len() < columns.len() {
            for coefficients in &mut work.coefficients {
                let mut all = vec![lanes(|_| 0.0); columns.len()];
                kept.iter().zip(coefficients.iter()).for_each(|(at, value)| all[*at] = *value);
                *coefficients = all;
            }
        }
    }

    /// Solves for the coefficients of some columns of any sign without each fold.
    fn solve_all(&self, columns: &[usize], work: &mut Workspace) {
        checkpoint();
        let (size, stride) = (columns.len(), self.stride());
        let total = self.total.as_slice();
        let mean: f64 =
            columns.iter().map(|c| total[c * stride + c]).sum::<f64>() / size.max(1) as f64;
        work.matrix.resize(size * size, lanes(|_| 0.0));
        work.coefficients.resize(self.folds.len(), Vec::new());
        for (fold, right) in self.folds.iter().zip(&mut work.coefficients) {
            let without = |index: usize| lanes(|lane| total[index] - fold[index][lane]);
            right.clear();
            for (i, a) in columns.iter().enumerate() {
                let row = &mut work.matrix[i * size..=i * size + i];
                for (value, b) in row.iter_mut().zip(columns) {
                    *value = without(a * stride + b);
                }
                row[i].iter_mut().for_each(|value| *value += RIDGE * mean);
                right.push(without(a * stride + stride - 1));
            }
            solve_in_place(&mut work.matrix, right, size);
        }
    }
}

/// Returns the squared errors of coefficients on some products.
fn square_errors<const L: usize>(
    products: &[[f64; L]],
    stride: usize,
    columns: &[usize],
    coefficients: &[[f64; L]],
) -> [f64; L] {
    let mut error = products[stride * stride - 1];
    for (i, a) in columns.iter().enumerate() {
        let row = &products[a * stride..(a + 1) * stride];
        let coefficient = coefficients[i];
        let mut sum: [f64; L] =
            lanes(|lane| 0.5 * row[*a][lane] * coefficient[lane] - row[stride - 1][lane]);
        for (b, other) in columns[..i].iter().zip(coefficients) {
            sum = lanes(|lane| sum[lane] + row[*b][lane] * other[lane]);
        }
        error = lanes(|lane| error[lane] + 2.0 * coefficient[lane] * sum[lane]);
    }
    error.map(|error| error.max(0.0))
}

fn rms(rows: &Rows, column: &[f64]) -> f64 {
    let squares = match rows.judged_range(0..rows.judged.len()) {
        Some(range) => dot(&column[range.clone()], &column[range]),
        None => rows.judged.iter().map(|row| rows.judged_value(column, *row).powi(2)).sum(),
    };
    (squares / rows.judged.len().max(1) as f64).sqrt() + 1e-300
}

/// A column, and what its values are multiplied by.
struct Scaled<'a> {
    column: &'a [f64],
    by: f64,
}

/// Returns the products of scaled columns over some judged rows.
fn products(rows: &Rows, columns: &[Scaled], judged: Range<usize>) -> DMatrix<f64> {
    let size = columns.len();
    let mut sum = DMatrix::zeros(size, size);
    let mut values = Vec::new();
    for from in judged.clone().step_by(ROWS_AT_ONCE) {
        checkpoint();
        let part = from..(from + ROWS_AT_ONCE).min(judged.end);
        let judged_rows = &rows.judged[part.clone()];
        let weights: Vec<f64> = judged_rows.iter().map(|row| rows.weights[*row]).collect();
        let range = rows.judged_range(part);
        values.clear();
        for Scaled { column, by } in columns {
            match &range {
                Some(range) => {
                    let weighted = column[range.clone()].iter().zip(&weights);
                    values.extend(weighted.map(|(value, weight)| value * weight * by));
                }
                None => values.extend(
                    judged_rows
                        .iter()
                        .zip(&weights)
                        .map(|(row, weight)| rows.judged_value(column, *row) * weight * by),
                ),
            }
        }
        let wide = DMatrix::from_column_slice(judged_rows.len(), size, &values);
        sum.gemm(1.0, &wide.transpose(), &wide, 1.0);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contest::rows::tests::example;

    /// Least squares by hand on the rows outside a fold, and its squared error inside.
    fn refit(rows: &Rows, columns: &[&[f64]], fold: usize) -> f64 {
        let inside = |block: usize| rows.fold_of_block[block] == fold;
        let (mut gram, mut right) = (DMatrix::<f64>::zeros(2, 2), DMatrix::<f64>::zeros(2, 1));
        let each = |mut f: Box<dyn FnMut(usize, bool) + '_>| {
            for (block, judged) in rows.blocks.iter().enumerate() {
                rows.judged[judged.clone()].iter().for_each(|row| f(*row, inside(block)));
            }
        };
        each(Box::new(|row, inside| {
            let w = rows.weights[row].powi(2);
            for a in 0..2 {
                right[(a, 0)] += if inside { 0.0 } else { w * columns[a][row] * rows.torque[row] };
                for b in 0..2 {
                    gram[(a, b)] +=
                        if inside { 0.0 } else { w * columns[a][row] * columns[b][row] };
                }
            }
        }));
        let solution = gram.lu().solve(&right).unwrap();
        let mut error = 0.0f64;
        each(Box::new(|row, inside| {
            let e: f64 = rows.torque[row]
                - solution[(0, 0)] * columns[0][row]
                - solution[(1, 0)] * columns[1][row];
            error += if inside { (rows.weights[row] * e).powi(2) } else { 0.0 };
        }));
        error
    }

    #[test]
    fn error_by_subtraction_equals_a_refit_without_the_fold() {
        let rows = example();
        let squares: Vec<f64> = rows.velocity.iter().map(|v| v * v.abs()).collect();
        let columns: [&[f64]; 3] = [&rows.velocity, &rows.acceleration, &squares];
        let bank = Bank::new(&rows, &columns);
        let folds = rows.fold_count();
        let expected: f64 =
            (0..folds).map(|fold| refit(&rows, &[&rows.velocity, &squares], fold)).sum();
        let mut work = Workspace::default();
        let found = bank.error(&[0, 2], &mut work);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
        let blocks = bank.block_errors(&[0, 2]);
        assert!((blocks.iter().sum::<f64>() / found - 1.0).abs() < 1e-9);
    }
}
