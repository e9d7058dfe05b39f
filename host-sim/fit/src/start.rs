//! Starting points of a fit.
//!
//! The error of a bristle model has local minima: a stiffness ten times too low fits presliding as viscosity.
//! Quantities that enter linearly (Coulomb, viscous, offset, inertia, gravity) come from ordinary least squares on the
//! sliding rows. The others (stiffness, Stribeck velocity, excess of the static level) form a coarse grid around
//! values that follow from speed and travel. The grid is evaluated on a part of the rows. The best few points are
//! improved there, and the best of those are returned.

use super::coordinates::Coordinates;
use super::initial_state::initial_state;
use super::metrics::Metrics;
use super::minimise::{StopCriteria, minimise};
use super::scales::Scales;
use super::simulate::{Resolution, simulate};
use super::track::{Rows, Track};
use super::treatment;
use crate::spec::Spec;
use ParameterId as Id;
use compensator_core::{ParameterId, Parameters, Sample, TermKind};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Number of rows on which the grid is evaluated.
const TRIAL_ROWS: usize = 20_000;

/// Stop criteria of a trial fit, which only has to distinguish local minima.
const TRIAL: StopCriteria = StopCriteria { patience: 3, tolerance: 1.0, stagnation: 0.0 };

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
    for track in tracks {
        for (sample, torque) in track.samples.iter().zip(&track.torque) {
            if sample.velocity_rad_s.abs() < 0.02 * scales.speed {
                continue;
            }
            let row = DVector::from_iterator(count, parts.iter().map(|(_, part)| part(sample)));
            // Rows with NaN or infinity are skipped.
            if !row.iter().all(|value| value.is_finite()) {
                continue;
            }
            products.ger(1.0, &row, &row, 1.0);
            right.axpy(*torque, &row, 1.0);
        }
    }
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
    let mut first = base.clone();
    first.set(Id::TemperatureReference, scales.temperature_c);
    first.set(Id::DriftTime, (scales.campaign_s / 3.0).max(1.0));
    set_linear_parts(spec, &mut first, rows.tracks, scales);
    let coulomb = first.get(Id::CoulombTorque).max(0.05 * scales.torque);
    first.set(Id::CoulombTorque, coulomb);
    first.set(Id::CoulombTorqueNegative, coulomb);
    for id in ParameterId::ALL {
        // Fixed parameters keep the value from the caller.
        if !free.contains(id) && base.active().any(|active| active == *id) {
            let temperature = *id == Id::TemperatureReference;
            first.set(*id, if temperature { scales.temperature_c } else { base.get(*id) });
        }
    }
    let grid = grid(spec, free, &first, coulomb, scales);
    if grid.len() == 1 {
        return grid;
    }
    let trial = trial_tracks(rows.tracks);
    let trial = Rows { tracks: &trial, decimate: 1 };
    let cost = |start: &Parameters<f64>| -> f64 {
        let errors = trial.tracks.iter().map(|track| {
            let mut simulated = Vec::with_capacity(track.len());
            let held = initial_state(start, track, resolution).map(|state| state.held);
            simulate(start, track, held, resolution, |_, torque, _| {
                simulated.push(torque);
                true
            });
            Metrics::of(
                simulated
                    .into_iter()
                    .enumerate()
                    .map(|(row, own)| (track.torque[row], own, track.weight(row))),
            )
            .sse
        });
        errors.sum()
    };
    let mut evaluated: Vec<_> = grid.into_par_iter().map(|start| (cost(&start), start)).collect();
    evaluated.sort_by(|a, b| a.0.total_cmp(&b.0));
    evaluated.truncate(2 * count.max(1));
    let mut improved: Vec<_> = evaluated
        .into_par_iter()
        .map(|(_, start)| {
            let coordinates = Coordinates::new(&start, free, scales);
            let from = coordinates.point(&start);
            let minimum = minimise(&coordinates, &from, trial, resolution, TRIAL);
            (minimum.reduced.sum_of_squares(), coordinates.parameters::<f64>(&minimum.point))
        })
        .collect();
    improved.sort_by(|a, b| a.0.total_cmp(&b.0));
    improved.truncate(count.max(1));
    improved.into_iter().map(|(_, start)| start).collect()
}

/// Returns the grid of nonlinear parameters.
fn grid(
    spec: &Spec,
    free: &[ParameterId],
    first: &Parameters<f64>,
    coulomb: f64,
    scales: &Scales,
) -> Vec<Parameters<f64>> {
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
                        start.set(
                            Id::BristleDamping,
                            treatment::typical(Id::BristleDamping, scales),
                        );
                    }
                    if free.contains(&Id::BacklashTravel) {
                        start.set(
                            Id::BacklashTravel,
                            treatment::typical(Id::BacklashTravel, scales),
                        );
                    }
                    grid.push(start);
                }
            }
        }
    }
    // Parameters that a law does not have would repeat the same point.
    let own = |start: &Parameters<f64>| -> Vec<u64> {
        let ids = spec.law.parameters().iter();
        ids.map(|id| start.get(*id).to_bits()).collect()
    };
    let mut seen = std::collections::HashSet::new();
    grid.retain(|start| seen.insert(own(start)));
    grid
}

/// Returns evenly chosen tracks of about [`TRIAL_ROWS`] rows in total; long tracks are cut.
fn trial_tracks(tracks: &[Track]) -> Vec<Track> {
    let rows: usize = tracks.iter().map(Track::len).sum();
    let stride = rows.div_ceil(TRIAL_ROWS).clamp(1, tracks.len().max(1));
    let chosen: Vec<&Track> = tracks.iter().step_by(stride).collect();
    let most = (TRIAL_ROWS / chosen.len().max(1)).max(2000);
    chosen.into_iter().map(|track| track.part(0..track.len().min(most))).collect()
}
