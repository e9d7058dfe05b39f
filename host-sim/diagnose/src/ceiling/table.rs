//! The columns that the ceiling's trees see: the motion with its memory, the covariates, and the torque of the named model.
//!
//! Friction changes its sign with the direction of motion. All torques, the target too, are therefore taken along the last
//! motion, which leaves the error as it is and spares the trees a split.

use super::TRAINING;
use crate::train_test::TrainTest;
use compensator_core::Quantity;
use friction_fit::{Predicted, Track};
use joint_log::contract;
use std::f64::consts::TAU;

/// Rows back to which the velocity is compared.
const LAGS: [usize; 3] = [1, 4, 16];

/// Speed below which a joint is at rest, as a share of the largest speed.
const AT_REST: f64 = 1e-3;

/// Number of columns of the motion.
const MOTION_COLUMNS: usize = 11 + LAGS.len();

/// Rows with their columns.
#[derive(Default)]
pub(super) struct Table {
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) target: Vec<f64>,
    pub(super) weights: Vec<f64>,
    pub(super) fold: Vec<usize>,
}

impl Table {
    /// Adds the rows of tracks with the residuals of a model. `fold` returns the part in which a row of a track is held out.
    pub(super) fn add(
        &mut self,
        log: &TrainTest,
        tracks: &[Track],
        model: &Predicted,
        fold: impl Fn(&Track, usize) -> usize,
    ) {
        let speeds = tracks.iter().flat_map(|track| &track.samples);
        let fastest = speeds.map(|sample| sample.velocity_rad_s.abs()).fold(0.0, f64::max);
        let covariates: Vec<Quantity> = contract::covariates()
            .filter(|quantity| log.varies(quantity.name(log.train.joint)))
            .collect();
        self.columns.resize(MOTION_COLUMNS + covariates.len() + log.extras.len(), Vec::new());
        for ((track, torque), residuals) in tracks.iter().zip(&model.torque).zip(&model.residuals) {
            let mut memory = Memory::default();
            let mut kept = 0;
            for (row, torque) in torque.iter().enumerate() {
                memory.advance(track, row, AT_REST * fastest);
                let weight = track.weight(row);
                if row % log.decimate != 0 || kept == residuals.len() {
                    continue;
                }
                let along = memory.direction;
                let motion = motion(track, row, &memory, *torque);
                let sample = &track.samples[row];
                let known = covariates.iter().map(|of| of.value_in(sample).unwrap_or_default());
                let extra = log.extras.iter().map(|index| track.covariates[*index][row]);
                let values = motion.into_iter().chain(known).chain(extra);
                self.columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
                let unweighted = residuals[kept] / weight.sqrt().max(f64::MIN_POSITIVE);
                self.target.push(if weight > 0.0 { along * unweighted } else { 0.0 });
                self.weights.push(weight);
                self.fold.push(fold(track, row));
                kept += 1;
            }
        }
    }

    /// Adds rows that only train.
    pub(super) fn add_training(&mut self, log: &TrainTest, model: &Predicted) {
        self.add(log, &log.train_tracks, model, |_, _| TRAINING);
    }
}

fn motion(track: &Track, row: usize, memory: &Memory, torque: f64) -> [f64; MOTION_COLUMNS] {
    let sample = &track.samples[row];
    let along = memory.direction;
    let slower = |lag: usize| {
        let before = &track.samples[row.saturating_sub(lag)];
        along * (sample.velocity_rad_s - before.velocity_rad_s)
    };
    let mut values = [0.0; MOTION_COLUMNS];
    let now = [
        along,
        along * sample.velocity_rad_s,
        along * sample.acceleration_rad_s2,
        along * torque,
        sample.position_rad,
        sample.position_rad.rem_euclid(TAU),
        sample.campaign_time_h,
        memory.since_start_s,
        memory.since_reversal_rad,
        memory.since_reversal_s,
        memory.rest_s,
    ];
    values[..now.len()].copy_from_slice(&now);
    values[now.len()..].iter_mut().zip(LAGS).for_each(|(value, lag)| *value = slower(lag));
    values
}

/// What a row remembers of the motion before it.
struct Memory {
    /// Direction of the last motion, -1 or 1.
    direction: f64,
    since_start_s: f64,
    /// Displacement since the last reversal.
    since_reversal_rad: f64,
    /// Time since the last reversal.
    since_reversal_s: f64,
    /// Time of the last rest.
    rest_s: f64,
    is_resting: bool,
}

impl Default for Memory {
    fn default() -> Self {
        Self {
            direction: 1.0,
            since_start_s: 0.0,
            since_reversal_rad: 0.0,
            since_reversal_s: 0.0,
            rest_s: 0.0,
            is_resting: false,
        }
    }
}

impl Memory {
    fn advance(&mut self, track: &Track, row: usize, slowest: f64) {
        let velocity = track.samples[row].velocity_rad_s;
        let step_s = track.period_s * track.period_ratio_of(row);
        self.since_start_s += step_s;
        self.since_reversal_s += step_s;
        if velocity.abs() <= slowest {
            self.rest_s = if self.is_resting { self.rest_s + step_s } else { step_s };
            self.is_resting = true;
            return;
        }
        self.is_resting = false;
        if self.direction * velocity < 0.0 {
            (self.since_reversal_rad, self.since_reversal_s) = (0.0, 0.0);
        }
        self.direction = velocity.signum();
        self.since_reversal_rad += velocity.abs() * step_s;
    }
}
