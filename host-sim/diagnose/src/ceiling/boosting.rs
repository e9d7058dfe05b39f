//! Gradient-boosted regression trees on binned columns.
//!
//! Written here because the crates with boosting are 9 to 48 thousand lines, or have no release with a licence, for one
//! number of the report.
//!
//! Each tree has [`DEPTH`] levels. It is grown on a random sample of the rows, from histograms of the error that the earlier
//! trees leave (Friedman 2002, "Stochastic gradient boosting").

use rand::RngExt;
use rand_pcg::Pcg64;

/// Number of bins of a column.
const BINS: usize = 32;

/// Levels of a tree: the number of columns whose product it can follow.
const DEPTH: usize = 4;

/// Rows that a tree is grown on.
const ROWS_PER_TREE: usize = 3000;

/// Share of its mean error that a leaf removes.
const RATE: f32 = 0.15;

/// Weight of the prior of a leaf, in rows: it keeps leaves of few rows near zero.
const PRIOR_ROWS: f32 = 10.0;

/// Columns as bins with equal numbers of rows.
pub(super) struct BinnedColumns {
    columns: usize,
    /// Bins by rows.
    codes: Vec<u8>,
}

impl BinnedColumns {
    pub(super) fn new(columns: &[&[f64]], rows: &[usize]) -> Self {
        let mut codes = vec![0; rows.len() * columns.len()];
        for (at, column) in columns.iter().enumerate() {
            let edges = edges(rows.iter().map(|row| column[*row]).collect());
            for (place, row) in rows.iter().enumerate() {
                let bin = edges.partition_point(|edge| *edge < column[*row]);
                codes[place * columns.len() + at] = bin as u8;
            }
        }
        Self { columns: columns.len(), codes }
    }

    fn row(&self, row: usize) -> &[u8] {
        &self.codes[row * self.columns..(row + 1) * self.columns]
    }
}

/// Returns the upper edges of all bins but the last.
fn edges(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let quantile = |bin: usize| values[(bin * values.len() / BINS).min(values.len() - 1)];
    let mut edges: Vec<f64> = (1..BINS).map(quantile).collect();
    edges.dedup();
    edges
}

/// Rows above this bin of this column go right.
#[derive(Clone, Copy, Default)]
struct Threshold {
    column: usize,
    bin: u8,
}

/// Sum of weighted errors and of weights.
#[derive(Clone, Copy, Default)]
struct Sum {
    error: f32,
    weight: f32,
}

impl Sum {
    fn plus(self, other: Self) -> Self {
        Self { error: self.error + other.error, weight: self.weight + other.weight }
    }

    fn minus(self, other: Self) -> Self {
        Self { error: self.error - other.error, weight: self.weight - other.weight }
    }

    /// Returns the squared error that a leaf of these rows removes.
    fn score(self) -> f32 {
        self.error * self.error / (self.weight + PRIOR_ROWS)
    }
}

/// A regression tree whose levels are complete.
pub(super) struct Tree {
    /// Thresholds level by level, from the root.
    thresholds: Vec<Threshold>,
    leaves: Vec<f32>,
}

impl Tree {
    /// Grows a tree on a random sample of `rows`. `error` and `weight` are those of all rows.
    pub(super) fn grow(
        columns: &BinnedColumns,
        rows: &[usize],
        error: &[f32],
        weight: &[f32],
        random: &mut Pcg64,
    ) -> Self {
        let sample: Vec<usize> = (0..ROWS_PER_TREE.min(rows.len()))
            .map(|_| rows[random.random_range(0..rows.len())])
            .collect();
        let mut nodes = vec![0; sample.len()];
        let mut thresholds: Vec<Threshold> = Vec::with_capacity((1 << DEPTH) - 1);
        let mut sums = vec![Sum::default(); (1 << (DEPTH - 1)) * columns.columns * BINS];
        let of = |row: usize| Sum { error: weight[row] * error[row], weight: weight[row] };
        for level in 0..DEPTH {
            let width = columns.columns * BINS;
            sums[..width << level].fill(Sum::default());
            for (row, node) in sample.iter().zip(&nodes) {
                let of_row = of(*row);
                let of_node = &mut sums[node * width..(node + 1) * width];
                for (bins, code) in of_node.chunks_exact_mut(BINS).zip(columns.row(*row)) {
                    let bin = &mut bins[usize::from(*code)];
                    *bin = bin.plus(of_row);
                }
            }
            let first = thresholds.len();
            thresholds.extend(sums[..width << level].chunks_exact(width).map(best_threshold));
            for (row, node) in sample.iter().zip(&mut nodes) {
                *node = below(columns.row(*row), *node, thresholds[first + *node]);
            }
        }
        let mut leaves = [Sum::default(); 1 << DEPTH];
        for (row, node) in sample.iter().zip(&nodes) {
            leaves[*node] = leaves[*node].plus(of(*row));
        }
        let value = |leaf: &Sum| RATE * leaf.error / (leaf.weight + PRIOR_ROWS);
        Self { thresholds, leaves: leaves.iter().map(value).collect() }
    }

    /// Returns the prediction for a row.
    pub(super) fn predict(&self, columns: &BinnedColumns, row: usize) -> f32 {
        let codes = columns.row(row);
        let node = (0..DEPTH)
            .fold(0, |node, level| below(codes, node, self.thresholds[(1 << level) - 1 + node]));
        self.leaves[node]
    }
}

/// Returns the node of the next level in which a row of this node is.
fn below(codes: &[u8], node: usize, threshold: Threshold) -> usize {
    2 * node + usize::from(codes[threshold.column] > threshold.bin)
}

/// Returns the threshold that removes most of the squared error of a node. If none removes any, all rows stay together.
fn best_threshold(sums: &[Sum]) -> Threshold {
    let total = sums[..BINS].iter().fold(Sum::default(), |sum, bin| sum.plus(*bin));
    let together = Threshold { column: 0, bin: u8::MAX };
    let mut best = (total.score(), together);
    for (column, bins) in sums.chunks_exact(BINS).enumerate() {
        let mut left = Sum::default();
        for (bin, sum) in bins[..BINS - 1].iter().enumerate() {
            left = left.plus(*sum);
            let score = left.score() + total.minus(left).score();
            if score > best.0 {
                best = (score, Threshold { column, bin: bin as u8 });
            }
        }
    }
    best.1
}
