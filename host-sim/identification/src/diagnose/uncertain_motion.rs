//! What each row can be judged by, where the motion is not known exactly.
//!
//! A bristle turns an error of a micrometre into newtons: at rest and at reversals a model with its true
//! parameters misses by ten times the torque's noise if it is driven by a noisy motion, and a sum of squares lets
//! those few rows decide. So a fitted law is driven by draws of the motion as it may have been as well
//! ([`Track::velocity_draws`]); what the draws' torques differ by, row by row, is an error no model can avoid.
//! A row then counts as `s^2 / (s^2 + m^2)`: `m` that error, `s` what the law misses rows of sure motion by. The
//! floor, what the best possible model would leave, has both the torque's noise and `m` in it.

use super::model::Fitted;
use super::train_test::TrainTest;
use crate::fit::Track;
use crate::fit::initial_state::initial_state;
use crate::fit::scales::Scales;
use crate::fit::simulate::{Resolution, simulate};
use compensator_core::Parameters;
use rayon::prelude::*;

/// Rows on either side that a row's error is averaged with: three draws say little of a single one.
const NEIGHBOURS: usize = 2;

/// The median of the magnitude of normal numbers, in standard deviations.
const MEDIAN: f64 = 0.6745;

/// The log with every row weighed by what the uncertain motion does to this model there; none where the motion is
/// taken as exact.
pub fn weighed(log: &TrainTest, model: &Fitted) -> Option<TrainTest> {
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
                track.torque.iter().zip(&torque).map(|(own, torque)| own - torque).collect()
            })
            .collect();
        let scale = *scale.get_or_insert_with(|| typical(tracks, &residuals));
        for track in tracks.iter_mut().filter(|track| !track.motion_error.is_empty()) {
            let error = std::mem::take(&mut track.motion_error);
            track.weigh(|row| 1.0 / (1.0 + (error[row] / scale).powi(2)));
            track.motion_error = error;
        }
    }
    Some(log)
}

/// The model's torque along a track, the motion shifted by one of its draws.
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

/// RMS difference that the draws make in each row.
fn errors(
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
        for ((sum, own), other) in squares.iter_mut().zip(torque).zip(other) {
            *sum += (other - own).powi(2) / track.velocity_draws.len() as f64;
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

/// What the model misses rows by whose motion is sure: by the median, which the others do not move.
fn typical(tracks: &[Track], residuals: &[Vec<f64>]) -> f64 {
    let judged = tracks.iter().zip(residuals).flat_map(|(track, residual)| {
        let rows = residual.iter().enumerate().filter(|(row, _)| track.is_included(*row));
        rows.map(|(_, residual)| residual.abs())
    });
    let mut sizes: Vec<f64> = judged.collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or_default() / MEDIAN;
    median.max(Scales::of(tracks).noise).max(f64::MIN_POSITIVE)
}
