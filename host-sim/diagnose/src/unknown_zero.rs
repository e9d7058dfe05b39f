//! A ripple whose phase differs between runs, because the position's zero is not fixed to the
//! shaft.
//!
//! A logger that integrates the velocity starts every run at the same angle, independent of the
//! shaft. A ripple of the shaft then has another phase in each run and averages out over all runs.
//! The contest finds its order ([`super::contest::FreePhaseWave`]), which is tested run by run:
//!
//! ```text
//! fit {1, sin n q, cos n q} to one half of a run's residual, evaluate it on the other half, and vice versa
//! ```
//!
//! Noise also has a phase. The test therefore uses the error reduction on the held-out halves, with
//! runs as observations ([`super::error_reduction`]). If the order passes, the position of each run
//! is shifted until its wave has the phase 0. The causes that depend on the angle are evaluated
//! with this position.
//!
//! The phase is fitted in each run separately, as is the bristle torque at its start. Fits to other
//! runs do not determine it, and a driver needs a homed zero to use it.

use super::contest::MOST_FREE_ORDERS;
use super::error_reduction::ErrorReduction;
use super::model::FittedModel;
use super::sensitivities::sensitivities;
use super::train_test::TrainTest;
use compensator_core::TermKind;
use joint_log::statistics::extent;
use joint_log::{Dataset, Quantity};
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Fewest periods of the wave in one half of a run that determine its phase.
const LEAST_PERIODS: f64 = 0.25;

/// Highest probability of the reduction in a log without a wave, corrected for all orders.
const MAX_PROBABILITY: f64 = 0.05;

/// Least share of the squared error above the noise floor that a wave must remove: in a long log any wave is significant.
const MIN_SHARE: f64 = 0.03;

/// A row of a run.
#[derive(Clone, Copy)]
struct Row {
    angle_rad: f64,
    residual_nm: f64,
}

/// Returns the log with each run's position shifted to a common phase of a ripple of a whole order,
/// if a phase of its own in each run reduces the error.
pub fn aligned(log: &TrainTest, model: &FittedModel, order: f64) -> Option<TrainTest> {
    // A run that is set apart has its own zero, and its residual is not evaluated. The shift
    // therefore requires that each run is held out once.
    if !log.leaves_each_out || log.rigid_body.contains(&TermKind::GravityImbalance) {
        return None;
    }
    let by_run = residuals(log, model);
    let fall = fall(&by_run, order);
    let squares: f64 = by_run.iter().flatten().map(|row| row.residual_nm.powi(2)).sum();
    let passes = fall.probability(2, MOST_FREE_ORDERS as f64) < MAX_PROBABILITY
        && fall.value > MIN_SHARE * log.beyond_floor(squares);
    if !passes {
        return None;
    }
    let shift = |[_, sine, cosine]: [f64; 3]| cosine.atan2(sine) / order;
    let shifts: Vec<f64> = by_run.iter().map(|rows| wave(rows, order).map_or(0.0, shift)).collect();
    let mut shifted = log.clone();
    shifted.train = Arc::new(moved(&log.train, &shifts));
    for track in &mut shifted.train_tracks {
        let shift = shifts[track.run];
        track.samples.iter_mut().for_each(|sample| sample.position_rad += shift);
    }
    shifted.test = Arc::clone(&shifted.train);
    shifted.test_tracks = shifted.train_tracks.clone();
    shifted.aligned_order = Some(order as u32);
    shifted.notes.push(format!(
        "every run starts at the same position, so the position's zero is not fixed to the shaft: a ripple of {order} periods per \
         turn, fitted with its own phase in each run, removes {:.0} % of the squared error on held-out halves of the runs; the \
         positions are shifted to a common phase. A driver needs a homed zero, and a log recorded with it, to use such a term",
        100.0 * fall.value / squares.max(f64::MIN_POSITIVE)
    ));
    Some(shifted)
}

/// Returns angle and residual of the included rows, by run.
fn residuals(log: &TrainTest, model: &FittedModel) -> Vec<Vec<Row>> {
    let at = sensitivities(&model.parameters, &[], &log.train_tracks, model.resolution);
    let mut by_run = vec![Vec::new(); log.train.runs.len()];
    for (track, at) in log.train_tracks.iter().zip(&at.tracks) {
        let rows = (0..track.len()).filter(|row| track.is_included(*row));
        by_run[track.run].extend(rows.map(|row| Row {
            angle_rad: track.samples[row].position_rad,
            residual_nm: at.residual[row],
        }));
    }
    by_run
}

/// Returns the least-squares coefficients of `{1, sin n q, cos n q}`; `None` if the rows do not
/// determine them.
fn wave(rows: &[Row], order: f64) -> Option<[f64; 3]> {
    let (mut products, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for row in rows {
        let (sine, cosine) = (order * row.angle_rad).sin_cos();
        let columns = Vector3::new(1.0, sine, cosine);
        products += columns * columns.transpose();
        right += columns * row.residual_nm;
    }
    let solved = products.cholesky()?.solve(&right);
    Some([solved[0], solved[1], solved[2]])
}

/// Returns the reduction of the squared error on the held-out half of each run, over runs.
fn fall(by_run: &[Vec<Row>], order: f64) -> ErrorReduction {
    let of_run = |rows: &Vec<Row>| -> f64 {
        let (first, second) = rows.split_at(rows.len() / 2);
        unseen(first, second, order) + unseen(second, first, order)
    };
    let falls: Vec<f64> = by_run.iter().map(of_run).collect();
    ErrorReduction::of(falls.iter().copied())
}

/// Returns the error reduction of a wave on other rows, compared with the mean. Both are fitted to
/// `seen`. Returns 0 if `seen` contains too few periods.
fn unseen(seen: &[Row], other: &[Row], order: f64) -> f64 {
    let [low, high] = extent(seen.iter().map(|row| row.angle_rad));
    let periods = order * (high - low) / std::f64::consts::TAU;
    let Some([constant, sine, cosine]) = wave(seen, order).filter(|_| periods >= LEAST_PERIODS)
    else {
        return 0.0;
    };
    let mean = seen.iter().map(|row| row.residual_nm).sum::<f64>() / seen.len().max(1) as f64;
    let fall = |row: &Row| {
        let (s, c) = (order * row.angle_rad).sin_cos();
        let residual = row.residual_nm;
        (residual - mean).powi(2) - (residual - constant - sine * s - cosine * c).powi(2)
    };
    other.iter().map(fall).sum()
}

/// Returns the data set with each run's position shifted.
fn moved(data: &Dataset, shifts: &[f64]) -> Dataset {
    let mut moved = data.clone();
    for (run, shift) in moved.runs.iter_mut().zip(shifts) {
        let position = run.get(Quantity::Position).map(|q| q.iter().map(|q| q + shift).collect());
        if let Some(position) = position {
            run.set(Quantity::Position, position);
        }
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    /// Returns runs of two turns with unit noise and a wave of this size and order, whose phase
    /// differs between runs.
    fn runs(size: f64, order: f64, seed: u64) -> Vec<Vec<Row>> {
        let mut random = Pcg64::seed_from_u64(seed);
        (0..12)
            .map(|run| {
                let phase = 1.7 * f64::from(run);
                (0..400)
                    .map(|row| {
                        let q = f64::from(row) * 0.0315;
                        let noise: f64 = random.random_range(-1.7..1.7);
                        let residual_nm = size * (order * q + phase).sin() + noise;
                        Row { angle_rad: q, residual_nm }
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn fall_with_phase_per_run_is_significant_and_with_noise_is_not() {
        let hidden = runs(0.8, 3.0, 1);
        let orders = 1..=MOST_FREE_ORDERS as u32;
        let probability = |by_run: &[Vec<Row>], order: u32| {
            fall(by_run, f64::from(order)).probability(2, MOST_FREE_ORDERS as f64)
        };
        let best = orders
            .clone()
            .min_by(|a, b| probability(&hidden, *a).total_cmp(&probability(&hidden, *b)));
        assert_eq!(best, Some(3));
        assert!(probability(&hidden, 3) < MAX_PROBABILITY);
        let alarms = (0..20).filter(|seed| {
            let clean = runs(0.0, 3.0, 100 + seed);
            orders.clone().any(|order| probability(&clean, order) < MAX_PROBABILITY)
        });
        assert!(alarms.count() <= 1);
    }
}
