//! Least squares between bounds, by a damped step that stays within them.
//!
//! The paper's tool is a trust-region least-squares estimator. It keeps each value between bounds and does not scale them.
//! Here Levenberg-Marquardt damping acts as the trust region. A value at its bound is left out of the step if the step would
//! leave the bound, and other steps are cut at the bounds.
//!
//! The fits on torques keep bounds by transformed coordinates, which would rescale the paper's values. The proper protocol
//! uses the same steps in scaled coordinates. MINPACK's optimiser, used elsewhere, does not support bounds.

use nalgebra::{DMatrix, DVector};

/// Normal equations at a point: sum of squares, half the gradient, and the Gauss-Newton matrix.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    /// Sum of squares; not finite at an invalid point.
    pub sum: f64,
    /// `J' r`.
    pub slope: DVector<f64>,
    /// `J' J`.
    pub matrix: DMatrix<f64>,
}

/// Accumulates the normal equations row by row.
#[derive(Clone, Debug)]
pub struct NormalSums<const N: usize> {
    sum: f64,
    slope: [f64; N],
    matrix: [[f64; N]; N],
}

impl<const N: usize> NormalSums<N> {
    /// Starts without rows.
    pub fn new() -> Self {
        Self { sum: 0.0, slope: [0.0; N], matrix: [[0.0; N]; N] }
    }

    /// Adds a weighted residual with its derivatives.
    pub fn push(&mut self, residual: f64, derivatives: &[f64; N], weight: f64) {
        self.sum += weight * residual * residual;
        for ((slope, row), derivative) in
            self.slope.iter_mut().zip(&mut self.matrix).zip(derivatives)
        {
            let derivative = weight * derivative;
            *slope += derivative * residual;
            row.iter_mut().zip(derivatives).for_each(|(sum, other)| *sum += derivative * other);
        }
    }

    /// Returns the normal equations of the first `count` coordinates; the rest only pad the array. The sum is not finite if
    /// the simulation was `cut` short.
    pub fn normal(&self, count: usize, cut: bool) -> NormalEquations {
        NormalEquations {
            sum: if cut || !self.sum.is_finite() { f64::INFINITY } else { self.sum },
            slope: DVector::from_column_slice(&self.slope[..count]),
            matrix: DMatrix::from_fn(count, count, |i, j| self.matrix[i][j]),
        }
    }
}

/// Options of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SearchOptions {
    /// Damps each coordinate by its own curvature, so that units do not matter; otherwise all equally.
    pub scaled: bool,
    /// The search ends if a step changes the sum of squares, or every coordinate, by less than this share.
    pub tolerance: f64,
    /// Maximum number of steps.
    pub steps: usize,
}

/// Result of a search.
#[derive(Clone, Debug)]
pub struct SearchResult {
    /// Final point.
    pub point: Vec<f64>,
    /// Normal equations at the final point.
    pub normal: NormalEquations,
    /// Number of simulations with derivatives.
    pub evaluations: usize,
    /// The search ended by its tolerance.
    pub converged: bool,
}

/// Damping at which the search stops.
const MAX_DAMPING: f64 = 1e12;

/// Searches from a point between bounds (lower, upper).
pub fn search(
    from: &[f64],
    bounds: &[(f64, f64)],
    how: SearchOptions,
    mut at: impl FnMut(&[f64]) -> NormalEquations,
) -> SearchResult {
    let count = from.len();
    let within = |point: &[f64]| -> Vec<f64> {
        point.iter().zip(bounds).map(|(x, (least, most))| x.clamp(*least, *most)).collect()
    };
    let mut point = within(from);
    let mut normal = at(&point);
    let (mut damping, mut growth, mut evaluations, mut converged) = (1e-3, 2.0, 1, false);
    let largest = (0..count).map(|i| normal.matrix[(i, i)]).fold(f64::MIN_POSITIVE, f64::max);
    while evaluations < how.steps && damping < MAX_DAMPING {
        let outward = |i: usize| {
            let (least, most) = bounds[i];
            let downhill = -normal.slope[i];
            point[i] <= least && downhill < 0.0 || point[i] >= most && downhill > 0.0
        };
        let free: Vec<usize> = (0..count).filter(|i| !outward(*i)).collect();
        // Without scaling the damping is relative to the largest curvature.
        let added = |i: usize| {
            let curvature = normal.matrix[(i, i)].max(1e-9 * largest);
            damping * if how.scaled { curvature } else { largest }
        };
        let Some(step) = damped_step(&normal, &free, added) else {
            damping *= growth;
            growth *= 2.0;
            continue;
        };
        let mut next = point.clone();
        free.iter().zip(step.iter()).for_each(|(i, by)| next[*i] += by);
        let next = within(&next);
        let moved: Vec<f64> = next.iter().zip(&point).map(|(new, old)| new - old).collect();
        let small = |(by, x): (&f64, &f64)| by.abs() <= how.tolerance * (x.abs() + how.tolerance);
        if moved.iter().zip(&point).all(small) {
            converged = true;
            break;
        }
        let tried = at(&next);
        evaluations += 1;
        let reduction = normal.sum - tried.sum;
        if !(reduction > 0.0 && tried.sum.is_finite()) {
            damping *= growth;
            growth *= 2.0;
            continue;
        }
        let by = DVector::from_column_slice(&moved);
        let predicted = -(2.0 * normal.slope.dot(&by) + by.dot(&(&normal.matrix * &by)));
        let share = if predicted > 0.0 { reduction / predicted } else { 0.0 };
        damping *= (1.0 - (2.0 * share - 1.0).powi(3)).max(1.0 / 3.0);
        growth = 2.0;
        let is_small_reduction = reduction < how.tolerance * normal.sum && share > 0.25;
        (point, normal) = (next, tried);
        if is_small_reduction {
            converged = true;
            break;
        }
    }
    SearchResult { point, normal, evaluations, converged }
}

/// Returns the step of the free coordinates with the damping that is added to the curvature of each; `None` if the matrix is not
/// positive definite.
fn damped_step(
    normal: &NormalEquations,
    free: &[usize],
    added: impl Fn(usize) -> f64,
) -> Option<DVector<f64>> {
    let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| {
        let entry = normal.matrix[(free[i], free[j])];
        if i == j { entry + added(free[i]) } else { entry }
    });
    let slope = DVector::from_fn(free.len(), |i, _| -normal.slope[free[i]]);
    Some(matrix.cholesky()?.solve(&slope))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's function as least squares.
    fn valley(x: &[f64]) -> NormalEquations {
        let residual = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        let jacobian = DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]);
        NormalEquations {
            sum: residual.norm_squared(),
            slope: jacobian.transpose() * &residual,
            matrix: jacobian.transpose() * jacobian,
        }
    }

    #[test]
    fn search_finds_minimum_and_with_bounds_lowest_point_inside() {
        for scaled in [true, false] {
            let how = SearchOptions { scaled, tolerance: 1e-10, steps: 500 };
            let free = search(&[-1.2, 1.0], &[(-5.0, 5.0); 2], how, valley);
            assert!((free.point[0] - 1.0).abs() < 1e-6 && free.converged, "{free:?}");
            let inside = search(&[-1.2, 1.0], &[(-5.0, 0.5), (-5.0, 5.0)], how, valley);
            assert_eq!(inside.point[0], 0.5);
            assert!((inside.point[1] - 0.25).abs() < 1e-6, "{inside:?}");
        }
    }
}
