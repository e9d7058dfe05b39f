//! A small solver: Cholesky factorisation of symmetric positive matrices, in place.
//!
//! Hypotheses have 5 to 40 columns and are solved a hundred thousand times, without each fold. Several systems of one size are
//! therefore solved side by side, so that a processor computes them at once, and the buffers are kept between calls.

/// Number of systems that are solved side by side.
pub const LANES: usize = 4;

/// A value in each of these systems.
pub type Lanes = [f64; LANES];

/// Returns a value for each system.
#[inline(always)]
pub fn lanes<const L: usize>(mut of: impl FnMut(usize) -> f64) -> [f64; L] {
    // A loop is inlined at every level of optimisation, `array::from_fn` is not.
    let mut values = [0.0; L];
    for (lane, value) in values.iter_mut().enumerate() {
        *value = of(lane);
    }
    values
}

/// Returns the sum of products of two columns.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let add = |sum: [f64; 8], (a, b): (&[f64; 8], &[f64; 8])| lanes(|at| sum[at] + a[at] * b[at]);
    let sums = a.0.iter().zip(b.0).fold([0.0; 8], add);
    let rest = a.1.iter().zip(b.1).map(|(a, b)| a * b).sum::<f64>();
    sums.iter().sum::<f64>() + rest
}

/// Returns the sum of products of two rows, in each system.
#[inline(always)]
fn row_dot<const L: usize>(a: &[[f64; L]], b: &[[f64; L]]) -> [f64; L] {
    let add = |sum: [f64; L], (a, b): (&[f64; L], &[f64; L])| lanes(|at| sum[at] + a[at] * b[at]);
    a.iter().zip(b).fold([0.0; L], add)
}

/// Factorises the lower triangle of `matrix` (`size` x `size`, by rows) and solves for `right`, both in place, in each of `L`
/// systems. A pivot that is not positive is replaced by a huge one, which sets the coefficient of a dependent column to zero.
pub fn solve_in_place<const L: usize>(
    matrix: &mut [[f64; L]],
    right: &mut [[f64; L]],
    size: usize,
) {
    // The diagonal of the factor holds inverse pivots.
    for i in 0..size {
        let (head, tail) = matrix.split_at_mut(i * size);
        for j in 0..i {
            let row = &head[j * size..=j * size + j];
            let dot = row_dot(&row[..j], &tail[..j]);
            tail[j] = lanes(|at| (tail[j][at] - dot[at]) * row[j][at]);
        }
        let squares = row_dot(&tail[..i], &tail[..i]);
        tail[i] = lanes(|at| {
            let pivot = tail[i][at] - squares[at];
            if pivot > 0.0 { 1.0 / pivot.sqrt() } else { 1e-150 }
        });
    }
    for i in 0..size {
        let row = &matrix[i * size..=i * size + i];
        let dot = row_dot(&row[..i], right);
        right[i] = lanes(|at| (right[i][at] - dot[at]) * row[i][at]);
    }
    for i in (0..size).rev() {
        let row = &matrix[i * size..=i * size + i];
        right[i] = lanes(|at| right[i][at] * row[i][at]);
        let (before, now) = right.split_at_mut(i);
        for (before, factor) in before.iter_mut().zip(row) {
            *before = lanes(|at| before[at] - factor[at] * now[0][at]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solve_of_known_system_returns_its_solution() {
        let mut matrix =
            [4.0, 0.0, 0.0, 2.0, 5.0, 0.0, 1.0, 3.0, 6.0].map(|value| [value, 2.0 * value]);
        // Symmetric: [4 2 1; 2 5 3; 1 3 6] x = b with x = (1, -2, 3), and twice the matrix for the same b.
        let mut right =
            [4.0 - 4.0 + 3.0, 2.0 - 10.0 + 9.0, 1.0 - 6.0 + 18.0].map(|value| [value; 2]);
        solve_in_place(&mut matrix, &mut right, 3);
        for (found, expected) in right.iter().zip([1.0, -2.0, 3.0]) {
            assert!((found[0] - expected).abs() < 1e-12, "{right:?}");
            assert!((found[1] - 0.5 * expected).abs() < 1e-12, "{right:?}");
        }
    }

    #[test]
    fn solve_with_dependent_column_gives_it_no_coefficient() {
        let mut matrix = [[1.0], [0.0], [1.0], [1.0]];
        let mut right = [[2.0], [2.0]];
        solve_in_place(&mut matrix, &mut right, 2);
        assert!((right[0][0] - 2.0).abs() < 1e-9 && right[1][0].abs() < 1e-9, "{right:?}");
    }

    #[test]
    fn dot_of_any_length_sums_all_products() {
        for length in [0, 5, 8, 19] {
            let values: Vec<f64> = (0..length).map(f64::from).collect();
            let expected: f64 = values.iter().map(|value| value * value).sum();
            assert_eq!(dot(&values, &values), expected);
        }
    }
}
