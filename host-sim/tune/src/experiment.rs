//! Motions from which a model is learnt, and the choice of the next one.
//!
//! A session begins with [`survey`]: what every friction model needs. Afterwards [`most_informative`] chooses among
//! [`library`] the motion for which the two hypotheses that are still open predict the most different torques, per second of
//! motion, relative to the noise and to the spread of each prediction over draws of its parameters. A motion whose
//! difference is smaller than this spread would be explained by either hypothesis with other values.

use crate::motion::{Motion, MotionBuilder, MotionLimits, TARGET_PERIOD_S};
use compensator_core::{Parameters, Sample};
use friction_fit::{Outcome, Resolution, Rows, Track, predict};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// A motion with the reason for it.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The motion.
    pub motion: Motion,
    /// Why it is performed, as a sentence.
    pub why: &'static str,
}

/// Longest stroke at a slow speed, s.
const STROKE_S: f64 = 1.6;

/// Returns strokes both ways at these shares of the largest speed.
fn strokes(limits: &MotionLimits, name: &str, shares: &[f64]) -> Motion {
    let mut builder = MotionBuilder::new(*limits).rest(0.1);
    for share in shares {
        let speed = share * limits.speed_rad_s;
        let half = (0.5 * STROKE_S * speed).min(0.95 * limits.range_rad);
        builder = builder.triangle(half, speed, 1);
    }
    builder.finish(name)
}

/// Returns small sines around three positions.
fn small_reversals(limits: &MotionLimits, name: &str, hz: f64) -> Motion {
    let mut builder = MotionBuilder::new(*limits).rest(0.1);
    for centre in [-0.6, 0.0, 0.6] {
        builder = builder.stroke(centre * limits.range_rad, 0.5 * limits.speed_rad_s).rest(0.1);
        for share in [0.002, 0.008, 0.03] {
            let amplitude = share * limits.range_rad;
            builder = builder.sine(amplitude, amplitude * TAU * hz, 2);
        }
    }
    builder.finish(name)
}

/// Returns slow passes over the whole range, both ways.
fn passes(limits: &MotionLimits, name: &str, share: f64) -> Motion {
    let (range, speed) = (0.95 * limits.range_rad, share * limits.speed_rad_s);
    MotionBuilder::new(*limits)
        .stroke(-range, 0.6 * limits.speed_rad_s)
        .rest(0.1)
        .stroke(range, speed)
        .stroke(-range, speed)
        .finish(name)
}

/// Returns rests of several lengths, each before a slow stroke.
fn dwells(limits: &MotionLimits) -> Motion {
    let mut builder = MotionBuilder::new(*limits);
    let mut direction = 1.0;
    for rest_s in [0.1, 1.0, 0.3, 3.0, 0.1] {
        let speed = 0.05 * limits.speed_rad_s;
        let to = direction * 0.06 * limits.range_rad;
        builder = builder.rest(rest_s).stroke(to, speed);
        direction = -direction;
    }
    builder.finish("rests before slow strokes")
}

/// Returns sines of the same speed and different accelerations.
fn accelerations(limits: &MotionLimits) -> Motion {
    let mut builder = MotionBuilder::new(*limits);
    for share in [0.9, 0.45, 0.22] {
        let amplitude = share * limits.range_rad;
        builder = builder.stroke(-amplitude, 0.5 * limits.speed_rad_s).sine(
            amplitude,
            0.6 * limits.speed_rad_s,
            1,
        );
    }
    builder.finish("sines of three accelerations")
}

/// Returns fast sines without a rest.
fn fast(limits: &MotionLimits) -> Motion {
    let amplitude = 0.95 * limits.range_rad;
    MotionBuilder::new(*limits)
        .stroke(-amplitude, 0.5 * limits.speed_rad_s)
        .sine(amplitude, 0.95 * limits.speed_rad_s, 4)
        .finish("fast sines")
}

/// Returns the motions of the start, in order.
pub fn survey(limits: &MotionLimits) -> Vec<Experiment> {
    let experiment = |motion, why| Experiment { motion, why };
    vec![
        experiment(
            strokes(limits, "strokes at six speeds", &[0.9, 0.45, 0.22, 0.1, 0.05, 0.02]),
            "friction over speed, in both directions",
        ),
        experiment(
            small_reversals(limits, "small reversals", 1.0),
            "the stiffness before the joint slides, at three positions",
        ),
        experiment(
            passes(limits, "slow passes", 0.2),
            "friction over position, in both directions",
        ),
    ]
}

/// Returns the motions that may follow.
pub fn library(limits: &MotionLimits) -> Vec<Experiment> {
    let experiment = |motion, why| Experiment { motion, why };
    vec![
        experiment(
            passes(limits, "very slow passes", 0.08),
            "friction over position at another speed",
        ),
        experiment(passes(limits, "fast passes", 0.5), "friction over position at another speed"),
        experiment(dwells(limits), "break-away after rests of different length"),
        experiment(accelerations(limits), "inertia, at equal speeds and different accelerations"),
        experiment(fast(limits), "friction at the highest speeds, and heat"),
        experiment(
            small_reversals(limits, "slow small reversals", 0.6),
            "the travel with little stiffness after a reversal",
        ),
        experiment(
            strokes(limits, "strokes at other speeds", &[0.7, 0.3, 0.15, 0.07, 0.035]),
            "the shape of friction over speed",
        ),
    ]
}

/// Draws of each hypothesis.
const DRAWS: usize = 6;
/// Rows that count as one observation, because the residual is correlated: 50 ms at 200 Hz.
const CORRELATED_ROWS: f64 = 10.0;

/// Returns the place of the motion that separates two fitted hypotheses best; `None` if none is expected to reach the log
/// likelihood ratio `least`.
pub fn most_informative(
    experiments: &[Experiment],
    hypotheses: [&Outcome; 2],
    at: &Sample<f64>,
    noise_nm: f64,
    least: f64,
    seed: u64,
) -> Option<usize> {
    let mut random = Pcg64::seed_from_u64(seed);
    let drawn = hypotheses
        .map(|outcome| (0..DRAWS).map(|_| draw(outcome, &mut random)).collect::<Vec<_>>());
    let expected = experiments.iter().map(|experiment| {
        let track = track(&experiment.motion, at);
        let torques = [0, 1].map(|which| {
            let resolution = hypotheses[which].resolution;
            drawn[which].iter().map(|p| torque(p, &track, resolution)).collect::<Vec<_>>()
        });
        information(&torques, noise_nm) / CORRELATED_ROWS
    });
    let rated = expected.enumerate().map(|(place, nats)| {
        let seconds = experiments[place].motion.seconds();
        (place, nats, nats / seconds)
    });
    let (place, nats, _) = rated.max_by(|a, b| a.2.total_cmp(&b.2))?;
    (nats >= least).then_some(place)
}

/// Draws the parameters of a fit from their standard errors; a draw that is not valid is replaced by the estimate.
fn draw(outcome: &Outcome, random: &mut Pcg64) -> Parameters<f64> {
    let mut drawn = outcome.parameters.clone();
    for estimate in &outcome.estimates {
        let normal: f64 = StandardNormal.sample(random);
        if let Some(error) = estimate.std_error.filter(|error| error.is_finite()) {
            // An undetermined parameter has no useful spread beyond its own size.
            let error = error.min(0.5 * estimate.value.abs());
            drawn.set(estimate.id, estimate.value + normal * error);
        }
    }
    if drawn.validate().is_ok() { drawn } else { outcome.parameters.clone() }
}

/// Returns the motion as samples at 200 Hz, with the covariates of `at`.
fn track(motion: &Motion, at: &Sample<f64>) -> Track {
    let origin = at.position_rad;
    let positions = &motion.positions_rad;
    let velocity = |row: usize| {
        let (from, to) = (row.saturating_sub(1), (row + 1).min(positions.len() - 1));
        (positions[to] - positions[from]) / ((to - from).max(1) as f64 * TARGET_PERIOD_S)
    };
    let velocities: Vec<f64> = (0..positions.len()).map(velocity).collect();
    let acceleration = |row: usize| {
        let (from, to) = (row.saturating_sub(1), (row + 1).min(positions.len() - 1));
        (velocities[to] - velocities[from]) / ((to - from).max(1) as f64 * TARGET_PERIOD_S)
    };
    let samples = (0..positions.len()).map(|row| Sample {
        velocity_rad_s: velocities[row],
        position_rad: origin + positions[row],
        acceleration_rad_s2: acceleration(row),
        ..*at
    });
    let samples: Vec<Sample<f64>> = samples.collect();
    let torque = vec![0.0; samples.len()];
    Track::even(samples, torque, TARGET_PERIOD_S)
}

fn torque(parameters: &Parameters<f64>, track: &Track, resolution: Resolution) -> Vec<f64> {
    let rows = Rows { tracks: std::slice::from_ref(track), decimate: 1 };
    let predicted = predict(parameters, rows, resolution);
    predicted.torque.into_iter().next().unwrap_or_default()
}

/// Returns the expected log likelihood ratio of rows: half the squared difference of the mean predictions over the variance of
/// noise and draws.
fn information(torques: &[Vec<Vec<f64>>; 2], noise_nm: f64) -> f64 {
    let rows = torques.iter().flatten().map(Vec::len).min().unwrap_or_default();
    let moments = |draws: &[Vec<f64>], row: usize| {
        let count = draws.len() as f64;
        let mean = draws.iter().map(|torque| torque[row]).sum::<f64>() / count;
        let variance = draws.iter().map(|torque| (torque[row] - mean).powi(2)).sum::<f64>() / count;
        [mean, variance]
    };
    let nats = (0..rows).map(|row| {
        let [[a, va], [b, vb]] = [0, 1].map(|which| moments(&torques[which], row));
        0.5 * (a - b).powi(2) / (noise_nm * noise_nm + va + vb)
    });
    nats.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_motion_keeps_the_limits() {
        for (range_rad, speed_rad_s) in [(0.4, 1.5), (0.05, 0.3), (1.5, 3.0)] {
            let limits = MotionLimits { range_rad, speed_rad_s, acceleration_rad_s2: 15.0 };
            for experiment in survey(&limits).iter().chain(&library(&limits)) {
                experiment.motion.validate(&limits).unwrap();
                let seconds = experiment.motion.seconds();
                assert!((1.0..45.0).contains(&seconds), "{}: {seconds} s", experiment.motion.name);
            }
        }
    }

    #[test]
    fn information_is_the_difference_over_noise_and_spread() {
        let same = |torque: f64| vec![vec![torque; 10]; 4];
        let certain = information(&[same(1.0), same(1.2)], 0.1);
        assert!((certain - 10.0 * 0.5 * 4.0).abs() < 1e-9, "{certain}");
        let spread = vec![vec![0.8; 10], vec![1.6; 10]];
        assert!(information(&[same(1.0), spread], 0.1) < 0.1 * certain);
    }
}
