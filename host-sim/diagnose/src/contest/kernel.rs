//! The driver's own law as a base law: its torque is linearised along the log.
//!
//! A law of columns with a free shape misses what a bristle does between two rows: its damping, the lag of its breakaway, and a
//! deflection that depends on speed. The driver's LuGre law is therefore fitted to the log, less the causes of the best
//! hypothesis so far, and its derivatives by the parameters are the columns of a law. LuGre's torque is homogeneous of degree
//! one in levels, stiffness and damping, so that the derivatives span the torque itself, but for what the bristles held at the
//! start of a run: that is one more column.
//!
//! The derivatives are those at the fitted point. As the causes change the point, the fit is repeated from there with the causes
//! of a better hypothesis.

use super::cause::{Variant, simulated};
use super::correction::Correction;
use super::law::{LawStart, SMALLEST_LEVEL};
use super::rows::Rows;
use crate::sensitivities::{Sensitivities, TrackSensitivities, sensitivities};
use crate::uncertain_motion;
use compensator_core::{LawKind, ParameterId, Parameters};
use friction_fit::linear::later;
use friction_fit::spec::Spec;
use friction_fit::{
    COMPARISON_STAGNATION, FitOptions, Resolution, Scales, TorqueLowPass, Track, fit, typical_value,
};
use rayon::prelude::*;

/// Most rows of a fit.
const MAX_FITTED_ROWS: usize = 10_000;

/// Fewest rows of a track that is cut.
const SHORTEST_TRACK: usize = 1500;

/// Most rows on which the starting points are tried.
const MAX_TRIED_ROWS: usize = 4_000;

/// Simulations per parameter of a trial.
const TRIAL_SIMULATIONS_PER_PARAMETER: usize = 3;

/// Smallest excess of the static level of a start, as a share of the level in sliding.
const SMALLEST_EXCESS: f64 = 0.1;

/// Simulations per parameter of a fit.
const SIMULATIONS_PER_PARAMETER: usize = 5;

/// Where a fit begins.
#[derive(Clone, Debug)]
pub struct KernelStart {
    /// Parameters.
    pub parameters: Parameters<f64>,
    /// Resolution that is known to be fine enough.
    pub resolution: Option<Resolution>,
}

impl KernelStart {
    /// Returns the point that a law of shapes describes, with a breakaway level of its own: a law of columns may have none.
    pub fn of_shapes(rows: &Rows, law: &LawStart) -> Option<Self> {
        let spec = Spec::law(LawKind::Lugre).on(&rows.rigid_body.terms());
        let mut parameters = spec.parameters().ok()?;
        let scales = Scales::of(&rows.tracks);
        let coulomb = law.coulomb.max(SMALLEST_LEVEL * scales.torque);
        let level = coulomb + law.static_excess.clamp(SMALLEST_EXCESS * coulomb, coulomb);
        let values = [
            (ParameterId::CoulombTorque, coulomb),
            (ParameterId::StaticTorque, level),
            (ParameterId::StribeckVelocity, law.stribeck_velocity),
            (ParameterId::ViscousFriction, law.viscous),
            (ParameterId::BristleStiffness, coulomb / law.travel.max(f64::MIN_POSITIVE)),
            (ParameterId::BristleDamping, typical_value(ParameterId::BristleDamping, &scales)),
        ];
        for (id, value) in values {
            parameters.set(id, value.clamp(id.info().lower, id.info().upper));
        }
        Some(Self { parameters, resolution: None })
    }
}

/// A brief fit from one start.
struct Trial {
    sum_of_squares: f64,
    parameters: Parameters<f64>,
}

/// A law of the driver at a point of its parameters.
#[derive(Clone, Debug)]
pub struct KernelLaw {
    /// Correction of the log to whose target it was fitted.
    pub correction: Correction,
    /// Parameters at the point.
    pub parameters: Parameters<f64>,
    /// Time resolution of its simulation.
    pub resolution: Resolution,
    /// Derivative of the torque by each free parameter, then what is left of the torque beside them, in all rows.
    pub columns: Vec<Vec<f64>>,
    /// Torque of the friction level, in all rows.
    pub level: Vec<f64>,
    /// Displacement over which the bristles build up the Coulomb level.
    pub travel: f64,
    /// What the law leaves of its target, in all rows.
    pub residual: Vec<f64>,
    /// Share of the unknown torque at the start of its track that a row still holds.
    pub memory: Vec<f64>,
    /// RMS error of the torque that comes from the uncertain motion, in all rows; empty if the motion is exact.
    pub motion_error: Vec<f64>,
    /// Columns of causes that change the dynamics of the bristles.
    pub(crate) simulated: Vec<Variant>,
}

impl KernelLaw {
    /// Fits the law to `target`, the torque that friction and rigid body are to explain, and linearises it. The fit begins at
    /// each of the starts, briefly, and continues from the best. `None` if the law has no finite fit.
    pub fn fit(
        rows: &Rows,
        target: &[f64],
        correction: Correction,
        starts: &[KernelStart],
    ) -> Option<Self> {
        let spec = Spec::law(LawKind::Lugre).on(&rows.rigid_body.terms());
        let base = spec.parameters().ok()?;
        let tracks = tracks(rows, target, correction);
        let options = |start: &KernelStart, patience: usize| FitOptions {
            resolution: start.resolution,
            patience,
            stagnation: COMPARISON_STAGNATION,
            ..FitOptions::for_comparison(Some(start.parameters.clone()))
        };
        let trial = shortened(&tracks, MAX_TRIED_ROWS);
        let trial = friction_fit::Rows { tracks: &trial, decimate: 1 };
        // Lazy: a single start needs no trial, and none is made.
        let tried = starts.par_iter().map(|start| {
            let start = KernelStart { resolution: Some(Resolution::PLAIN), ..start.clone() };
            let options = options(&start, TRIAL_SIMULATIONS_PER_PARAMETER);
            let solution = fit(&spec, &base, trial, &options);
            Trial {
                sum_of_squares: solution.reduced.sum_of_squares(),
                parameters: solution.parameters(),
            }
        });
        let start = match starts {
            [only] => only.clone(),
            _ => {
                let best = tried.min_by(|a, b| a.sum_of_squares.total_cmp(&b.sum_of_squares))?;
                KernelStart { parameters: best.parameters, resolution: None }
            }
        };
        let fitted = shortened(&tracks, MAX_FITTED_ROWS);
        let fitted = friction_fit::Rows { tracks: &fitted, decimate: 1 };
        let solution = fit(&spec, &base, fitted, &options(&start, SIMULATIONS_PER_PARAMETER));
        let free: Vec<ParameterId> = solution.coordinates.ids().collect();
        let (parameters, resolution) = (solution.parameters(), solution.resolution);
        Self::linearised(rows, &tracks, correction, parameters, &free, resolution)
    }

    /// Returns the point of the law, from which another fit may begin.
    pub fn start(&self) -> KernelStart {
        KernelStart { parameters: self.parameters.clone(), resolution: Some(self.resolution) }
    }

    fn linearised(
        rows: &Rows,
        tracks: &[Track],
        correction: Correction,
        parameters: Parameters<f64>,
        free: &[ParameterId],
        resolution: Resolution,
    ) -> Option<Self> {
        let sensitivities_at_fit = sensitivities(&parameters, free, tracks, resolution);
        let along_rows = |series: &(dyn Fn(&TrackSensitivities) -> &[f64] + Sync)| {
            let along = tracks.iter().zip(&sensitivities_at_fit.tracks);
            rows.along_tracks(along.map(|(track, along)| (track, series(along))))
        };
        let jacobian: Vec<Vec<f64>> =
            (0..free.len()).map(|index| along_rows(&|along| &along.jacobian[index])).collect();
        let level = along_rows(&|along| &along.level);
        let torque = along_rows(&|along| &along.torque);
        let memory = along_rows(&|along| &along.memory);
        let columns = columns_with_rest(&parameters, free, jacobian, &torque);
        let coulomb = parameters.get(ParameterId::CoulombTorque);
        let travel = coulomb / parameters.get(ParameterId::BristleStiffness);
        let series = columns.iter().chain([&level, &torque, &memory]).flatten();
        if !series.chain([&travel]).all(|value| value.is_finite()) {
            return None;
        }
        let target = rows.along_tracks(tracks.iter().map(|track| (track, track.torque.as_slice())));
        let residual =
            target.iter().zip(&torque).map(|(target, simulated)| target - simulated).collect();
        // Differences of two simulations of the same coarse steps: the steps' error cancels.
        let coarse = sensitivities(&parameters, &[], tracks, Resolution::PLAIN);
        let simulated = simulated::variants(rows, tracks, &coarse, travel);
        let motion_error = motion_error(rows, tracks, &coarse);
        Some(Self {
            correction,
            parameters,
            resolution,
            columns,
            level,
            travel,
            residual,
            memory,
            motion_error,
            simulated,
        })
    }
}

/// Returns the derivative of the torque by each free parameter, then what is left of the torque beside them, if anything.
///
/// A homogeneous torque is the sum of each parameter times its derivative (Euler). The Stribeck velocity has degree zero, so
/// its derivative is a column but no part of this sum. The rest is what the bristles held at the start, as far as it remains.
fn columns_with_rest(
    parameters: &Parameters<f64>,
    free: &[ParameterId],
    jacobian: Vec<Vec<f64>>,
    torque: &[f64],
) -> Vec<Vec<f64>> {
    let homogeneous: Vec<(f64, &Vec<f64>)> = free
        .iter()
        .zip(&jacobian)
        .filter(|(id, _)| **id != ParameterId::StribeckVelocity)
        .map(|(id, column)| (parameters.get(*id), column))
        .collect();
    let explained =
        |row: usize| homogeneous.iter().map(|(value, column)| value * column[row]).sum::<f64>();
    let rest: Vec<f64> =
        torque.iter().enumerate().map(|(row, torque)| torque - explained(row)).collect();
    let mut columns = jacobian;
    if rest.iter().any(|rest| *rest != 0.0) {
        columns.push(rest);
    }
    columns
}

/// Returns the error of the torque that the uncertain motion causes; empty if the motion is exact.
fn motion_error(rows: &Rows, tracks: &[Track], model: &Sensitivities) -> Vec<f64> {
    if tracks.iter().all(|track| track.velocity_draws.is_empty()) {
        return Vec::new();
    }
    let error = |(track, along): (&Track, &TrackSensitivities)| {
        uncertain_motion::errors(&model.parameters, track, model.resolution, &along.torque)
    };
    let errors: Vec<Vec<f64>> = tracks.par_iter().zip(&model.tracks).map(error).collect();
    rows.along_tracks(tracks.iter().zip(errors.iter().map(Vec::as_slice)))
}

/// Returns the tracks with the target as their torque, and the rows' weights.
fn tracks(rows: &Rows, target: &[f64], correction: Correction) -> Vec<Track> {
    let mut tracks = rows.tracks.clone();
    // The model of a fit is not late, so the torque is taken early.
    let advanced_target = match correction {
        Correction::TorqueLate(delay_rows) => Some(later(target, &rows.runs, -delay_rows)),
        _ => None,
    };
    let target = advanced_target.as_deref().unwrap_or(target);
    for track in &mut tracks {
        let first = rows.first_row(track);
        let of_track = first..first + track.len();
        track.torque.copy_from_slice(&target[of_track.clone()]);
        track.weights = rows.weights[of_track].iter().map(|weight| weight * weight).collect();
        if let Correction::TorqueLowPass(time_rows, shape) = correction {
            track.torque_low_pass = TorqueLowPass { time_s: time_rows * rows.step_s, shape };
        }
    }
    tracks
}

/// Returns evenly chosen tracks of about `wanted` rows in total; of long tracks the first rows.
///
/// The fit only gives the point at which the law is linearised. Finalists are compared on held-out runs, so their excerpt keeps
/// the middle of every track.
fn shortened(tracks: &[Track], wanted: usize) -> Vec<Track> {
    let rows: usize = tracks.iter().map(Track::len).sum();
    let stride = rows.div_ceil(wanted).clamp(1, tracks.len().max(1));
    let chosen: Vec<&Track> = tracks.iter().step_by(stride).collect();
    let most = (wanted / chosen.len().max(1)).max(SHORTEST_TRACK);
    chosen.into_iter().map(|track| track.part(0..track.len().min(most))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::Sample;

    #[test]
    fn parameters_times_derivatives_and_rest_are_the_torque() {
        let parameters = Parameters::new(LawKind::Lugre)
            .with(ParameterId::CoulombTorque, 3.0)
            .with(ParameterId::StaticTorque, 4.0)
            .with(ParameterId::StribeckVelocity, 0.05)
            .with(ParameterId::ViscousFriction, 2.0)
            .with(ParameterId::BristleStiffness, 300.0)
            .with(ParameterId::BristleDamping, 1.0);
        let free: Vec<ParameterId> = parameters.active().collect();
        let velocity = |row: usize| 0.2 * (row as f64 / 40.0).sin();
        let samples = |row| Sample { velocity_rad_s: velocity(row), ..Sample::default() };
        // The held torque at the start is estimated from it.
        let torque = vec![1.0; 400];
        let track = [Track::even((0..400).map(samples).collect(), torque, 1e-3)];
        let simulated = &sensitivities(&parameters, &free, &track, Resolution::PLAIN).tracks[0];
        let columns =
            columns_with_rest(&parameters, &free, simulated.jacobian.clone(), &simulated.torque);
        let [derivatives @ .., rest] = columns.as_slice() else { panic!("no columns") };
        assert_eq!(derivatives, simulated.jacobian);
        let held = simulated.held.unwrap();
        assert!((0.1..3.9).contains(&held.abs()), "{held}");
        for row in 0..400 {
            let without_stribeck = free.iter().zip(derivatives);
            let sum: f64 = without_stribeck
                .filter(|(id, _)| **id != ParameterId::StribeckVelocity)
                .map(|(id, column)| parameters.get(*id) * column[row])
                .sum();
            assert!((sum + rest[row] - simulated.torque[row]).abs() < 1e-12, "{row}");
            let remembered = held * simulated.memory.get(row).copied().unwrap_or_default();
            assert!((rest[row] - remembered).abs() < 1e-6, "{row}: {} {remembered}", rest[row]);
        }
    }
}
