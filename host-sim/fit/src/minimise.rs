//! Levenberg-Marquardt optimiser from a point to the nearest minimum.
//!
//! The optimiser is the `levenberg-marquardt` crate, MINPACK's `lmder` in Rust, which passes MINPACK's own tests. It
//! works on the triangular factor of the Jacobian ([`super::reduce`]), which gives the same steps and the same cost.
//! Its time is therefore independent of the number of rows.

use super::coordinates::Coordinates;
use super::reduce::reduce;
use super::simulate::Resolution;
use super::streaming_qr::Reduced;
use super::track::Rows;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn, OMatrix, OVector};

/// Criteria for stopping the optimiser.
#[derive(Clone, Copy, Debug)]
pub struct StopCriteria {
    /// Maximum number of simulations per parameter.
    pub patience: usize,
    /// The optimiser stops if a step would lower the sum of squares by less than this share of one row's.
    pub tolerance: f64,
    /// The optimiser also stops if `STAGNANT_EVALUATIONS` in a row lower the sum of squares by less than this share of
    /// it; 0 to let it crawl.
    pub stagnation: f64,
}

/// Evaluations over which the progress of the optimiser is measured.
const STAGNANT_EVALUATIONS: usize = 4;

struct Problem<'a> {
    coordinates: &'a Coordinates,
    rows: Rows<'a>,
    resolution: Resolution,
    stop: StopCriteria,
    point: DVector<f64>,
    reduced: Reduced,
    /// The best point so far. The optimiser may stop at a worse trial point.
    best: (DVector<f64>, Reduced),
    evaluations: usize,
    /// Lowest sum of squares so far, after each evaluation.
    progress: Vec<f64>,
}

impl Problem<'_> {
    fn is_finite(&self) -> bool {
        self.reduced.rest.is_finite()
            && self.reduced.residual.iter().chain(&self.reduced.factor).all(|x| x.is_finite())
    }

    /// Returns true if a full Gauss-Newton step would gain less than [`StopCriteria::tolerance`].
    fn is_settled(&self) -> bool {
        let reducible: f64 = self.reduced.residual.iter().map(|r| r * r).sum();
        reducible < self.relative_tolerance() * self.reduced.sum_of_squares()
    }

    /// Returns true if the last evaluations made little progress. Trial points that are all worse than the start only
    /// shorten the step.
    fn is_stagnant(&self) -> bool {
        let [first, .., last] = self.progress.as_slice() else { return false };
        let before = self.progress.iter().rev().nth(STAGNANT_EVALUATIONS);
        last < first && before.is_some_and(|before| before - last < self.stop.stagnation * last)
    }

    /// Returns the tolerance as a share of the whole sum of squares.
    fn relative_tolerance(&self) -> f64 {
        self.stop.tolerance / self.reduced.rows.max(1) as f64
    }
}

impl LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, point: &OVector<f64, Dyn>) {
        self.point.copy_from(point);
        self.reduced = reduce(self.coordinates, point.as_slice(), self.rows, self.resolution);
        self.evaluations += 1;
        let lower = self.reduced.sum_of_squares() < self.best.1.sum_of_squares();
        if lower && self.is_finite() {
            self.best = (self.point.clone(), self.reduced.clone());
        }
        self.progress.push(self.best.1.sum_of_squares());
    }

    fn params(&self) -> OVector<f64, Dyn> {
        self.point.clone()
    }

    fn residuals(&self) -> Option<OVector<f64, Dyn>> {
        let count = self.point.len();
        // A diverged step must be rejected by the optimiser instead of ending the fit.
        let all = self.reduced.residual.iter().copied().chain([self.reduced.rest]);
        let all = all.map(|r| if self.is_finite() { r } else { 1e100 });
        Some(DVector::from_iterator(count + 1, all))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, Dyn>> {
        let count = self.point.len();
        (self.is_finite() && !self.is_settled() && !self.is_stagnant()).then(|| {
            DMatrix::from_fn(count + 1, count, |row, column| {
                if row < count { self.reduced.factor[row * count + column] } else { 0.0 }
            })
        })
    }
}

/// End point of the optimiser.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// The point.
    pub point: Vec<f64>,
    /// The reduced problem at this point.
    pub reduced: Reduced,
    /// Number of simulations with derivatives.
    pub evaluations: usize,
    /// True if it converged, false if it stopped at its limit.
    pub converged: bool,
}

/// Runs the optimiser from a point where the reduced problem is known.
pub fn minimise_from(
    coordinates: &Coordinates,
    from: &[f64],
    reduced: Reduced,
    rows: Rows,
    resolution: Resolution,
    stop: StopCriteria,
) -> Minimum {
    if coordinates.is_empty() {
        return Minimum { point: Vec::new(), reduced, evaluations: 1, converged: true };
    }
    let point = DVector::from_column_slice(from);
    let best = (point.clone(), reduced.clone());
    let progress = vec![reduced.sum_of_squares()];
    let problem = Problem {
        coordinates,
        rows,
        resolution,
        stop,
        point,
        reduced,
        best,
        evaluations: 1,
        progress,
    };
    let optimiser = LevenbergMarquardt::new()
        .with_patience(stop.patience)
        .with_ftol(problem.relative_tolerance())
        .with_xtol(1e-7)
        .with_gtol(1e-10);
    let (problem, report) = optimiser.minimize(problem);
    let converged = report.termination.was_successful() || problem.is_settled();
    let (point, reduced) = problem.best;
    Minimum {
        converged,
        point: point.as_slice().to_vec(),
        reduced,
        evaluations: problem.evaluations,
    }
}
