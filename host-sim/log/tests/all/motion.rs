//! Reconstruction of the motion from imperfect sensors. Plain LuGre with its *true* parameters, driven by the
//! reconstructed motion, must leave little more than the torque's own noise.
//!
//! The joint is simulated forty times finer than the log, by its equations and independently of the core.

use joint_log::motion::{DRAWS, reconstruct};
use joint_log::{Dataset, Quantity};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::{PI, TAU};

const NOISE_NM: f64 = 0.02;
const FINE: usize = 40;

/// Plain LuGre: Coulomb 1.5, static 1.9 Nm, Stribeck velocity 0.05 rad/s, viscous 0.3.
struct Lugre {
    stiffness: f64,
    bristle: f64,
}

impl Lugre {
    fn step(&mut self, velocity: f64, step_s: f64) -> f64 {
        let level = 1.5 + 0.4 * (-(velocity / 0.05).powi(2)).exp();
        let before = self.bristle;
        let slipping = 1.0 + self.stiffness * velocity.abs() * step_s / level;
        self.bristle = (before + velocity * step_s) / slipping;
        let rate = (self.bristle - before) / step_s;
        self.stiffness * self.bristle + 0.03 * self.stiffness.sqrt() * rate + 0.3 * velocity
    }

    /// Returns the torque of a velocity that is linear from row to row.
    fn along(stiffness: f64, velocity: &[f64], period_s: f64) -> Vec<f64> {
        let mut joint = Self { stiffness, bristle: 0.0 };
        let mut torque = vec![0.0];
        for pair in velocity.windows(2) {
            let at = |step: usize| pair[0] + (pair[1] - pair[0]) * step as f64 / FINE as f64;
            let steps = (1..=FINE).map(|step| joint.step(at(step), period_s / FINE as f64));
            torque.extend(steps.last());
        }
        torque
    }
}

/// Returns the velocity at a time: fast and slow oscillations, ramps and rests.
fn velocity(time: f64) -> f64 {
    let (second, share) = ((time as usize) % 8, time.fract());
    let ramp = |hardness: f64, top: f64| (hardness * share.min(0.9 - share).max(0.0)).min(top);
    match second {
        1 => 0.8 * (TAU * share).sin(),
        2 => -ramp(20.0, 0.5),
        4 => 0.3 * (2.0 * TAU * share).sin(),
        5 => 6.0 * (PI * share).sin().powi(4) * 0.2,
        6 => ramp(2.0, 0.2),
        7 => -0.6 * (PI * share).sin().powi(2),
        _ => 0.0,
    }
}

struct World {
    stiffness: f64,
    period_s: f64,
    velocity: Vec<f64>,
    position: Vec<f64>,
    torque: Vec<f64>,
}

fn world(stiffness: f64, rate_hz: f64) -> World {
    let period_s = 1.0 / rate_hz;
    let mut world =
        World { stiffness, period_s, velocity: vec![0.0], position: vec![0.1], torque: vec![0.0] };
    let mut joint = Lugre { stiffness, bristle: 0.0 };
    let (mut angle, mut before) = (0.1, 0.0);
    let step_s = period_s / FINE as f64;
    for step in 1..=(24.0 * rate_hz) as usize * FINE {
        let now = velocity(step as f64 * step_s);
        angle += 0.5 * step_s * (now + before);
        before = now;
        let torque = joint.step(now, step_s);
        if step.is_multiple_of(FINE) {
            world.velocity.push(now);
            world.position.push(angle);
            world.torque.push(torque);
        }
    }
    let mut random = Pcg64::seed_from_u64(7);
    for torque in &mut world.torque {
        let noise: f64 = StandardNormal.sample(&mut random);
        *torque += NOISE_NM * noise;
    }
    world
}

impl World {
    fn log(&self, velocity: &[f64], position: Option<&[f64]>) -> Dataset {
        let mut names = vec!["time_s", "velocity_rad_s", "torque_nm"];
        let time = (0..velocity.len()).map(|row| row as f64 * self.period_s).collect();
        let mut columns = vec![time, velocity.to_vec(), self.torque.clone()];
        if let Some(position) = position {
            names.push("position_rad");
            columns.push(position.to_vec());
        }
        let names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        Dataset::from_columns(&names, [("0".into(), columns)]).expect("a log")
    }

    /// Returns the residual of the true law, relative to the torque's noise.
    fn misses(&self, velocity: &[f64]) -> f64 {
        let found = Lugre::along(self.stiffness, velocity, self.period_s);
        let squares = found.iter().zip(&self.torque).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        (squares / found.len() as f64).sqrt() / NOISE_NM
    }

    fn noisy(&self) -> Vec<f64> {
        let mut random = Pcg64::seed_from_u64(8);
        let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
        self.velocity.iter().map(|velocity| velocity + 2e-3 * noise()).collect()
    }

    fn encoder(&self, bits: i32) -> (Vec<f64>, Vec<f64>) {
        let step = TAU / f64::powi(2.0, bits);
        let position: Vec<f64> = self.position.iter().map(|q| (q / step).floor() * step).collect();
        let mut velocity = vec![0.0];
        velocity.extend(position.windows(2).map(|w| (w[1] - w[0]) / self.period_s));
        (velocity, position)
    }
}

/// Returns the residuals with the logged and the reconstructed motion, relative to the torque's noise.
fn before_and_after(world: &World, log: &Dataset) -> (f64, f64) {
    let (found, _) = reconstruct(log);
    (world.misses(&log.runs[0].velocity), world.misses(&found.runs[0].velocity))
}

#[test]
fn lugre_with_true_velocity_leaves_only_noise() {
    for (stiffness, rate) in [(1000.0, 250.0), (10_000.0, 1000.0)] {
        let world = world(stiffness, rate);
        assert!(world.misses(&world.velocity) < 1.05);
    }
}

#[test]
fn reconstruct_with_noisy_velocity_and_position_leaves_only_noise() {
    for (stiffness, rate) in [(1000.0, 250.0), (10_000.0, 500.0)] {
        let world = world(stiffness, rate);
        let (before, after) =
            before_and_after(&world, &world.log(&world.noisy(), Some(&world.position)));
        assert!(before > 3.0 && after < 1.06, "{before} {after}");
    }
}

#[test]
fn reconstruct_with_noisy_velocity_alone_leaves_little_error() {
    for (stiffness, rate) in [(1000.0, 250.0), (4000.0, 500.0)] {
        let world = world(stiffness, rate);
        let (before, after) = before_and_after(&world, &world.log(&world.noisy(), None));
        assert!(before > 3.0 && after < 1.6, "{before} {after}");
    }
}

#[test]
fn reconstruct_with_encoder_differences_leaves_little_error() {
    for (bits, stiffness, most) in [(18, 3000.0, 1.15), (16, 1000.0, 1.3), (14, 500.0, 2.0)] {
        let world = world(stiffness, 250.0);
        let (velocity, position) = world.encoder(bits);
        let (before, after) = before_and_after(&world, &world.log(&velocity, Some(&position)));
        assert!(after < most && after < before, "{bits} bits: {before} {after}");
    }
}

#[test]
fn reconstruct_with_exact_log_returns_it_unchanged() {
    let world = world(1000.0, 250.0);
    for position in [None, Some(world.position.as_slice())] {
        let log = world.log(&world.velocity, position);
        let (found, sensors) = reconstruct(&log);
        assert!(sensors.exact);
        let mut expected = log.runs.clone();
        // All that is added: that its slope may be taken from row to row.
        expected.iter_mut().for_each(|run| run.velocity_is_smooth = true);
        assert_eq!(found.runs, expected);
    }
}

/// A propeller shaft: 65 to 95 rpm in one direction, over 200 rad, logged exactly. An initial variance of the whole
/// travel would lose all digits of the smoothed motion.
#[test]
fn reconstruct_with_long_travel_in_one_direction_keeps_velocity() {
    let names = ["time_s", "velocity_rad_s", "torque_nm", "position_rad"].map(str::to_owned);
    let (rate, swing) = (TAU / 5.0, 1.57);
    let run = |index: usize| {
        let time: Vec<f64> = (0..12_500).map(|row| 0.002 * row as f64).collect();
        let start = |t: f64| (1.0 - (-(8.0 + index as f64) * t).exp()) / (8.0 + index as f64);
        let position = |t: &f64| 8.38 * (t - start(*t)) + swing / rate * (1.0 - (rate * t).cos());
        let speed =
            |t: &f64| 8.38 * (1.0 - (-(8.0 + index as f64) * t).exp()) + swing * (rate * t).sin();
        let columns = vec![
            time.clone(),
            time.iter().map(speed).collect(),
            vec![2.0; time.len()],
            time.iter().map(position).collect(),
        ];
        (index.to_string(), columns)
    };
    let log = Dataset::from_columns(&names, (0..4).map(run)).expect("a log");
    let (found, sensors) = reconstruct(&log);
    let agreement = sensors.agreement.expect("a position");
    assert!((agreement.gain - 1.0).abs() < 1e-3 && !agreement.lags(), "{agreement:?}");
    for (found, logged) in found.runs.iter().zip(&log.runs) {
        let apart = found.velocity.iter().zip(&logged.velocity).map(|(a, b)| (a - b).abs());
        assert!(apart.fold(0.0, f64::max) < 1e-2);
    }
}

#[test]
fn reconstruct_velocity_integrates_to_position_and_is_zero_at_rest() {
    let world = world(1000.0, 250.0);
    let (velocity, position) = world.encoder(16);
    let (found, sensors) = reconstruct(&world.log(&velocity, Some(&position)));
    let run = &found.runs[0];
    let q = run.get(Quantity::Position).expect("a position");
    let mut angle = q[0];
    for (row, q) in q.iter().enumerate().skip(1) {
        angle += 0.5 * world.period_s * (run.velocity[row] + run.velocity[row - 1]);
        assert!((angle - q).abs() < 1e-6, "{angle} {q} at {row}");
    }
    assert!(sensors.rows_at_rest > 1000);
    // In the middle of a second of rest.
    let at = (8.5 / world.period_s) as usize;
    assert_eq!(run.velocity[at], 0.0);
}

#[test]
fn reconstruct_draws_match_the_error() {
    let world = world(1000.0, 250.0);
    for log in [
        world.log(&world.noisy(), None),
        world.log(&world.encoder(16).0, Some(&world.encoder(16).1)),
    ] {
        let (found, _) = reconstruct(&log);
        let run = &found.runs[0];
        assert_eq!(run.velocity_draws.len(), DRAWS);
        let drawn: f64 = run.velocity_draws.iter().flatten().map(|d| d * d).sum();
        let missed = run.velocity.iter().zip(&world.velocity).map(|(a, b)| (a - b).powi(2));
        let ratio = (drawn / DRAWS as f64 / missed.sum::<f64>()).sqrt();
        assert!((0.6..2.0).contains(&ratio), "{ratio}");
        let again = reconstruct(&log).0;
        assert_eq!(again.runs, found.runs, "the same log, the same draws");
    }
}

#[test]
fn reconstruct_with_gap_or_second_run_smooths_each_segment_separately() {
    let world = world(1000.0, 250.0);
    let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
    let noisy = world.noisy();
    let time: Vec<f64> = (0..noisy.len()).map(|row| row as f64 * world.period_s).collect();
    let columns = |from: usize, to: usize, gap: f64| {
        let shifted = time[from..to].iter().map(|t| if *t > 12.0 { t + gap } else { *t });
        vec![shifted.collect(), noisy[from..to].to_vec(), world.torque[from..to].to_vec()]
    };
    let rows = noisy.len();
    let first = time.iter().position(|t| *t > 12.0).expect("a row after");
    let whole = Dataset::from_columns(&names, [("a".into(), columns(0, rows, 5.0))]);
    let runs = [("a".into(), columns(0, first, 0.0)), ("b".into(), columns(first, rows, 0.0))];
    let apart = Dataset::from_columns(&names, runs);
    let whole = reconstruct(&whole.expect("a log")).0;
    let apart = reconstruct(&apart.expect("a log")).0;
    let joined: Vec<f64> = apart.runs.iter().flat_map(|run| run.velocity.clone()).collect();
    for (row, (a, b)) in whole.runs[0].velocity.iter().zip(&joined).enumerate() {
        assert!((a - b).abs() < 1e-9, "row {row}: {a} {b}");
    }
}
