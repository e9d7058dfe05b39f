//! Least squares between bounds, by a damped step that stays inside.
//!
//! The paper's tool (a trust-region least-squares estimator) keeps each value between bounds and takes the
//! values as they stand. Levenberg and Marquardt's damping is the trust region; a value at its bound that wants
//! beyond it is left out of the step, and a step is cut at the bounds. Coordinates that keep bounds by themselves, as the
//! fits on torques have them, would rescale what the paper did not scale: this is for its protocol. Done
//! properly, the same steps are made in scaled coordinates. The optimiser these fits use elsewhere, MINPACK's,
//! knows no bounds.

use nalgebra::{DMatrix, DVector};

/// The sum of squares at a point with its slopes: half the gradient, and Gauss and Newton's matrix.
#[derive(Clone, Debug)]
pub struct Normal {
    /// Sum of squares; not finite where the point is no good.
    pub sum: f64,
    /// `J' r`.
    pub slope: DVector<f64>,
    /// `J' J`.
    pub matrix: DMatrix<f64>,
}

/// A problem's sums while its rows come in.
#[derive(Clone, Debug)]
pub struct Sums<const N: usize> {
    sum: f64,
    slope: [f64; N],
    matrix: [[f64; N]; N],
}

impl<const N: usize> Sums<N> {
    /// No rows yet.
    pub fn new() -> Self {
        Self { sum: 0.0, slope: [0.0; N], matrix: [[0.0; N]; N] }
    }

    /// Takes in a residual with its derivatives, of this weight.
    pub fn push(&mut self, residual: f64, derivatives: &[f64; N], weight: f64) {
        self.sum += weight * residual * residual;
        for ((slope, row), own) in self.slope.iter_mut().zip(&mut self.matrix).zip(derivatives) {
            let own = weight * own;
            *slope += own * residual;
            row.iter_mut().zip(derivatives).for_each(|(sum, other)| *sum += own * other);
        }
    }

    /// The problem of the first `count` coordinates, the others being there for the width alone; not finite where the
    /// simulation was `cut` short.
    pub fn normal(&self, count: usize, cut: bool) -> Normal {
        Normal {
            sum: if cut || !self.sum.is_finite() { f64::INFINITY } else { self.sum },
            slope: DVector::from_column_slice(&self.slope[..count]),
            matrix: DMatrix::from_fn(count, count, |i, j| self.matrix[i][j]),
        }
    }
}

/// How a search is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// Damp each coordinate by its own curvature, so that units do not matter; else all alike.
    pub scaled: bool,
    /// The search ends where a step changes the sum of squares by less than this share, or no coordinate by
    /// more than this share of itself.
    pub tolerance: f64,
    /// Most steps.
    pub steps: usize,
}

/// Where a search ended.
#[derive(Clone, Debug)]
pub struct End {
    /// The point.
    pub point: Vec<f64>,
    /// The problem there.
    pub normal: Normal,
    /// Simulations with derivatives it took.
    pub evaluations: usize,
    /// Whether it ended by its tolerance.
    pub converged: bool,
}

/// Damping beyond which no step is left to be tried.
const MOST_DAMPING: f64 = 1e12;

/// Searches from a point between bounds (lower, upper).
pub fn search(
    from: &[f64],
    bounds: &[(f64, f64)],
    how: Search,
    mut at: impl FnMut(&[f64]) -> Normal,
) -> End {
    let count = from.len();
    let within = |point: &[f64]| -> Vec<f64> {
        point.iter().zip(bounds).map(|(x, (least, most))| x.clamp(*least, *most)).collect()
    };
    let mut point = within(from);
    let mut normal = at(&point);
    let (mut damping, mut growth, mut evaluations, mut converged) = (1e-3, 2.0, 1, false);
    // Without scales the damping is of the size of the largest curvature there is.
    let largest = (0..count).map(|i| normal.matrix[(i, i)]).fold(f64::MIN_POSITIVE, f64::max);
    let scale = |normal: &Normal, i: usize| {
        if how.scaled { normal.matrix[(i, i)].max(1e-9 * largest) } else { largest }
    };
    while evaluations < how.steps && damping < MOST_DAMPING {
        let outward = |i: usize| {
            let (least, most) = bounds[i];
            let downhill = -normal.slope[i];
            point[i] <= least && downhill < 0.0 || point[i] >= most && downhill > 0.0
        };
        let free: Vec<usize> = (0..count).filter(|i| !outward(*i)).collect();
        let matrix = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            let own = normal.matrix[(free[i], free[j])];
            if i == j { own + damping * scale(&normal, free[i]) } else { own }
        });
        let slope = DVector::from_fn(free.len(), |i, _| -normal.slope[free[i]]);
        let Some(factor) = matrix.cholesky() else {
            damping *= growth;
            growth *= 2.0;
            continue;
        };
        let step = factor.solve(&slope);
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
        let fall = normal.sum - tried.sum;
        if !(fall > 0.0 && tried.sum.is_finite()) {
            damping *= growth;
            growth *= 2.0;
            continue;
        }
        let by = DVector::from_column_slice(&moved);
        let foretold = -(2.0 * normal.slope.dot(&by) + by.dot(&(&normal.matrix * &by)));
        let share = if foretold > 0.0 { fall / foretold } else { 0.0 };
        damping *= (1.0 - (2.0 * share - 1.0).powi(3)).max(1.0 / 3.0);
        growth = 2.0;
        let little = fall < how.tolerance * normal.sum && share > 0.25;
        (point, normal) = (next, tried);
        if little {
            converged = true;
            break;
        }
    }
    End { point, normal, evaluations, converged }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley as least squares.
    fn valley(x: &[f64]) -> Normal {
        let residual = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
        let jacobian = DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]);
        Normal {
            sum: residual.norm_squared(),
            slope: jacobian.transpose() * &residual,
            matrix: jacobian.transpose() * jacobian,
        }
    }

    #[test]
    fn it_finds_the_bottom_and_with_bounds_the_lowest_inside() {
        for scaled in [true, false] {
            let how = Search { scaled, tolerance: 1e-10, steps: 500 };
            let free = search(&[-1.2, 1.0], &[(-5.0, 5.0); 2], how, valley);
            assert!((free.point[0] - 1.0).abs() < 1e-6 && free.converged, "{free:?}");
            let inside = search(&[-1.2, 1.0], &[(-5.0, 0.5), (-5.0, 5.0)], how, valley);
            assert_eq!(inside.point[0], 0.5);
            assert!((inside.point[1] - 0.25).abs() < 1e-6, "{inside:?}");
        }
    }
}
