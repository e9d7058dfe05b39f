//! Fit of a model to rows: starting points, optimiser, resolution.
//!
//! A bounded Levenberg-Marquardt optimiser ([`super::minimise`]) runs from several starting points
//! ([`super::start`]). A log's period is coarse for a bristle. The simulation is therefore refined ([`Resolution`])
//! until a finer one would move no parameter by more than a tenth of its standard error.

use super::coordinates::Coordinates;
use super::minimise::{Minimum, StopCriteria, minimise_from};
use super::predict::predict;
use super::reduce::reduce;
use super::scales::Scales;
use super::simulate::Resolution;
use super::start;
use super::statistics::{autocorrelation_time, step_in_standard_errors};
use super::streaming_qr::Reduced;
use super::track::{Rows, Track};
use super::treatment::treatment_of;
use crate::spec::Spec;
use compensator_core::{ParameterId, Parameters, Quantity};

/// Largest movement of a parameter by a finer simulation, in standard errors.
const STEP_TOLERANCE: f64 = 0.1;

/// Maximum number of sub-steps of the coarser simulation.
const MAX_SUBSTEPS: usize = 4;

/// Maximum number of simulations per parameter. A fit that needs more moves slowly along a valley that the data do not
/// determine.
const DEFAULT_PATIENCE: usize = 20;

/// A fit ends if a step would lower the sum of squares by less than this share of one row's. The parameters are then
/// within a thirtieth of a standard error of the optimum.
const DEFAULT_TOLERANCE: f64 = 1e-3;

/// Tolerance of fits that are only compared with others, or continue at a finer resolution: a third of a standard
/// error. The last tenth of the distance to the optimum would take half of a fit's simulations.
pub const COMPARISON_TOLERANCE: f64 = 0.1;

/// Progress at which such a fit ends, as a share of the squared error. Causes with a smaller effect are rejected as
/// negligible.
pub const COMPARISON_STAGNATION: f64 = 3e-4;

/// Maximum number of simulations per parameter of a fit that continues at a finer resolution, or only if it is the best.
const INTERMEDIATE_PATIENCE: usize = 5;

/// Ratio of the error of an observation in the prior to that of the fit above which the fit is continued with its own.
const MAX_PRIOR_RATIO: f64 = 1.2;

/// Options of a fit.
#[derive(Clone, Debug)]
pub struct FitOptions {
    /// Plain simulation steps per sample; `None` to choose the resolution.
    pub substeps: Option<usize>,
    /// Resolution that is known to be fine enough; `None` to choose it.
    pub resolution: Option<Resolution>,
    /// Number of starting points that are fitted to the end; at least 1.
    pub starts: usize,
    /// The only starting point; `None` to search for starting points.
    pub start: Option<Parameters<f64>>,
    /// Parameters that keep their value.
    pub fixed: Vec<ParameterId>,
    /// Optional parameters to fit as well (the static excesses of the improved law).
    pub freed: Vec<ParameterId>,
    /// If true, fits a passive law, one that dissipates energy only, as a joint driver requires. If false, the rows alone
    /// determine the law.
    pub passive: bool,
    /// If true, the prior counts as one row with the noise of the sensor: for fits that held-out rows judge, some of which lack
    /// causes, so that their residual says little of a prior.
    pub has_weak_prior: bool,
    /// Maximum number of simulations per parameter.
    pub patience: usize,
    /// The fit ends if a step would lower the sum of squares by less than this share of one row's.
    pub tolerance: f64,
    /// The fit also ends if several steps together lower the sum of squares by less than this share of it.
    pub stagnation: f64,
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
            passive: false,
            has_weak_prior: false,
            patience: DEFAULT_PATIENCE,
            tolerance: DEFAULT_TOLERANCE,
            stagnation: 0.0,
        }
    }
}

impl FitOptions {
    /// Returns the options of a fit that is compared with others on held-out rows: it begins at one point, or at the best one for
    /// `None`.
    pub fn for_comparison(start: Option<Parameters<f64>>) -> Self {
        let tolerance = COMPARISON_TOLERANCE;
        Self { starts: 1, start, has_weak_prior: true, tolerance, ..Self::default() }
    }
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Coordinates of the fit.
    pub coordinates: Coordinates,
    /// The optimum in these coordinates.
    pub point: Vec<f64>,
    /// Parameters that were kept, because their effect is a combination of others.
    pub collinear: Vec<ParameterId>,
    /// Starting point.
    pub start: Parameters<f64>,
    /// The reduced problem at the optimum.
    pub reduced: Reduced,
    /// Resolution of the simulation.
    pub resolution: Resolution,
    /// Number of simulations with derivatives.
    pub evaluations: usize,
    /// True if the optimiser converged, false if it stopped at its limit.
    pub converged: bool,
}

impl Solution {
    /// Returns the fitted parameters.
    pub fn parameters(&self) -> Parameters<f64> {
        self.coordinates.parameters(&self.point)
    }

    /// Moves the solution to the end point of another run of the optimiser.
    fn moved_to(self, minimum: Minimum) -> Self {
        let Minimum { point, reduced, evaluations, converged } = minimum;
        Self { point, reduced, converged, evaluations: self.evaluations + evaluations, ..self }
    }
}

/// Fits a model to rows.
///
/// If there are several starts, or if the resolution is still to be chosen, all fits but the last one stop early.
pub fn fit(spec: &Spec, base: &Parameters<f64>, rows: Rows, options: &FitOptions) -> Solution {
    let mut scales = Scales::of(rows.tracks);
    if options.has_weak_prior {
        scales = scales.widened();
    }
    let base = &without_speed_limit(base.clone());
    let free = free_parameters(spec, base, rows.tracks, options);
    let is_given = options.substeps.is_some() || options.resolution.is_some();
    let refines = spec.law.has_bristles() && !is_given;
    let plain = Resolution { substeps: options.substeps.unwrap_or(1).max(1), extrapolated: false };
    let resolution = options.resolution.unwrap_or(plain);
    let candidates = match &options.start {
        Some(start) => {
            let mut start = without_speed_limit(start.clone());
            start.choices = base.choices;
            vec![start]
        }
        None => start::candidates(spec, base, &free, rows, &scales, resolution, options.starts),
    };
    if let Some(start) = candidates.first().filter(|_| !options.has_weak_prior) {
        scales = scales.beside(start, rows, resolution);
    }
    let (collinear, at_first) = match candidates.first() {
        Some(start) => collinear(start, &free, rows, &scales, resolution),
        None => Default::default(),
    };
    // Without collinear parameters, the first fit begins at the point where they were searched for.
    let at_first = at_first.filter(|_| collinear.is_empty());
    let free = free.into_iter().filter(|id| !collinear.contains(id)).collect();
    let FitOptions { patience, tolerance, stagnation, .. } = *options;
    let last = StopCriteria { patience, tolerance, stagnation };
    let intermediate = StopCriteria {
        patience: last.patience.min(INTERMEDIATE_PATIENCE),
        tolerance: last.tolerance.max(COMPARISON_TOLERANCE),
        stagnation,
    };
    let is_last = candidates.len() < 2 && !refines;
    let starts = Starts { candidates, free, collinear, at_first };
    let stop = if is_last { last } else { intermediate };
    let mut best = fit_starts(starts, rows, &scales, resolution, stop);
    if refines {
        best = refine(best, rows, intermediate);
    }
    let observation = scales.beside(&best.parameters(), rows, best.resolution).observation;
    // A start that erred much more than its fit made the prior too strong.
    let is_outdated =
        !options.has_weak_prior && best.coordinates.observation() > MAX_PRIOR_RATIO * observation;
    if is_outdated {
        best.coordinates = best.coordinates.with_observation(observation);
        best.reduced = reduce(&best.coordinates, &best.point, rows, best.resolution);
    }
    if is_last && !is_outdated { best } else { converge(best, rows, last) }
}

/// Starting points of a fit.
struct Starts {
    candidates: Vec<Parameters<f64>>,
    free: Vec<ParameterId>,
    collinear: Vec<ParameterId>,
    /// The reduced problem at the first candidate, if it is known.
    at_first: Option<Reduced>,
}

/// Fits from every starting point and returns the solution with the smallest error.
fn fit_starts(
    starts: Starts,
    rows: Rows,
    scales: &Scales,
    resolution: Resolution,
    stop: StopCriteria,
) -> Solution {
    let Starts { candidates, free, collinear, mut at_first } = starts;
    let mut evaluations = 0;
    let best = candidates
        .iter()
        .map(|start| {
            let coordinates = Coordinates::new(start, &free, scales);
            let from = coordinates.point(start);
            let at_start = at_first.take();
            let at_start =
                at_start.unwrap_or_else(|| reduce(&coordinates, &from, rows, resolution));
            let minimum = minimise_from(&coordinates, &from, at_start, rows, resolution, stop);
            evaluations += minimum.evaluations;
            Solution {
                coordinates,
                point: minimum.point,
                collinear: collinear.clone(),
                start: start.clone(),
                reduced: minimum.reduced,
                resolution,
                evaluations: 0,
                converged: minimum.converged,
            }
        })
        .min_by(|a, b| a.reduced.sum_of_squares().total_cmp(&b.reduced.sum_of_squares()));
    let Some(best) = best else { unreachable!("there is always one candidate") };
    Solution { evaluations, ..best }
}

/// Refines the resolution until a finer one would move no parameter by a relevant amount.
fn refine(mut best: Solution, rows: Rows, stop: StopCriteria) -> Solution {
    // Autocorrelated residuals mean larger standard errors, so that a coarser resolution is enough.
    let predicted = predict(&best.parameters(), rows, best.resolution);
    let time = autocorrelation_time(predicted.residuals.iter().map(Vec::as_slice));
    while best.resolution.substeps < MAX_SUBSTEPS {
        let finer = best.resolution.finer();
        let refined = reduce(&best.coordinates, &best.point, rows, finer);
        best.evaluations += 1;
        if step_in_standard_errors(&best.reduced, &refined) < STEP_TOLERANCE * time.sqrt() {
            break;
        }
        let minimum = minimise_from(&best.coordinates, &best.point, refined, rows, finer, stop);
        best = Solution { resolution: finer, ..best.moved_to(minimum) };
    }
    best
}

/// Continues a fit with the final stop criteria.
fn converge(best: Solution, rows: Rows, stop: StopCriteria) -> Solution {
    let reduced = best.reduced.clone();
    let minimum =
        minimise_from(&best.coordinates, &best.point, reduced, rows, best.resolution, stop);
    best.moved_to(minimum)
}

/// Removes the declared speed limit, which would clip measured velocities in a simulation.
fn without_speed_limit(mut parameters: Parameters<f64>) -> Parameters<f64> {
    parameters.envelope.velocity_max_rad_s = f32::MAX;
    parameters
}

/// Returns the free parameters whose effect is, to rounding, a combination of those before them. In sliding, for
/// example, a difference between the Coulomb levels of both directions is an offset. If both were free, they would
/// diverge together; the later one (a term, if one is a term) keeps its value. Also returns the reduced problem at the
/// start, if the parameters were examined in the order of `free`.
fn collinear(
    start: &Parameters<f64>,
    free: &[ParameterId],
    rows: Rows,
    scales: &Scales,
    resolution: Resolution,
) -> (Vec<ParameterId>, Option<Reduced>) {
    const ROUNDING: f64 = 1e-9;
    let ordered: Vec<ParameterId> = {
        let of_law = |id: &&ParameterId| start.law.parameters().contains(id);
        let rest = start.terms.iter().flat_map(|term| term.parameters());
        let rest = rest.filter(|id| free.contains(id) && !start.law.parameters().contains(id));
        free.iter().filter(of_law).chain(rest).copied().collect()
    };
    let coordinates = Coordinates::new(start, &ordered, scales);
    let reduced = reduce(&coordinates, &coordinates.point(start), rows, resolution);
    let count = ordered.len();
    // The factor's diagonal is the part of a column that is independent of those before it. Collinear parameters have no
    // prior.
    let norm =
        |j: usize| (0..=j).map(|i| reduced.factor[i * count + j].powi(2)).sum::<f64>().sqrt();
    let is_collinear = |j: &usize| {
        let norm = norm(*j);
        norm > 0.0 && reduced.factor[j * count + j].abs() < ROUNDING * norm
    };
    let collinear = (0..count).filter(is_collinear).map(|j| ordered[j]).collect();
    (collinear, (ordered == free).then_some(reduced))
}

/// Returns the parameters of a model that a fit varies.
pub fn free_parameters(
    spec: &Spec,
    base: &Parameters<f64>,
    tracks: &[Track],
    options: &FitOptions,
) -> Vec<ParameterId> {
    let unobserved = unobserved_parameters(spec, tracks);
    base.active()
        .filter(|id| !options.fixed.contains(id) && !unobserved.contains(id))
        .filter(|id| !treatment_of(*id).is_fixed_by_default || options.freed.contains(id))
        .collect()
}

/// Returns the parameters of quantities that are absent from the log, or 0 in all rows.
pub fn unobserved_parameters(spec: &Spec, tracks: &[Track]) -> Vec<ParameterId> {
    let is_absent = |quantity: Quantity| {
        let mut samples = tracks.iter().flat_map(|track| &track.samples);
        samples.all(|sample| quantity.value_in(sample).is_none_or(|value| value == 0.0))
    };
    spec.needs().filter(|(_, quantity)| is_absent(*quantity)).map(|(id, _)| id).collect()
}
