//! A small solver: Cholesky factorisation of a symmetric positive matrix, in place.
//!
//! Hypotheses have 5 to 40 columns and are solved a hundred thousand times, so that the buffers are kept between calls.

/// Factorises the lower triangle of `matrix` (`size` x `size`, by rows) and solves for `right`, both in place. A pivot that is
/// not positive is replaced by a huge one, which sets the coefficient of a dependent column to zero.
pub fn solve_in_place(matrix: &mut [f64], right: &mut [f64], size: usize) {
    for i in 0..size {
        for j in 0..i {
            let (head, tail) = matrix.split_at(i * size);
            let dot: f64 =
                head[j * size..j * size + j].iter().zip(&tail[..j]).map(|(a, b)| a * b).sum();
            matrix[i * size + j] = (matrix[i * size + j] - dot) / matrix[j * size + j];
        }
        let row = &matrix[i * size..i * size + i];
        let pivot = matrix[i * size + i] - row.iter().map(|a| a * a).sum::<f64>();
        matrix[i * size + i] = if pivot > 0.0 { pivot.sqrt() } else { 1e150 };
    }
    for i in 0..size {
        let row = &matrix[i * size..i * size + i];
        let dot: f64 = row.iter().zip(right.iter()).map(|(a, b)| a * b).sum();
        right[i] = (right[i] - dot) / matrix[i * size + i];
    }
    for i in (0..size).rev() {
        let mut sum = right[i];
        for j in i + 1..size {
            sum -= matrix[j * size + i] * right[j];
        }
        right[i] = sum / matrix[i * size + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solve_of_known_system_returns_its_solution() {
        let mut matrix = vec![4.0, 0.0, 0.0, 2.0, 5.0, 0.0, 1.0, 3.0, 6.0];
        // Symmetric: [4 2 1; 2 5 3; 1 3 6] x = b with x = (1, -2, 3).
        let mut right = vec![4.0 - 4.0 + 3.0, 2.0 - 10.0 + 9.0, 1.0 - 6.0 + 18.0];
        solve_in_place(&mut matrix, &mut right, 3);
        for (found, expected) in right.iter().zip([1.0, -2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-12, "{right:?}");
        }
    }

    #[test]
    fn solve_with_dependent_column_gives_it_no_coefficient() {
        let mut matrix = vec![1.0, 0.0, 1.0, 1.0];
        let mut right = vec![2.0, 2.0];
        solve_in_place(&mut matrix, &mut right, 2);
        assert!((right[0] - 2.0).abs() < 1e-9 && right[1].abs() < 1e-9, "{right:?}");
    }
}
