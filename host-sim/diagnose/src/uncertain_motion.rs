//! Weights of the rows of a log whose motion is uncertain.
//!
//! A bristle turns a position error of a micrometre into newtons. With a noisy motion, even a model
//! with its true parameters misses rows at rest and at reversals by many times the torque noise.
//! These few rows would dominate a sum of squares.
//!
//! A fitted law is therefore also simulated with draws of the motion within its uncertainty
//! ([`Track::velocity_draws`]). The spread of the simulated torques in each row is an error that no
//! model can avoid. A row has the weight `s^2 / (s^2 + m^2)`, where `m` is this error and `s` is
//! the law's residual on rows with a certain motion. Both are in Nm. The noise floor contains the
//! torque noise and `m`.

use super::model::FittedModel;
use super::train_test::TrainTest;
use compensator_core::Parameters;
use friction_fit::{Resolution, Scales, Track, initial_state, simulate};
use joint_log::statistics::quantile_by_count;
use rayon::prelude::*;

/// Rows on either side over which a row's error is averaged, because three draws are too few for a
/// single row.
const NEIGHBOURS: usize = 2;

/// Median of the magnitude of a standard normal variable.
const MEDIAN: f64 = 0.6745;

/// Returns the log with each row weighted by the effect of the uncertain motion on this model.
/// Returns `None` if the motion counts as exact.
pub fn weighed(log: &TrainTest, model: &FittedModel) -> Option<TrainTest> {
    if log.train_tracks.iter().chain(&log.test_tracks).all(|track| track.velocity_draws.is_empty())
    {
        return None;
    }
    let mut log = log.clone();
    let mut scale = None;
    for tracks in [&mut log.train_tracks, &mut log.test_tracks] {
        let residuals: Vec<Vec<f64>> = tracks
            .par_iter_mut()
            .map(|track| {
                let torque = follow(&model.parameters, track, model.resolution, None);
                track.motion_error = errors(&model.parameters, track, model.resolution, &torque);
                track
                    .torque
                    .iter()
                    .zip(&torque)
                    .map(|(measured, torque)| measured - torque)
                    .collect()
            })
            .collect();
        let scale = *scale.get_or_insert_with(|| typical(tracks, &residuals));
        for track in tracks.iter_mut().filter(|track| !track.motion_error.is_empty()) {
            let error = std::mem::take(&mut track.motion_error);
            track.scale_weights(|row| 1.0 / (1.0 + (error[row] / scale).powi(2)));
            track.motion_error = error;
        }
    }
    Some(log)
}

/// Returns the model's torque along a track, Nm. `draw` shifts the motion.
fn follow(
    parameters: &Parameters<f64>,
    track: &Track,
    resolution: Resolution,
    draw: Option<&[f64]>,
) -> Vec<f64> {
    let shifted = draw.map(|draw| {
        let mut track = track.clone();
        for (sample, deviation) in track.samples.iter_mut().zip(draw) {
            sample.velocity_rad_s += deviation;
        }
        track
    });
    let track = shifted.as_ref().unwrap_or(track);
    let held = initial_state(parameters, track, resolution).map(|start| start.held);
    let mut torques = Vec::with_capacity(track.len());
    simulate(parameters, track, held, resolution, |_, torque: f64, _| {
        torques.push(torque);
        true
    });
    torques
}

/// Returns the RMS difference of the draws' torques in each row, Nm; empty if there are no draws.
pub(crate) fn errors(
    parameters: &Parameters<f64>,
    track: &Track,
    resolution: Resolution,
    torque: &[f64],
) -> Vec<f64> {
    if track.velocity_draws.is_empty() {
        return Vec::new();
    }
    let mut squares = vec![0.0; track.len()];
    for draw in &track.velocity_draws {
        let other = follow(parameters, track, resolution, Some(draw));
        for ((sum, undisturbed), other) in squares.iter_mut().zip(torque).zip(other) {
            *sum += (other - undisturbed).powi(2) / track.velocity_draws.len() as f64;
        }
    }
    (0..squares.len())
        .map(|row| {
            let from = row.saturating_sub(NEIGHBOURS);
            let around = &squares[from..(row + NEIGHBOURS + 1).min(squares.len())];
            (around.iter().sum::<f64>() / around.len() as f64).sqrt()
        })
        .collect()
}

/// Returns the typical residual on rows with a certain motion, Nm. The other rows hardly change the
/// median.
fn typical(tracks: &[Track], residuals: &[Vec<f64>]) -> f64 {
    let judged = tracks.iter().zip(residuals).flat_map(|(track, residual)| {
        let rows = residual.iter().enumerate().filter(|(row, _)| track.is_included(*row));
        rows.map(|(_, residual)| residual.abs())
    });
    let median = quantile_by_count(judged.collect(), 0.5).unwrap_or_default() / MEDIAN;
    median.max(Scales::of(tracks).noise).max(f64::MIN_POSITIVE)
}
