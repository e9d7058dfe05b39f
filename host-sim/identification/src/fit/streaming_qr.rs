//! Least squares in little memory: the triangle of a tall matrix.
//!
//! All that a Gauss-Newton or Levenberg-Marquardt step needs of a Jacobian with two million rows is
//! its triangular factor. Rows `[J | r]` are taken in as they are simulated, block by block, by
//! Householder reflections (the "tall skinny QR"); triangles of different tracks are merged the same
//! way, in parallel. Unlike the sum `J'J` this loses no digits, so a parameter the data hardly
//! determine is told from one they do not determine at all.

/// Rows reduced at a time.
const BLOCK: usize = 64;

/// Sum of products, eight at a time: one sum would wait for itself at each row.
#[inline(always)]
fn product(a: &[f64; BLOCK], b: &[f64; BLOCK]) -> f64 {
    let mut sums = [0.0; 8];
    for (a, b) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}

/// The triangular factor of the rows taken in so far; the last column is the residual.
#[derive(Clone, Debug)]
pub struct StreamingQr {
    columns: usize,
    /// Upper triangle, row-major, `columns` by `columns`.
    factor: Vec<f64>,
    /// Rows not yet reduced, column-major with stride [`BLOCK`].
    pending: Vec<f64>,
    waiting: usize,
    rows: usize,
}

impl StreamingQr {
    /// No rows yet; `parameters` columns and the residual.
    pub fn new(parameters: usize) -> Self {
        let columns = parameters + 1;
        Self {
            columns,
            factor: vec![0.0; columns * columns],
            pending: vec![0.0; columns * BLOCK],
            waiting: 0,
            rows: 0,
        }
    }

    /// Takes in a row of derivatives and its residual.
    #[inline]
    pub fn push(&mut self, derivatives: &[f64], residual: f64) {
        self.put(0, derivatives, residual);
    }

    /// Takes in a row whose first derivative stands apart from the others.
    pub fn push_with(&mut self, first: f64, others: &[f64], residual: f64) {
        self.pending[self.waiting] = first;
        self.put(1, others, residual);
    }

    #[inline]
    fn put(&mut self, from: usize, derivatives: &[f64], residual: f64) {
        let (pending, _) = self.pending.as_chunks_mut::<BLOCK>();
        for (column, value) in pending[from..].iter_mut().zip(derivatives) {
            column[self.waiting] = *value;
        }
        pending[self.columns - 1][self.waiting] = residual;
        self.waiting += 1;
        self.rows += 1;
        if self.waiting == BLOCK {
            self.reduce();
        }
    }

    /// Counts the rows taken in so far as no data.
    pub fn forget_rows(&mut self) {
        self.rows = 0;
    }

    /// Takes in all that another one has.
    #[must_use]
    pub fn merged(mut self, mut other: Self) -> Self {
        let rows = self.rows + other.rows;
        other.reduce();
        let last = self.columns - 1;
        for row in other.factor.chunks_exact(self.columns) {
            self.push(&row[..last], row[last]);
        }
        self.rows = rows;
        self
    }

    /// The same rows with the first parameter solved for and gone: what is left of the others'
    /// derivatives at right angles to its own.
    #[must_use]
    pub fn without_first(mut self) -> Self {
        self.reduce();
        let mut rest = Self::new(self.columns - 2);
        for row in self.factor.chunks_exact(self.columns).skip(1) {
            rest.push(&row[1..self.columns - 1], row[self.columns - 1]);
        }
        rest.rows = self.rows;
        rest
    }

    fn reduce(&mut self) {
        let columns = self.columns;
        // Rows that are not there count as zeros: a loop of fixed length takes several at a time.
        for column in self.pending.chunks_exact_mut(BLOCK) {
            column[self.waiting..].fill(0.0);
        }
        let mut pending = self.pending.as_mut_slice();
        for pivot in 0..columns {
            let Some((reflector, rest)) = pending.split_first_chunk_mut::<BLOCK>() else { break };
            pending = rest;
            let norm_below = product(reflector, reflector);
            // A column whose square is no normal number is none: one over that square is infinite, and times zero
            // not a number. What a stiff bristle remembers of its start fades to 1e-160 within a few rows.
            if norm_below < f64::MIN_POSITIVE {
                continue;
            }
            // Reflect (factor[pivot][pivot], pending column) onto the first axis. The reflector is
            // (head, pending column) with head = diagonal + sign * norm, which does not cancel.
            let row = &mut self.factor[pivot * columns + pivot..(pivot + 1) * columns];
            let diagonal = row[0];
            let norm = (diagonal * diagonal + norm_below).sqrt();
            let head = diagonal + norm.copysign(diagonal);
            let scale = 1.0 / (norm * norm + norm * diagonal.abs());
            row[0] = -norm.copysign(diagonal);
            let (others, _) = pending.as_chunks_mut::<BLOCK>();
            for (entry, column) in row[1..].iter_mut().zip(others) {
                let factor = (head * *entry + product(reflector, column)) * scale;
                *entry -= factor * head;
                for (value, part) in column.iter_mut().zip(&*reflector) {
                    *value -= factor * part;
                }
            }
        }
        self.waiting = 0;
    }

    /// The factor of the derivatives (row-major, upper, `n` by `n`), the residual turned by the
    /// same reflections (its first `n` entries), and the norm of what no parameter can reach.
    pub fn finish(mut self) -> Reduced {
        self.reduce();
        let n = self.columns - 1;
        let row = |i: usize| &self.factor[i * self.columns..(i + 1) * self.columns];
        Reduced {
            factor: (0..n).flat_map(|i| row(i)[..n].to_vec()).collect(),
            residual: (0..n).map(|i| row(i)[n]).collect(),
            rest: row(n)[n].abs(),
            rows: self.rows,
        }
    }
}

/// What is left of a tall least-squares problem.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// Triangular factor of the Jacobian, row-major.
    pub factor: Vec<f64>,
    /// The residual within the Jacobian's range.
    pub residual: Vec<f64>,
    /// Norm of the residual outside it.
    pub rest: f64,
    /// How many rows there were.
    pub rows: usize,
}

impl Reduced {
    /// Sum of squared residuals.
    pub fn sum_of_squares(&self) -> f64 {
        self.residual.iter().map(|r| r * r).sum::<f64>() + self.rest * self.rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_that_has_faded_away_leaves_the_others() {
        let mut qr = StreamingQr::new(2);
        for i in 0..100 {
            let slope = f64::from(i) * 0.01;
            qr.push_with(1e-160, &[slope], 3.0 * slope);
        }
        let rest = qr.without_first().finish();
        assert!((rest.residual[0] / rest.factor[0] - 3.0).abs() < 1e-12, "{rest:?}");
        assert!(rest.rest < 1e-12, "{rest:?}");
    }

    #[test]
    fn triangle_has_the_products_of_the_rows() {
        let row = |i: usize| {
            let x = i as f64 * 0.37;
            ([1.0, x.sin(), (2.0 * x).cos() * 1e-4], (0.3 * x).cos() + 0.1 * x.sin())
        };
        let mut parts = [StreamingQr::new(3), StreamingQr::new(3)];
        let mut products = [[0.0f64; 4]; 4];
        for i in 0..1000 {
            let (d, r) = row(i);
            parts[usize::from(i >= 333)].push(&d, r);
            let all = [d[0], d[1], d[2], r];
            for (row, a) in products.iter_mut().zip(all) {
                row.iter_mut().zip(all).for_each(|(sum, b)| *sum += a * b);
            }
        }
        let [first, second] = parts;
        let reduced = first.merged(second).finish();
        assert_eq!(reduced.rows, 1000);
        let column = |j: usize| (0..3).map(move |i| (i, j));
        let product = |a: usize, other: &dyn Fn(usize) -> f64| -> f64 {
            column(a).map(|(i, j)| reduced.factor[i * 3 + j] * other(i)).sum()
        };
        let close = |found: f64, expected: f64| {
            assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{found} {expected}");
        };
        for (a, expected) in products.iter().enumerate().take(3) {
            for (b, expected) in expected.iter().enumerate().take(3) {
                close(product(a, &|i| reduced.factor[i * 3 + b]), *expected);
            }
            close(product(a, &|i| reduced.residual[i]), expected[3]);
        }
        assert!((reduced.sum_of_squares() / products[3][3] - 1.0).abs() < 1e-12);
    }
}
