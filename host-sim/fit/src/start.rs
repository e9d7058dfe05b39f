//! Starting points of a fit.
//!
//! The error of a bristle model has local minima: a stiffness ten times too low fits presliding as viscosity.
//! Quantities that enter linearly (Coulomb, viscous, offset, inertia, gravity) come from ordinary least squares on the
//! sliding rows. The others (stiffness, Stribeck velocity, excess of the static level) form a coarse grid around
//! values that follow from speed and travel. The grid is evaluated on a part of the rows. The best few points are
//! improved there. Of those that descend to one minimum the best is kept, and the best few of these are returned.

use super::coordinates::Coordinates;
use super::initial_state::initial_state;
use super::metrics::Metrics;
use super::minimise::{Minimum, StopCriteria, minimise_from};
use super::reduce::reduce;
use super::scales::Scales;
use super::simulate::{Resolution, simulate};
use super::streaming_qr::Reduced;
use super::track::{Rows, Track};
use super::treatment::typical_value;
use crate::spec::Spec;
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters, Sample, TermKind};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Number of rows on which the grid is evaluated.
const TRIAL_ROWS: usize = 8000;

/// Length of the parts of the log that these rows come from, rows.
const TRIAL_PART: usize = 2000;

/// Speed from which a joint slides, as a share of the usual high speed.
const MIN_SLIDING_SHARE: f64 = 0.02;

/// Least Coulomb level of a start, as a share of the RMS torque.
const MIN_COULOMB_SHARE: f64 = 0.05;

/// Stop criteria of a trial fit, which only has to distinguish local minima.
const TRIAL: StopCriteria = StopCriteria { patience: 3, tolerance: 30.0, stagnation: 0.01 };

/// Stop criteria of a start on the trial rows. Evaluations there are cheaper than on all rows.
const POLISH: StopCriteria = StopCriteria { patience: 5, tolerance: 0.1, stagnation: 0.0 };

/// A parameter and the regressor that it multiplies.
type LinearPart = (ParameterId, fn(&Sample<f64>) -> f64);

/// Returns the linear parts of the torque, each with the parameter that scales it.
fn linear_parts(spec: &Spec, base: &Parameters<f64>) -> Vec<LinearPart> {
    let mut parts: Vec<LinearPart> = vec![
        (Id::CoulombTorque, |s| s.velocity_rad_s.signum()),
        (Id::ViscousFriction, |s| s.velocity_rad_s),
    ];
    for term in &base.terms {
        match term {
            TermKind::TorqueOffset => parts.push((Id::TorqueOffset, |_| 1.0)),
            TermKind::UnmodelledInertia => parts.push((Id::Inertia, |s| s.acceleration_rad_s2)),
            TermKind::GravityImbalance => {
                parts.push((Id::GravitySine, |s| s.position_rad.sin()));
                parts.push((Id::GravityCosine, |s| s.position_rad.cos()));
            }
            TermKind::LoadGain => parts.push((Id::LoadGain, |s| s.load_torque_nm)),
            _ => {}
        }
    }
    if spec.law.parameters().contains(&Id::TorqueOffset) {
        parts.push((Id::TorqueOffset, |_| 1.0));
    }
    parts
}

/// Sets the linear parts to their least-squares values on the sliding rows.
fn set_linear_parts(
    spec: &Spec,
    parameters: &mut Parameters<f64>,
    tracks: &[Track],
    scales: &Scales,
) {
    let parts = linear_parts(spec, parameters);
    let count = parts.len();
    let (mut products, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
    let mut row = vec![0.0; count];
    for track in tracks {
        for (sample, torque) in track.samples.iter().zip(&track.torque) {
            if sample.velocity_rad_s.abs() < MIN_SLIDING_SHARE * scales.speed {
                continue;
            }
            row.iter_mut().zip(&parts).for_each(|(value, (_, part))| *value = part(sample));
            // Rows with NaN or infinity are skipped.
            if !row.iter().all(|value| value.is_finite()) {
                continue;
            }
            for (i, value) in row.iter().enumerate() {
                right[i] += torque * value;
                (0..=i).for_each(|j| products[(i, j)] += value * row[j]);
            }
        }
    }
    products.fill_upper_triangle_with_lower_triangle();
    // The matrix is scaled to a unit diagonal, so that the cut-off does not depend on units.
    let scale = products.diagonal().map(|d: f64| if d > 0.0 { 1.0 / d.sqrt() } else { 0.0 });
    let scaled = DMatrix::from_fn(count, count, |i, j| products[(i, j)] * scale[i] * scale[j]);
    // Products of finite rows may overflow. The decomposition would then not terminate.
    if !scaled.iter().all(|entry| entry.is_finite()) {
        return;
    }
    let solved = scaled.svd(true, true).solve(&right.component_mul(&scale), 1e-10);
    if let Ok(solution) = solved {
        for ((id, _), value) in parts.iter().zip(solution.component_mul(&scale).iter()) {
            parameters.set(*id, *value);
        }
    }
}

/// Returns the best few starting points for the free parameters.
pub fn candidates(
    spec: &Spec,
    base: &Parameters<f64>,
    free: &[ParameterId],
    rows: Rows,
    scales: &Scales,
    resolution: Resolution,
    count: usize,
) -> Vec<Parameters<f64>> {
    let first = first_point(spec, base, free, rows.tracks, scales);
    let grid = grid(spec, free, &first, scales);
    if grid.len() == 1 {
        return grid;
    }
    let trial = trial_tracks(rows.tracks);
    let trial = Rows { tracks: &trial, decimate: 1 };
    let error = |start: &Parameters<f64>| trial_error(start, trial.tracks, resolution);
    let mut evaluated: Vec<_> = grid.into_par_iter().map(|start| (error(&start), start)).collect();
    evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
    let scales = &match evaluated.first() {
        Some((_, best)) => scales.beside(best, trial, resolution),
        None => *scales,
    };
    evaluated.truncate(2 * count.max(1));
    let improve = |start: &Parameters<f64>| {
        let coordinates = Coordinates::new(start, free, scales);
        let from = coordinates.point(start);
        let at_start = reduce(&coordinates, &from, trial, resolution);
        let Minimum { point, reduced, .. } =
            minimise_from(&coordinates, &from, at_start, trial, resolution, TRIAL);
        TrialFit { coordinates, point, reduced }
    };
    let mut improved: Vec<TrialFit> =
        evaluated.into_par_iter().map(|(_, start)| improve(&start)).collect();
    improved.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
    let mut kept: Vec<TrialFit> = Vec::new();
    for fit in improved {
        if kept.len() < count.max(1) && !kept.iter().any(|better| fit.descends_to(better)) {
            kept.push(fit);
        }
    }
    let polished = kept.into_par_iter().map(|TrialFit { coordinates, point, reduced }| {
        let minimum = minimise_from(&coordinates, &point, reduced, trial, resolution, POLISH);
        coordinates.parameters::<f64>(&minimum.point)
    });
    polished.collect()
}

/// Returns the point around which the grid lies: linear parts by least squares, fixed parameters with the caller's values.
fn first_point(
    spec: &Spec,
    base: &Parameters<f64>,
    free: &[ParameterId],
    tracks: &[Track],
    scales: &Scales,
) -> Parameters<f64> {
    let mut first = base.clone();
    first.set(Id::DriftTime, (scales.campaign_s / 3.0).max(1.0));
    set_linear_parts(spec, &mut first, tracks, scales);
    let coulomb = first.get(Id::CoulombTorque).max(MIN_COULOMB_SHARE * scales.torque);
    first.set(Id::CoulombTorque, coulomb);
    first.set(Id::CoulombTorqueNegative, coulomb);
    for id in base.active().filter(|id| !free.contains(id)) {
        first.set(id, base.get(id));
    }
    // The reference of a fit is the mean of its log.
    first.set(Id::TemperatureReference, scales.temperature_c);
    first
}

/// Returns the squared error of a start on the trial rows.
fn trial_error(start: &Parameters<f64>, tracks: &[Track], resolution: Resolution) -> f64 {
    let errors = tracks.iter().map(|track| {
        let mut rows = Vec::with_capacity(track.len());
        let held = initial_state(start, track, resolution).map(|state| state.held);
        simulate(start, track, held, resolution, |row, torque, _| {
            rows.push(track.compared(row, torque));
            true
        });
        Metrics::of(rows.into_iter()).sse
    });
    errors.sum()
}

/// A start improved on the trial rows.
struct TrialFit {
    coordinates: Coordinates,
    point: Vec<f64>,
    reduced: Reduced,
}

impl TrialFit {
    fn cost(&self) -> f64 {
        self.reduced.sum_of_squares()
    }

    /// Returns true if this start and a better one descend to one minimum: the quadratic model of the error around the better
    /// one predicts the error of this one. In another valley the model predicts much more.
    fn descends_to(&self, better: &Self) -> bool {
        /// Largest ratio of the predicted difference of the errors to the actual one.
        const MAX_RATIO: f64 = 2.0;
        /// Difference that counts as none, as a share of the error. An improved start is not at its minimum.
        const NEGLIGIBLE: f64 = 1e-3;
        let count = self.point.len();
        let step: Vec<f64> = self.point.iter().zip(&better.point).map(|(a, b)| a - b).collect();
        let along = |i: usize| -> f64 {
            let row = &better.reduced.factor[i * count..][..count];
            row.iter().zip(&step).map(|(factor, step)| factor * step).sum()
        };
        let predicted: f64 = (0..count).map(|i| along(i).powi(2)).sum();
        let actual = self.cost() - better.cost();
        predicted <= MAX_RATIO * actual + NEGLIGIBLE * better.cost()
    }
}

/// Returns the grid of nonlinear parameters.
fn grid(
    spec: &Spec,
    free: &[ParameterId],
    first: &Parameters<f64>,
    scales: &Scales,
) -> Vec<Parameters<f64>> {
    let coulomb = first.get(Id::CoulombTorque);
    let values = |id: Id, wanted: &[f64]| -> Vec<f64> {
        if free.contains(&id) { wanted.to_vec() } else { vec![first.get(id)] }
    };
    let stribeck = values(Id::StribeckVelocity, &[0.01, 0.05, 0.25].map(|s| s * scales.speed));
    let excess = values(Id::StaticTorque, &[1.1, 1.6].map(|ratio| ratio * coulomb));
    // Presliding travel, over which the bristles build up the torque.
    let travels = [1e-4, 1e-3, 1e-2, 1e-1].map(|share| coulomb / (share * scales.travel));
    let stiffness = values(Id::BristleStiffness, &travels);
    let slope = values(Id::AtanSlope, &[1.0, 10.0, 100.0].map(|s| s / scales.speed));
    let mut grid = Vec::new();
    for stribeck_velocity in &stribeck {
        for static_torque in &excess {
            for bristle_stiffness in &stiffness {
                for atan_slope in &slope {
                    let mut start = first.clone();
                    start.set(Id::StribeckVelocity, *stribeck_velocity);
                    start.set(Id::StaticTorque, *static_torque);
                    start.set(Id::StaticTorqueNegative, *static_torque);
                    start.set(Id::BristleStiffness, *bristle_stiffness);
                    start.set(Id::AtanSlope, *atan_slope);
                    if free.contains(&Id::BristleDamping) {
                        start.set(Id::BristleDamping, typical_value(Id::BristleDamping, scales));
                    }
                    if free.contains(&Id::BacklashTravel) {
                        start.set(Id::BacklashTravel, typical_value(Id::BacklashTravel, scales));
                    }
                    grid.push(start);
                }
            }
        }
    }
    // Parameters that a law does not have would repeat the same point.
    let point_of_law = |start: &Parameters<f64>| -> Vec<u64> {
        let ids = spec.law.parameters().iter();
        ids.map(|id| start.get(*id).to_bits()).collect()
    };
    let mut seen = std::collections::HashSet::new();
    grid.retain(|start| seen.insert(point_of_law(start)));
    grid
}

/// Returns parts of about [`TRIAL_ROWS`] rows in total, spread evenly over the tracks and along them.
fn trial_tracks(tracks: &[Track]) -> Vec<Track> {
    let rows: usize = tracks.iter().map(Track::len).sum();
    if rows <= TRIAL_ROWS {
        return tracks.to_vec();
    }
    let parts = TRIAL_ROWS / TRIAL_PART;
    let mut before = 0;
    let mut chosen = Vec::new();
    for track in tracks {
        let of_track = |row: usize| row.clamp(before, before + track.len()) - before;
        for start in (0..parts).map(|part| rows * part / parts) {
            let part = of_track(start)..of_track(start + TRIAL_PART);
            if part.len() > 1 {
                chosen.push(track.part(part));
            }
        }
        before += track.len();
    }
    chosen
}
