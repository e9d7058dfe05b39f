//! Least squares in little memory: the triangular factor of a tall matrix.
//!
//! A Gauss-Newton or Levenberg-Marquardt step needs only the triangular factor of the Jacobian, not its millions of
//! rows. Rows `[J | r]` are added as they are simulated and reduced block by block with Householder reflections
//! ("tall skinny QR"). Factors of different tracks are merged in the same way, in parallel. Unlike the product `J'J`
//! this loses no digits. A weakly determined parameter can therefore be distinguished from an undetermined one.

/// Number of rows reduced at a time.
const BLOCK_ROWS: usize = 64;

/// Returns the scalar product, with eight partial sums: a single sum would be limited by the latency of the addition.
#[inline(always)]
fn product(a: &[f64; BLOCK_ROWS], b: &[f64; BLOCK_ROWS]) -> f64 {
    let mut sums = [0.0; 8];
    for (a, b) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}

/// Triangular factor of the rows added so far. The last column is the residual.
#[derive(Clone, Debug)]
pub struct StreamingQr {
    columns: usize,
    /// Upper triangle, row-major, `columns` by `columns`.
    factor: Vec<f64>,
    /// Rows not yet reduced, column-major with stride [`BLOCK_ROWS`].
    pending: Vec<f64>,
    waiting: usize,
    rows: usize,
}

impl StreamingQr {
    /// Creates a factor without rows, with `parameters` columns and the residual.
    pub fn new(parameters: usize) -> Self {
        let columns = parameters + 1;
        Self {
            columns,
            factor: vec![0.0; columns * columns],
            pending: vec![0.0; columns * BLOCK_ROWS],
            waiting: 0,
            rows: 0,
        }
    }

    /// Adds a row of derivatives and its residual.
    #[inline]
    pub fn push(&mut self, derivatives: &[f64], residual: f64) {
        self.push_from(0, derivatives, residual);
    }

    /// Adds a row whose first derivative is given separately.
    pub fn push_with(&mut self, first: f64, others: &[f64], residual: f64) {
        self.pending[self.waiting] = first;
        self.push_from(1, others, residual);
    }

    #[inline]
    fn push_from(&mut self, from: usize, derivatives: &[f64], residual: f64) {
        let (pending, _) = self.pending.as_chunks_mut::<BLOCK_ROWS>();
        for (column, value) in pending[from..].iter_mut().zip(derivatives) {
            column[self.waiting] = *value;
        }
        pending[self.columns - 1][self.waiting] = residual;
        self.waiting += 1;
        self.rows += 1;
        if self.waiting == BLOCK_ROWS {
            self.reduce();
        }
    }

    /// Resets the number of rows to 0, so that the rows added so far do not count as data.
    pub fn forget_rows(&mut self) {
        self.rows = 0;
    }

    /// Merges another factor into this one.
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

    /// Eliminates the first parameter: the derivatives of the others are projected orthogonally to its own.
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
        // Missing rows are filled with zeros: a loop of fixed length can be vectorised.
        for column in self.pending.chunks_exact_mut(BLOCK_ROWS) {
            column[self.waiting..].fill(0.0);
        }
        let mut pending = self.pending.as_mut_slice();
        for pivot in 0..columns {
            let Some((reflector, rest)) = pending.split_first_chunk_mut::<BLOCK_ROWS>() else {
                break;
            };
            pending = rest;
            let norm_below = product(reflector, reflector);
            // A column whose square is not a normal number is skipped: the inverse of the square would be infinite, and its
            // product with 0 NaN. The influence of a stiff bristle's initial state decays to 1e-160 within a few rows.
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
            let (others, _) = pending.as_chunks_mut::<BLOCK_ROWS>();
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

    /// Returns the factor of the derivatives (row-major, upper, `n` by `n`), the first `n` entries of the residual after the
    /// same reflections, and the norm of the irreducible residual.
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

/// A tall least-squares problem in reduced form.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// Triangular factor of the Jacobian, row-major.
    pub factor: Vec<f64>,
    /// The residual within the Jacobian's range.
    pub residual: Vec<f64>,
    /// Norm of the residual outside it.
    pub rest: f64,
    /// Number of rows.
    pub rows: usize,
}

impl Reduced {
    /// Returns the sum of squared residuals.
    pub fn sum_of_squares(&self) -> f64 {
        self.residual.iter().map(|r| r * r).sum::<f64>() + self.rest * self.rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_first_with_vanishing_column_keeps_other_columns() {
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
    fn merged_factor_has_products_of_all_rows() {
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
