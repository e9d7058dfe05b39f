//! A ripple whose phase differs from run to run, because the position's zero is not the shaft's.
//!
//! A logger that integrates the velocity begins every run at the same angle, wherever the shaft stands. A ripple
//! of the shaft is then a wave of its own phase in each run, and averages out over all of them. Where every run
//! begins at the same position, whole orders are asked run by run:
//!
//! ```text
//! fit {1, sin n q, cos n q} to one half of a run's residual, judge it on the other half, and the other way round
//! ```
//!
//! Noise has phases too, so what counts is the fall of the error on the halves a phase has not seen, over runs as
//! observations ([`super::fall`]). If an order passes, the position of each run is shifted until its wave has the
//! phase 0, and the causes of the angle are weighed on that. The phase is found in each run for itself, as the
//! torque a bristle holds at its start is: no fit of other runs can know it, and no driver without a homed zero.

use super::fall::Fall;
use super::model::Fitted;
use super::sensitivities::sensitivities;
use super::thresholds::{CHANCE, MATERIAL};
use super::train_test::TrainTest;
use crate::data::{Dataset, JointKind, Quantity, Run};
use compensator_core::TermKind;
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;

/// Highest whole order that is asked: a shaft's own turn, a few bearings, a spur gear.
const MOST: u32 = 40;

/// Runs it takes.
const FEWEST_RUNS: usize = 5;

/// Periods of the wave a half of a run has to hold for its phase to mean something.
const LEAST_PERIODS: f64 = 0.25;

/// Rows of a run as angle and residual.
type Rows = Vec<(f64, f64)>;

/// The log with each run's position shifted to a common phase, if a ripple shows whose phase differs between runs.
pub fn aligned(log: &TrainTest, model: &Fitted) -> Option<TrainTest> {
    let runs = &log.train.runs;
    // What is set apart has a zero of its own, and no residual is asked of it: only where every run is left out once are
    // the runs that judge those that were shifted.
    if !log.leaves_each_out {
        return None;
    }
    let gravity = log.rigid_body.contains(&TermKind::GravityImbalance);
    let is_revolute = log.train.joint == JointKind::Revolute;
    if !is_revolute || gravity || runs.len() < FEWEST_RUNS || !begin_alike(runs) {
        return None;
    }
    let by_run = residuals(log, model);
    let best = (1..=MOST)
        .map(|order| (order, fall(&by_run, f64::from(order))))
        .max_by(|a, b| a.1.at_least().total_cmp(&b.1.at_least()))?;
    let (order, fall) = best;
    let squares: f64 = by_run.iter().flatten().map(|(_, e)| e * e).sum();
    let passes = fall.probability(2, f64::from(MOST)) < CHANCE
        && fall.value > MATERIAL * log.beyond_floor(squares);
    if !passes {
        return None;
    }
    let n = f64::from(order);
    let shifts: Vec<f64> = by_run
        .iter()
        .map(|rows| wave(rows, n).map_or(0.0, |[_, sine, cosine]| cosine.atan2(sine) / n))
        .collect();
    let mut shifted = log.clone();
    shifted.train = Arc::new(moved(&log.train, &shifts));
    for track in &mut shifted.train_tracks {
        let shift = shifts[track.run];
        track.samples.iter_mut().for_each(|sample| sample.position_rad += shift);
    }
    shifted.test = Arc::clone(&shifted.train);
    shifted.test_tracks = shifted.train_tracks.clone();
    shifted.aligned_order = Some(order);
    shifted.notes.push(format!(
        "every run begins at the same position, so its zero is not the shaft's: a ripple of {order} a turn was sought with a \
         phase of its own in each run, and takes {:.0} % of the squared error on halves of runs it has not seen; positions are \
         shifted to a common phase. A driver needs a homed zero, and a log with it, before it can run such a term",
        100.0 * fall.value / squares.max(f64::MIN_POSITIVE)
    ));
    Some(shifted)
}

/// Whether every run begins at one position, and some end elsewhere.
fn begin_alike(runs: &[Run]) -> bool {
    let ends: Option<Vec<(f64, f64)>> = runs
        .iter()
        .map(|run| run.get(Quantity::Position).and_then(|q| Some((*q.first()?, *q.last()?))))
        .collect();
    let Some(ends) = ends else { return false };
    ends.iter().all(|(start, _)| *start == ends[0].0)
        && ends.iter().any(|(start, end)| start != end)
}

/// Angle and residual of the rows that count, by runs.
fn residuals(log: &TrainTest, model: &Fitted) -> Vec<Rows> {
    let at = sensitivities(&model.parameters, &[], &log.train_tracks, model.resolution);
    let mut by_run = vec![Rows::new(); log.train.runs.len()];
    for (track, at) in log.train_tracks.iter().zip(&at.tracks) {
        let rows = (0..track.len()).filter(|row| track.is_included(*row));
        by_run[track.run]
            .extend(rows.map(|row| (track.samples[row].position_rad, at.residual[row])));
    }
    by_run
}

/// Least squares of `{1, sin n q, cos n q}`; none where the rows do not tell the three apart.
fn wave(rows: &[(f64, f64)], order: f64) -> Option<[f64; 3]> {
    let (mut products, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for (q, e) in rows {
        let (sine, cosine) = (order * q).sin_cos();
        let columns = Vector3::new(1.0, sine, cosine);
        products += columns * columns.transpose();
        right += columns * *e;
    }
    let solved = products.cholesky()?.solve(&right);
    Some([solved[0], solved[1], solved[2]])
}

/// Fall of the squared error on the half of each run that a phase has not seen, over runs.
fn fall(by_run: &[Rows], order: f64) -> Fall {
    let of_run = |rows: &Rows| -> f64 {
        let (first, second) = rows.split_at(rows.len() / 2);
        unseen(first, second, order) + unseen(second, first, order)
    };
    let falls: Vec<f64> = by_run.iter().map(of_run).collect();
    Fall::of(falls.iter().copied())
}

/// By how much a wave fitted to some rows is better on others than their mean is.
fn unseen(seen: &[(f64, f64)], other: &[(f64, f64)], order: f64) -> f64 {
    let ends = seen.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (q, _)| {
        (f64::min(low, *q), f64::max(high, *q))
    });
    let periods = order * (ends.1 - ends.0) / std::f64::consts::TAU;
    let Some([constant, sine, cosine]) = wave(seen, order).filter(|_| periods >= LEAST_PERIODS)
    else {
        return 0.0;
    };
    let mean = seen.iter().map(|(_, e)| e).sum::<f64>() / seen.len().max(1) as f64;
    other
        .iter()
        .map(|(q, e)| {
            let (s, c) = (order * q).sin_cos();
            (e - mean).powi(2) - (e - constant - sine * s - cosine * c).powi(2)
        })
        .sum()
}

/// The data set with each run's position shifted.
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

    /// Runs of two turns each, a wave of this size and order with a phase of its own in each, noise of 1.
    fn runs(size: f64, order: f64, seed: u64) -> Vec<Rows> {
        let mut random = Pcg64::seed_from_u64(seed);
        (0..12)
            .map(|run| {
                let phase = 1.7 * f64::from(run);
                (0..400)
                    .map(|row| {
                        let q = f64::from(row) * 0.0315;
                        let noise: f64 = random.random_range(-1.7..1.7);
                        (q, size * (order * q + phase).sin() + noise)
                    })
                    .collect()
            })
            .collect()
    }

    #[test]
    fn a_wave_with_a_phase_in_each_run_falls_on_halves_it_has_not_seen_and_noise_does_not() {
        let hidden = runs(0.8, 3.0, 1);
        let best = (1..=MOST).max_by(|a, b| {
            let at_least = |n: &u32| fall(&hidden, f64::from(*n)).at_least();
            at_least(a).total_cmp(&at_least(b))
        });
        assert_eq!(best, Some(3));
        assert!(fall(&hidden, 3.0).probability(2, f64::from(MOST)) < CHANCE);
        let alarms = (0..20).filter(|seed| {
            let clean = runs(0.0, 3.0, 100 + seed);
            (1..=MOST).any(|n| fall(&clean, f64::from(n)).probability(2, f64::from(MOST)) < CHANCE)
        });
        assert!(alarms.count() <= 1);
    }
}
