//! Levenberg-Marquardt from a point to the nearest minimum.
//!
//! The optimiser is the `levenberg-marquardt` crate, MINPACK's `lmder` in Rust: it says how it ended
//! and is held to MINPACK's own tests. It sees not the tall Jacobian but its triangle
//! ([`super::reduce`]), which has the same steps and the same cost, so two million rows take no
//! more of its time than ten.

use super::coordinates::Coordinates;
use super::reduce::reduce;
use super::simulate::Resolution;
use super::streaming_qr::Reduced;
use super::track::Rows;
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn, OMatrix, OVector};

/// When the optimiser stops.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Simulations per parameter after which it gives up.
    pub patience: usize,
    /// Where a step would lower the sum of squares by less than this share of one row's.
    pub enough: f64,
}

struct Problem<'a> {
    coordinates: &'a Coordinates,
    rows: Rows<'a>,
    resolution: Resolution,
    stop: Stop,
    point: DVector<f64>,
    reduced: Reduced,
    evaluations: usize,
}

impl Problem<'_> {
    fn is_finite(&self) -> bool {
        self.reduced.rest.is_finite()
            && self.reduced.residual.iter().chain(&self.reduced.factor).all(|x| x.is_finite())
    }

    /// Whether what is left of the residual is out of the parameters' reach: the whole step of Gauss
    /// and Newton would not gain [`Stop::enough`], and need not be tried.
    fn is_settled(&self) -> bool {
        let reach: f64 = self.reduced.residual.iter().map(|r| r * r).sum();
        reach < self.enough() * self.reduced.sum_of_squares()
    }

    fn enough(&self) -> f64 {
        self.stop.enough / self.reduced.rows.max(1) as f64
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
    }

    fn params(&self) -> OVector<f64, Dyn> {
        self.point.clone()
    }

    fn residuals(&self) -> Option<OVector<f64, Dyn>> {
        let count = self.point.len();
        // A step that blew up is a bad step, not the end of the fit.
        let all = self.reduced.residual.iter().copied().chain([self.reduced.rest]);
        let all = all.map(|r| if self.is_finite() { r } else { 1e100 });
        Some(DVector::from_iterator(count + 1, all))
    }

    fn jacobian(&self) -> Option<OMatrix<f64, Dyn, Dyn>> {
        let count = self.point.len();
        (self.is_finite() && !self.is_settled()).then(|| {
            DMatrix::from_fn(count + 1, count, |row, column| {
                if row < count { self.reduced.factor[row * count + column] } else { 0.0 }
            })
        })
    }
}

/// Where the optimiser ended.
#[derive(Clone, Debug)]
pub struct Minimum {
    /// The point.
    pub point: Vec<f64>,
    /// The reduced problem there.
    pub reduced: Reduced,
    /// Simulations with derivatives it took.
    pub evaluations: usize,
    /// Whether it converged, or gave up at its limit.
    pub converged: bool,
}

/// Runs the optimiser from a point.
pub fn minimise(
    coordinates: &Coordinates,
    from: &[f64],
    rows: Rows,
    resolution: Resolution,
    stop: Stop,
) -> Minimum {
    let reduced = reduce(coordinates, from, rows, resolution);
    minimise_from(coordinates, from, reduced, rows, resolution, stop)
}

/// As [`minimise`], where the problem at `from` is known.
pub fn minimise_from(
    coordinates: &Coordinates,
    from: &[f64],
    reduced: Reduced,
    rows: Rows,
    resolution: Resolution,
    stop: Stop,
) -> Minimum {
    if coordinates.is_empty() {
        return Minimum { point: Vec::new(), reduced, evaluations: 1, converged: true };
    }
    let point = DVector::from_column_slice(from);
    let problem = Problem { coordinates, rows, resolution, stop, point, reduced, evaluations: 1 };
    let optimiser = LevenbergMarquardt::new()
        .with_patience(stop.patience)
        .with_ftol(problem.enough())
        .with_xtol(1e-7)
        .with_gtol(1e-10);
    let (problem, report) = optimiser.minimize(problem);
    Minimum {
        converged: report.termination.was_successful() || problem.is_settled(),
        point: problem.point.as_slice().to_vec(),
        reduced: problem.reduced,
        evaluations: problem.evaluations,
    }
}
