//! A model fitted to rows: starts, optimiser, sub-steps.
//!
//! Bounded Levenberg-Marquardt ([`super::minimise`]) from several starting points ([`super::start`]). A
//! log's period is coarse for a bristle; the simulation is refined ([`Resolution`]) until a finer one
//! would move no parameter by more than a tenth of its standard error.

use super::coordinates::Coordinates;
use super::minimise::{Minimum, Stop, minimise, minimise_from};
use super::predict::predict;
use super::reduce::reduce;
use super::scales::Scales;
use super::simulate::Resolution;
use super::start;
use super::statistics::{autocorrelation_time, step_in_standard_errors};
use super::streaming_qr::Reduced;
use super::track::{Rows, Track};
use super::treatment;
use crate::spec::Spec;
use compensator_core::{ParameterId, Parameters, Quantity};

/// A finer simulation must not move a parameter by more than this many standard errors.
const STEP_TOLERANCE: f64 = 0.1;

/// Sub-steps of the coarser simulation at which refining ends, whatever it still moves.
const MOST_SUBSTEPS: usize = 4;

/// Simulations per parameter after which the optimiser gives up; a fit that takes more crawls along a
/// valley the data leave open.
const PATIENCE: usize = 20;

/// A fit ends where a step would lower the sum of squares by less than this share of one row's: parameters
/// are then within a thirtieth of a standard error of the optimum.
const ENOUGH: f64 = 1e-3;

/// The same for fits that are only compared with others, or go on at a finer resolution: a third of a
/// standard error. The last tenth of the way to the optimum takes half of a fit's simulations.
pub const ENOUGH_TO_COMPARE: f64 = 0.1;

/// The same for fits of which only the best goes on, or that go on at a finer resolution.
const PATIENCE_ON_THE_WAY: usize = 5;

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
    /// Fit a law that cannot give out energy, as a joint driver asks for; else the law as the rows want it.
    pub passive: bool,
    /// Simulations per parameter after which the optimiser gives up.
    pub patience: usize,
    /// Where a step would lower the sum of squares by less than this share of one row's, the fit ends.
    pub enough: f64,
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
            patience: PATIENCE,
            enough: ENOUGH,
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
    pub collinear: Vec<ParameterId>,
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

/// Fits a model to rows: starts, optimiser, sub-steps.
///
/// # Errors
/// If the model carries more terms than the core takes.
pub fn fit(spec: &Spec, base: &Parameters<f64>, rows: Rows, options: &FitOptions) -> Solution {
    let scales = Scales::of(rows.tracks);
    let base = &seeing_all(base.clone());
    let free = free_parameters(spec, base, rows.tracks, options);
    let given = options.substeps.is_some() || options.resolution.is_some();
    let refines = spec.law.has_bristles() && !given;
    let plain = Resolution { substeps: options.substeps.unwrap_or(1).max(1), extrapolated: false };
    let mut resolution = options.resolution.unwrap_or(plain);
    let candidates = match &options.start {
        Some(start) => vec![seeing_all(start.clone())],
        None => start::candidates(spec, base, &free, rows, &scales, resolution, options.starts),
    };
    let (collinear, at_first) = match candidates.first() {
        Some(start) => collinear(start, &free, rows, &scales),
        None => Default::default(),
    };
    // Where nothing had to go, the first fit begins at the very point the collinear were sought at.
    let mut at_first = at_first.filter(|_| collinear.is_empty() && resolution == Resolution::PLAIN);
    let free: Vec<ParameterId> = free.into_iter().filter(|id| !collinear.contains(id)).collect();
    let mut evaluations = 0;
    let last = Stop { patience: options.patience, enough: options.enough };
    // Where more is to come, no fit goes all the way but the last.
    let is_last = candidates.len() < 2 && !refines;
    let on_the_way = Stop {
        patience: last.patience.min(PATIENCE_ON_THE_WAY),
        enough: last.enough.max(ENOUGH_TO_COMPARE),
    };
    let stop = if is_last { last } else { on_the_way };
    let best = candidates
        .iter()
        .map(|start| {
            let coordinates = Coordinates::new(start, &free, &scales);
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
        let Minimum { point, reduced, evaluations: used, converged } =
            minimise(&best.coordinates, &best.point, rows, resolution, on_the_way);
        evaluations += used;
        best = Solution { point, reduced, resolution, converged, ..best };
    }
    if !is_last {
        let Solution { coordinates, point, reduced, .. } = best;
        let Minimum { point, reduced, evaluations: used, converged } =
            minimise_from(&coordinates, &point, reduced, rows, resolution, last);
        evaluations += used;
        best = Solution { coordinates, point, reduced, converged, ..best };
    }
    best.evaluations = evaluations;
    best
}

/// The declared speed limits the step; a fit is to see all that was measured, wherever it begins.
fn seeing_all(mut parameters: Parameters<f64>) -> Parameters<f64> {
    parameters.envelope.velocity_max_rad_s = f32::MAX;
    parameters
}

/// Free parameters whose effect is, to rounding, a combination of those before them: in sliding, a
/// difference of the two directions' Coulomb levels is an offset. Left free, the pair would run off
/// to infinity hand in hand; the later one (a term, if one is a term) stays where it is. With them,
/// where the parameters were looked at in the order of `free`, the problem at the start.
fn collinear(
    start: &Parameters<f64>,
    free: &[ParameterId],
    rows: Rows,
    scales: &Scales,
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
    // make a difference: no collinear has one.
    let norm =
        |j: usize| (0..=j).map(|i| reduced.factor[i * count + j].powi(2)).sum::<f64>().sqrt();
    let is_collinear = |j: &usize| {
        let norm = norm(*j);
        norm > 0.0 && reduced.factor[j * count + j].abs() < ROUNDING * norm
    };
    let collinear = (0..count).filter(is_collinear).map(|j| ordered[j]).collect();
    (collinear, (ordered == free).then_some(reduced))
}

/// The parameters of a model the rows can say anything of at all.
fn free_parameters(
    spec: &Spec,
    base: &Parameters<f64>,
    tracks: &[Track],
    options: &FitOptions,
) -> Vec<ParameterId> {
    let unseen = unseen(spec, tracks);
    base.active()
        .filter(|id| !options.fixed.contains(id) && !unseen.contains(id))
        .filter(|id| !treatment::of(*id).kept || options.freed.contains(id))
        .collect()
}

/// Parameters that act on a quantity which is not there, or 0 throughout.
pub fn unseen(spec: &Spec, tracks: &[Track]) -> Vec<ParameterId> {
    let silent = |quantity: Quantity| {
        let mut samples = tracks.iter().flat_map(|track| &track.samples);
        samples.all(|sample| quantity.of_sample(sample).is_none_or(|value| value == 0.0))
    };
    spec.needs().filter(|(_, quantity)| silent(*quantity)).map(|(id, _)| id).collect()
}
