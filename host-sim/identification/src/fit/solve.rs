//! Bounded Levenberg-Marquardt over the core's simulation.
//!
//! The optimiser is the `levenberg-marquardt` crate, MINPACK's `lmder` in Rust: it says how it ended
//! and is held to MINPACK's own tests. It sees not the tall Jacobian but its triangle
//! ([`super::triangle`]), which has the same steps and the same cost, so two million rows take no
//! more of its time than ten. Value and derivative come from one simulation in dual numbers.
//!
//! A log's period is coarse for a bristle; the simulation is refined ([`Resolution`]) until a finer one
//! would move no parameter by more than a tenth of its standard error.

use super::coordinates::Coordinates;
use super::outcome::predict;
use super::rest::settle;
use super::simulate::{Resolution, simulate};
use super::start;
use super::statistics::{autocorrelation_time, step_in_standard_errors};
use super::track::Track;
use super::triangle::{Reduced, Triangle};
use crate::data::AntiAlias;
use crate::dual::Dual;
use crate::spec::Spec;
use compensator_core::{ParameterId, Parameters, Real};
use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::storage::Owned;
use nalgebra::{DMatrix, DVector, Dyn, OMatrix, OVector};
use rayon::prelude::*;

/// A finer simulation must not move a parameter by more than this many standard errors.
const STEP_TOLERANCE: f64 = 0.1;

/// Sub-steps of the coarser simulation at which refining ends, whatever it still moves.
const MOST_SUBSTEPS: usize = 4;

/// The optimiser stops when a step would lower the sum of squares by less than this share of one
/// row's: parameters are then within a thirtieth of a standard error of the optimum.
const ENOUGH: f64 = 1e-3;

/// Simulations per parameter after which the optimiser gives up; a fit that takes more crawls along a
/// valley the data leave open.
const PATIENCE: usize = 20;

/// What is fitted, and by which rows.
#[derive(Clone, Copy, Debug)]
pub struct Rows<'a> {
    /// The tracks.
    pub tracks: &'a [Track],
    /// Keep one residual in this many, anti-aliased; 0 and 1 keep all.
    pub decimate: usize,
}

/// How a fit is done.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// Plain steps of the simulation per sample; `None` to choose the resolution.
    pub substeps: Option<usize>,
    /// Exactly this resolution, known to do; `None` to choose it.
    pub resolution: Option<Resolution>,
    /// How many starting points go all the way; at least 1.
    pub starts: usize,
    /// Start here, and here only.
    pub start: Option<Parameters<f64>>,
    /// Parameters to keep at their value.
    pub fixed: Vec<ParameterId>,
    /// Optional parameters to fit too (the static excesses of the improved law).
    pub freed: Vec<ParameterId>,
    /// Simulations per parameter after which the optimiser gives up.
    pub patience: usize,
}

impl Default for FitOptions {
    fn default() -> Self {
        Self {
            substeps: None,
            resolution: None,
            starts: 3,
            start: None,
            fixed: Vec::new(),
            freed: Vec::new(),
            patience: PATIENCE,
        }
    }
}

/// A fit's end point.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The coordinates it was found in.
    pub coordinates: Coordinates,
    /// The point.
    pub point: Vec<f64>,
    /// Parameters left where they were: what they do, others do as well.
    pub twins: Vec<ParameterId>,
    /// Where it began.
    pub start: Parameters<f64>,
    /// The reduced problem there.
    pub reduced: Reduced,
    /// How finely the simulation stepped.
    pub resolution: Resolution,
    /// Simulations with derivatives that were made.
    pub evaluations: usize,
    /// Whether the optimiser converged, or gave up at its limit.
    pub converged: bool,
}

impl Solution {
    /// The parameters found.
    pub fn parameters(&self) -> Parameters<f64> {
        self.coordinates.parameters(&self.point)
    }
}

/// Residual and derivatives at a point, reduced.
pub fn reduce(
    coordinates: &Coordinates,
    point: &[f64],
    rows: Rows,
    resolution: Resolution,
) -> Reduced {
    // The number of derivatives is part of a dual number's type; a few sizes serve all.
    match point.len() {
        0..=2 => reduce_with::<2>(coordinates, point, rows, resolution),
        3..=4 => reduce_with::<4>(coordinates, point, rows, resolution),
        5..=6 => reduce_with::<6>(coordinates, point, rows, resolution),
        7..=8 => reduce_with::<8>(coordinates, point, rows, resolution),
        9..=12 => reduce_with::<12>(coordinates, point, rows, resolution),
        13..=20 => reduce_with::<20>(coordinates, point, rows, resolution),
        _ => reduce_with::<40>(coordinates, point, rows, resolution),
    }
}

fn reduce_with<const N: usize>(
    coordinates: &Coordinates,
    point: &[f64],
    rows: Rows,
    resolution: Resolution,
) -> Reduced {
    let count = point.len();
    let seeded: Vec<Dual<N>> =
        point.iter().enumerate().map(|(index, u)| Dual::parameter(*u, index)).collect();
    let parameters = coordinates.parameters(&seeded);
    let plain: Parameters<f64> = coordinates.parameters(point);
    let one = |track: &Track| {
        let rest = settle(&plain, track, resolution);
        let held = rest.as_ref().map(|rest| Dual::from_f64(rest.held));
        let mut triangle = Triangle::new(count);
        if rows.decimate > 1 {
            push_decimated(
                &mut triangle,
                &parameters,
                track,
                held,
                resolution,
                rows.decimate,
                count,
            );
            return triangle;
        }
        let mut beginning = rest.map(|rest| (Triangle::new(count + 1), rest.memory));
        simulate(&parameters, track, held, resolution, |row, torque, _| {
            if !track.is_judged(row) {
                return true;
            }
            let derivative = torque.gradient.map(|g| -g);
            let residual = track.torque[row] - torque.value;
            match &mut beginning {
                Some((start, memory)) if row < memory.len() => {
                    start.push_with(-memory[row], &derivative[..count], residual);
                }
                _ => triangle.push(&derivative[..count], residual),
            }
            true
        });
        match beginning {
            Some((start, _)) => triangle.merged(start.without_first()),
            None => triangle,
        }
    };
    // Collected before it is merged: the same sum in the same order, whatever the threads did.
    let triangles: Vec<Triangle> = rows.tracks.par_iter().map(one).collect();
    let mut prior = Triangle::new(count);
    let mut derivatives = vec![0.0; count];
    for (index, derivative, residual) in coordinates.prior(point) {
        derivatives.fill(0.0);
        derivatives[index] = derivative;
        prior.push(&derivatives, residual);
    }
    prior.forget_rows();
    triangles.into_iter().fold(prior, Triangle::merged).finish()
}

/// Simulates at the full rate and thins out the *residual* (and its derivatives): a law that is not
/// linear in velocity must see the velocity as it was.
fn push_decimated<const N: usize>(
    triangle: &mut Triangle,
    parameters: &Parameters<Dual<N>>,
    track: &Track,
    held: Option<Dual<N>>,
    resolution: Resolution,
    factor: usize,
    count: usize,
) {
    let mut columns = vec![Vec::with_capacity(track.len()); count + 1];
    simulate(parameters, track, held, resolution, |row, torque, _| {
        let judged = f64::from(u8::from(track.is_judged(row)));
        for (column, g) in columns[..count].iter_mut().zip(torque.gradient) {
            column.push(-g * judged);
        }
        columns[count].push((track.torque[row] - torque.value) * judged);
        true
    });
    let filter = AntiAlias::new(factor);
    let columns: Vec<Vec<f64>> = columns.into_iter().map(|column| filter.thin(column)).collect();
    let mut derivatives = vec![0.0; count];
    for (row, residual) in columns[count].iter().enumerate() {
        for (derivative, column) in derivatives.iter_mut().zip(&columns) {
            *derivative = column[row];
        }
        triangle.push(&derivatives, *residual);
    }
}

struct Problem<'a> {
    coordinates: &'a Coordinates,
    rows: Rows<'a>,
    resolution: Resolution,
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
    /// and Newton would not gain [`ENOUGH`], and need not be tried.
    fn is_settled(&self) -> bool {
        let reach: f64 = self.reduced.residual.iter().map(|r| r * r).sum();
        reach < self.enough() * self.reduced.sum_of_squares()
    }

    fn enough(&self) -> f64 {
        ENOUGH / self.reduced.rows.max(1) as f64
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

/// Runs the optimiser from a point. `patience` bounds the simulations, per parameter.
pub fn minimise(
    coordinates: &Coordinates,
    from: &[f64],
    rows: Rows,
    resolution: Resolution,
    patience: usize,
) -> (Vec<f64>, Reduced, usize, bool) {
    let reduced = reduce(coordinates, from, rows, resolution);
    minimise_from(coordinates, from, reduced, rows, resolution, patience)
}

/// As [`minimise`], where the problem at `from` is known.
fn minimise_from(
    coordinates: &Coordinates,
    from: &[f64],
    reduced: Reduced,
    rows: Rows,
    resolution: Resolution,
    patience: usize,
) -> (Vec<f64>, Reduced, usize, bool) {
    if coordinates.is_empty() {
        return (Vec::new(), reduced, 1, true);
    }
    let point = DVector::from_column_slice(from);
    let problem = Problem { coordinates, rows, resolution, point, reduced, evaluations: 1 };
    let optimiser = LevenbergMarquardt::new()
        .with_patience(patience)
        .with_ftol(problem.enough())
        .with_xtol(1e-7)
        .with_gtol(1e-10);
    let (problem, report) = optimiser.minimize(problem);
    let converged = report.termination.was_successful() || problem.is_settled();
    (problem.point.as_slice().to_vec(), problem.reduced, problem.evaluations, converged)
}

/// Fits a model to rows: starts, optimiser, sub-steps.
///
/// # Errors
/// If the model carries more terms than the core takes.
pub fn fit(spec: &Spec, base: &Parameters<f64>, rows: Rows, options: &FitOptions) -> Solution {
    let scales = start::Scales::of(rows.tracks);
    // The declared speed limits the step; the fit is to see all that was measured.
    let mut base = base.clone();
    base.envelope.velocity_max_rad_s = f32::MAX;
    let base = &base;
    let free = free_parameters(spec, base, rows.tracks, options);
    let given = options.substeps.is_some() || options.resolution.is_some();
    let refines = spec.law.has_bristles() && !given;
    let plain = Resolution { substeps: options.substeps.unwrap_or(1).max(1), extrapolated: false };
    let mut resolution = options.resolution.unwrap_or(plain);
    let candidates = match &options.start {
        Some(start) => vec![start.clone()],
        None => start::candidates(spec, base, &free, rows, &scales, resolution, options.starts),
    };
    let (twins, at_first) = match candidates.first() {
        Some(start) => twins(start, &free, rows, &scales),
        None => Default::default(),
    };
    // Where nothing had to go, the first fit begins at the very point the twins were sought at.
    let mut at_first = at_first.filter(|_| twins.is_empty() && resolution == Resolution::PLAIN);
    let free: Vec<ParameterId> = free.into_iter().filter(|id| !twins.contains(id)).collect();
    let mut evaluations = 0;
    let best = candidates
        .iter()
        .map(|start| {
            let coordinates = Coordinates::new(start, &free, &scales);
            let from = coordinates.point(start);
            let at_start = at_first.take();
            let at_start =
                at_start.unwrap_or_else(|| reduce(&coordinates, &from, rows, resolution));
            let (point, reduced, used, converged) =
                minimise_from(&coordinates, &from, at_start, rows, resolution, options.patience);
            evaluations += used;
            let start = start.clone();
            let twins = twins.clone();
            Solution {
                coordinates,
                point,
                twins,
                start,
                reduced,
                resolution,
                evaluations: 0,
                converged,
            }
        })
        .min_by(|a, b| a.reduced.sum_of_squares().total_cmp(&b.reduced.sum_of_squares()));
    let Some(mut best) = best else { unreachable!("there is always one candidate") };
    // Residuals that hang together make for larger standard errors, and need less.
    let time = if refines {
        let predicted = predict(&best.parameters(), rows, resolution);
        autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice))
    } else {
        1.0
    };
    while refines && resolution.substeps < MOST_SUBSTEPS {
        let finer = resolution.finer();
        let again = reduce(&best.coordinates, &best.point, rows, finer);
        evaluations += 1;
        if step_in_standard_errors(&best.reduced, &again) < STEP_TOLERANCE * time.sqrt() {
            break;
        }
        resolution = finer;
        let (point, reduced, used, converged) =
            minimise(&best.coordinates, &best.point, rows, resolution, options.patience);
        evaluations += used;
        best = Solution { point, reduced, resolution, converged, ..best };
    }
    best.evaluations = evaluations;
    best
}

/// Free parameters whose effect is, to rounding, a combination of those before them: in sliding, a
/// difference of the two directions' Coulomb levels is an offset. Left free, the pair would run off
/// to infinity hand in hand; the later one (a term, if one is a term) stays where it is. With them,
/// where the parameters were looked at in the order of `free`, the problem at the start.
fn twins(
    start: &Parameters<f64>,
    free: &[ParameterId],
    rows: Rows,
    scales: &start::Scales,
) -> (Vec<ParameterId>, Option<Reduced>) {
    const ROUNDING: f64 = 1e-9;
    let ordered: Vec<ParameterId> = {
        let of_law = |id: &&ParameterId| start.law.parameters().contains(id);
        let rest = start.terms.iter().flat_map(|term| term.parameters());
        let rest = rest.filter(|id| free.contains(id) && !start.law.parameters().contains(id));
        free.iter().filter(of_law).chain(rest).copied().collect()
    };
    let coordinates = Coordinates::new(start, &ordered, scales);
    let reduced = reduce(&coordinates, &coordinates.point(start), rows, Resolution::PLAIN);
    let count = ordered.len();
    // The factor's diagonal is what a column has beyond those before it. The prior is too weak to
    // make a difference: no twin has one.
    let norm =
        |j: usize| (0..=j).map(|i| reduced.factor[i * count + j].powi(2)).sum::<f64>().sqrt();
    let is_twin = |j: &usize| {
        let norm = norm(*j);
        norm > 0.0 && reduced.factor[j * count + j].abs() < ROUNDING * norm
    };
    let twins = (0..count).filter(is_twin).map(|j| ordered[j]).collect();
    (twins, (ordered == free).then_some(reduced))
}

/// The parameters of a model the rows can say anything of at all.
fn free_parameters(
    spec: &Spec,
    base: &Parameters<f64>,
    tracks: &[Track],
    options: &FitOptions,
) -> Vec<ParameterId> {
    use ParameterId as Id;
    let unseen: Vec<Id> = unseen(spec, tracks);
    let optional = [
        Id::RadialForceStaticExcess,
        Id::PressureStaticExcess,
        Id::TemperatureReference,
        Id::DwellTravel,
        Id::BacklashStiffnessRatio,
        // Which column, and over which range, is chosen; what happens along it is fitted.
        Id::LookupColumn,
        Id::LookupLower,
        Id::LookupUpper,
    ];
    base.active()
        .filter(|id| !options.fixed.contains(id) && !unseen.contains(id))
        .filter(|id| !optional.contains(id) || options.freed.contains(id))
        .collect()
}

/// Parameters that act on a column which is not there, or 0 throughout.
pub fn unseen(spec: &Spec, tracks: &[Track]) -> Vec<ParameterId> {
    let silent = |column: &str| {
        tracks.iter().flat_map(|track| &track.samples).all(|sample| {
            0.0 == match column {
                "radial_force_n" => sample.radial_force_n,
                "pressure_diff_pa" => sample.pressure_diff_mpa,
                "temperature_c" => sample.temperature_c,
                "load_torque_nm" => sample.load_torque_nm,
                _ => sample.position_rad,
            }
        })
    };
    spec.needs().filter(|(_, column)| silent(column)).map(|(id, _)| id).collect()
}
