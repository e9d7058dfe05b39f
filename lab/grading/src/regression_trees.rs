//! Gradient-boosted regression trees on binned columns: a bound of what a log's columns can explain.
//!
//! Each tree is fitted to the residual of the trees before it (Friedman 2001). Values are replaced by the index of their bin, and
//! the leaf whose split reduces the squared error most is split next (as in LightGBM and scikit-learn). Sums over bins are
//! counted for the smaller child only; those of the larger child are the difference to the parent.

/// Number of trees.
const TREES: usize = 300;

/// Share of a tree's leaf values that counts.
const RATE: f64 = 0.06;

/// Most leaves of a tree.
const LEAVES: usize = 31;

/// Fewest rows in a leaf.
const MIN_ROWS: u32 = 40;

/// Most bins of a column.
const BINS: usize = 255;

/// Node of a tree: a split (rows below the limit go to the first child), or a leaf.
enum Node {
    Split { column: usize, below: f64, children: [usize; 2] },
    Leaf(f64),
}

/// Fitted trees.
pub(crate) struct RegressionTrees {
    start: f64,
    trees: Vec<Vec<Node>>,
}

/// Columns as bins.
struct Binned {
    /// Upper limits of the bins of each column, ascending. A value belongs to the first bin whose limit is above it.
    limits: Vec<Vec<f64>>,
    bins: Vec<Vec<u8>>,
}

/// Sum of residuals and number of rows.
#[derive(Clone, Copy, Default)]
struct Sums {
    residual: f64,
    rows: u32,
}

impl Sums {
    fn minus(self, part: Self) -> Self {
        Self { residual: self.residual - part.residual, rows: self.rows - part.rows }
    }

    /// Returns by how much the mean of these rows reduces the squared error.
    fn reduction(self) -> f64 {
        self.residual * self.residual / f64::from(self.rows.max(1))
    }
}

/// A leaf while the tree grows.
struct Growing {
    node: usize,
    rows: Vec<u32>,
    sums: Sums,
    /// Sums of each bin, of one column after the other.
    histogram: Vec<Sums>,
    best: Option<BestSplit>,
}

struct BestSplit {
    column: usize,
    bin: usize,
    gain: f64,
}

impl RegressionTrees {
    /// Fits trees to a target; `columns` have its length.
    pub fn fit(columns: &[Vec<f64>], target: &[f64]) -> Self {
        let binned = Binned::new(columns);
        let start = target.iter().sum::<f64>() / target.len().max(1) as f64;
        let mut residual: Vec<f64> = target.iter().map(|value| value - start).collect();
        let trees = (0..TREES).map(|_| grow(&binned, &mut residual)).collect();
        Self { start, trees }
    }

    /// Returns the prediction of a row of the columns.
    pub fn predict(&self, columns: &[Vec<f64>], row: usize) -> f64 {
        let of_tree = |nodes: &Vec<Node>| {
            let mut at = 0;
            loop {
                match &nodes[at] {
                    Node::Leaf(value) => return *value,
                    Node::Split { column, below, children } => {
                        at = children[usize::from(columns[*column][row] >= *below)];
                    }
                }
            }
        };
        self.start + self.trees.iter().map(of_tree).sum::<f64>()
    }
}

impl Binned {
    fn new(columns: &[Vec<f64>]) -> Self {
        let limits: Vec<Vec<f64>> = columns.iter().map(|column| bin_limits(column)).collect();
        let bins = columns.iter().zip(&limits).map(|(column, limits)| {
            let bin = |value: &f64| limits.partition_point(|limit| limit <= value) as u8;
            column.iter().map(bin).collect()
        });
        let bins = bins.collect();
        Self { limits, bins }
    }

    fn histogram(&self, rows: &[u32], residual: &[f64]) -> Vec<Sums> {
        let mut sums = vec![Sums::default(); self.bins.len() * BINS];
        for (bins, sums) in self.bins.iter().zip(sums.chunks_exact_mut(BINS)) {
            for row in rows {
                let sum = &mut sums[usize::from(bins[*row as usize])];
                sum.residual += residual[*row as usize];
                sum.rows += 1;
            }
        }
        sums
    }

    fn best_split(&self, histogram: &[Sums], all: Sums) -> Option<BestSplit> {
        let mut best: Option<BestSplit> = None;
        for (column, sums) in histogram.chunks_exact(BINS).enumerate() {
            let mut below = Sums::default();
            for (bin, bin_sums) in sums.iter().enumerate().take(self.limits[column].len()) {
                below.residual += bin_sums.residual;
                below.rows += bin_sums.rows;
                let above = all.minus(below);
                if below.rows < MIN_ROWS || above.rows < MIN_ROWS {
                    continue;
                }
                let gain = below.reduction() + above.reduction() - all.reduction();
                if gain > best.as_ref().map_or(1e-12 * all.reduction(), |best| best.gain) {
                    best = Some(BestSplit { column, bin, gain });
                }
            }
        }
        best
    }
}

/// Returns limits halfway between neighbouring distinct values. Of more than [`BINS`] values it takes as many quantiles, so that
/// about equally many rows lie between two limits.
fn bin_limits(column: &[f64]) -> Vec<f64> {
    let mut values = column.to_vec();
    values.sort_by(f64::total_cmp);
    let mut distinct = values.clone();
    distinct.dedup();
    if distinct.len() > BINS {
        distinct = (0..BINS).map(|at| values[at * (values.len() - 1) / (BINS - 1)]).collect();
        distinct.dedup();
    }
    distinct.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect()
}

/// Grows one tree and subtracts it from the residual.
fn grow(binned: &Binned, residual: &mut [f64]) -> Vec<Node> {
    let leaf = |node, rows: Vec<u32>, histogram: Vec<Sums>, residual: &[f64]| {
        let all = rows.iter().map(|row| residual[*row as usize]).sum();
        let sums = Sums { residual: all, rows: rows.len() as u32 };
        Growing { node, best: binned.best_split(&histogram, sums), rows, sums, histogram }
    };
    let rows: Vec<u32> = (0..residual.len() as u32).collect();
    let histogram = binned.histogram(&rows, residual);
    let mut nodes = vec![Node::Leaf(0.0)];
    let mut leaves = vec![leaf(0, rows, histogram, residual)];
    while leaves.len() < LEAVES {
        let gain = |leaf: &Growing| leaf.best.as_ref().map_or(0.0, |best| best.gain);
        let most = (0..leaves.len()).max_by(|a, b| gain(&leaves[*a]).total_cmp(&gain(&leaves[*b])));
        let Some(at) = most.filter(|at| gain(&leaves[*at]) > 0.0) else { break };
        let mut parent = leaves.swap_remove(at);
        let Some(BestSplit { column, bin, .. }) = parent.best else { break };
        let bins = &binned.bins[column];
        let (below, above): (Vec<u32>, Vec<u32>) =
            parent.rows.iter().partition(|row| usize::from(bins[**row as usize]) <= bin);
        let is_below_smaller = below.len() < above.len();
        let smaller = binned.histogram(if is_below_smaller { &below } else { &above }, residual);
        for (sibling, part) in parent.histogram.iter_mut().zip(&smaller) {
            *sibling = sibling.minus(*part);
        }
        let (first, second) = if is_below_smaller {
            (smaller, parent.histogram)
        } else {
            (parent.histogram, smaller)
        };
        let children = [nodes.len(), nodes.len() + 1];
        nodes[parent.node] = Node::Split { column, below: binned.limits[column][bin], children };
        nodes.extend([Node::Leaf(0.0), Node::Leaf(0.0)]);
        leaves.push(leaf(children[0], below, first, residual));
        leaves.push(leaf(children[1], above, second, residual));
    }
    for leaf in leaves {
        let value = RATE * leaf.sums.residual / f64::from(leaf.sums.rows.max(1));
        nodes[leaf.node] = Node::Leaf(value);
        leaf.rows.iter().for_each(|row| residual[*row as usize] -= value);
    }
    nodes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trees_follow_product_of_columns() {
        let first: Vec<f64> = (0..4000).map(|row| f64::from(row % 63) / 31.0 - 1.0).collect();
        let second: Vec<f64> = (0..4000).map(|row| f64::from(row % 50) / 25.0 - 1.0).collect();
        let target: Vec<f64> = first.iter().zip(&second).map(|(a, b)| a * b).collect();
        let columns = [first, second];
        let trees = RegressionTrees::fit(&columns, &target);
        let error = |row: usize| (trees.predict(&columns, row) - target[row]).powi(2);
        let rms = ((0..4000).map(error).sum::<f64>() / 4000.0).sqrt();
        assert!(rms < 0.02, "{rms}");
    }
}
