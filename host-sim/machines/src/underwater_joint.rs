//! Simulation of the underwater joint of Ding et al. on its test stand.
//!
//! The ranges are those of the paper: 35, 70 and 100 rpm, side load 25-35 or 45-55 N, pressure difference 0-0.05 or
//! 0.25-0.30 MPa, and friction 2 to 3.5 Nm. The seal is drawn from a seed. Each run has its own speed, load and
//! pressure. The motions make every parameter identifiable.
//!
//! The torque sensor adds white noise. Velocity, load and pressure are exact. `truth.json` marks the data as simulated.

use super::friction::{Seal, Surroundings};
use super::motion::Motion;
use crate::log::{Log, LoggedRun};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde_json::json;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Recording parameters of a campaign.
#[derive(Clone, Copy, Debug)]
pub struct Recording {
    /// Number of runs.
    pub runs: usize,
    /// Length of each run, s.
    pub seconds: f64,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Standard deviation of the torque noise, Nm.
    pub noise_nm: f64,
    /// True if side load and pressure vary, false if both are zero.
    pub loaded: bool,
    /// True for steady sliding only. Such a log does not determine the bristle parameters.
    pub steady: bool,
}

impl Default for Recording {
    fn default() -> Self {
        Self {
            runs: 8,
            seconds: 10.0,
            rate_hz: 1000.0,
            noise_nm: 0.05,
            loaded: true,
            steady: false,
        }
    }
}

/// One row of a run.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Time since the start of the campaign, s.
    pub time_s: f64,
    /// Position relative to the start of the run, rad.
    pub position_rad: f64,
    /// Velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Friction torque with sensor noise, Nm.
    pub torque_nm: f64,
    /// Side load, N.
    pub radial_force_n: f64,
    /// Pressure difference, Pa.
    pub pressure_diff_pa: f64,
}

/// Recorded data and their ground truth.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The drawn seal.
    pub seal: Seal,
    /// Seed of the seal.
    pub seed: u64,
    /// Recording parameters.
    pub recording: Recording,
    /// Rows of each run.
    pub runs: Vec<Vec<Row>>,
}

/// Pause between two runs in campaign time, s.
const PAUSE_S: f64 = 60.0;

/// Maximum integration step, s.
const MAX_STEP_S: f64 = 1e-5;

/// Draws a seal. Without loads, its load coefficients are 0.
fn draw_seal(random: &mut Pcg64, loaded: bool) -> Seal {
    let mut between = |least: f64, most: f64| random.random_range(least..most);
    let coulomb_nm = between(1.2, 1.8);
    let mut seal = Seal {
        k0: between(2e3f64.ln(), 2e4f64.ln()).exp(),
        k1: between(5.0, 40.0),
        k2: between(0.02, 0.1),
        coulomb_nm,
        static_nm: coulomb_nm * between(1.2, 1.6),
        stribeck_rad_s: between(0.05, 0.25),
        per_pressure: between(1e-6, 3e-6),
        per_force: between(0.005, 0.015),
        eta3: between(0.5e-6, 3e-6),
    };
    if !loaded {
        (seal.per_pressure, seal.per_force, seal.eta3) = (0.0, 0.0, 0.0);
    }
    seal
}

/// Motion, side load and pressure of a run. The side load has a level and a slow oscillation.
#[derive(Clone, Copy, Debug)]
struct Condition {
    motion: Motion,
    force: f64,
    swing: f64,
    swing_hz: f64,
    pressure: f64,
}

impl Condition {
    /// Evaluates the conditions at a time of the run, s.
    fn at(&self, t: f64) -> Surroundings {
        let w = TAU * self.swing_hz;
        Surroundings {
            velocity: self.motion.velocity(t),
            force: self.force + self.swing * (w * t).sin(),
            force_rate: self.swing * w * (w * t).cos(),
            pressure: self.pressure,
        }
    }
}

/// Draws the conditions of a run.
fn draw_condition(random: &mut Pcg64, index: usize, seal: &Seal, how: &Recording) -> Condition {
    let rpm = [35.0, 70.0, 100.0][index % 3];
    let peak = rpm * TAU / 60.0;
    let motion = if how.steady {
        Motion::Steady { velocity: if index.is_multiple_of(2) { peak } else { -peak } }
    } else {
        match index % 4 {
            0 => Motion::Sine { peak, period: 5.0 },
            1 => Motion::Presliding {
                travel: 6.0 * seal.static_nm / seal.k0,
                frequency: 4.0,
                growth: how.seconds,
            },
            2 => Motion::Sine { peak: 4.0 * seal.stribeck_rad_s, period: 4.0 },
            _ => Motion::Sine { peak: 1.5 * seal.stribeck_rad_s, period: 2.0 },
        }
    };
    if !how.loaded {
        return Condition { motion, force: 0.0, swing: 0.0, swing_hz: 0.0, pressure: 0.0 };
    }
    // Four consecutive runs contain all combinations of high and low. The next four combine them with other motions.
    let turn = index + index / 4;
    let (high_force, high_pressure) = (turn % 2 == 1, turn / 2 % 2 == 1);
    Condition {
        motion,
        force: if high_force { 50.0 } else { 30.0 },
        swing: random.random_range(3.0..5.0),
        swing_hz: random.random_range(0.5..3.0),
        pressure: if high_pressure {
            random.random_range(0.25e6..0.30e6)
        } else {
            random.random_range(0.0..0.05e6)
        },
    }
}

/// Simulates a run.
fn simulate_run(
    seal: &Seal,
    how: &Recording,
    condition: &Condition,
    start_s: f64,
    seed: u64,
) -> Vec<Row> {
    let mut random = Pcg64::seed_from_u64(seed);
    let noise = Normal::new(0.0, how.noise_nm).unwrap_or_else(|_| unreachable!("a size"));
    let period = 1.0 / how.rate_hz;
    let steps = (period / MAX_STEP_S).ceil().max(1.0);
    let dt = period / steps;
    let (mut z, mut position) = (0.0, 0.0);
    let rows = (how.seconds * how.rate_hz).round() as usize;
    (0..rows)
        .map(|row| {
            let t = row as f64 * period;
            if row > 0 {
                for step in 0..steps as usize {
                    let now = t - period + step as f64 * dt;
                    z = seal.advance(z, now, dt, |t| condition.at(t));
                    position += dt * condition.at(now + 0.5 * dt).velocity;
                }
            }
            let now = condition.at(t);
            Row {
                time_s: start_s + t,
                position_rad: position,
                velocity_rad_s: now.velocity,
                torque_nm: seal.torque(z, &now) + noise.sample(&mut random),
                radial_force_n: now.force,
                pressure_diff_pa: now.pressure,
            }
        })
        .collect()
}

/// Draws a seal and records its runs. The same seed and recording give the same rows.
pub fn record(seed: u64, how: Recording) -> Truth {
    let mut random = Pcg64::seed_from_u64(seed);
    let seal = draw_seal(&mut random, how.loaded);
    let conditions: Vec<(u64, Condition)> = (0..how.runs)
        .map(|index| (random.random(), draw_condition(&mut random, index, &seal, &how)))
        .collect();
    let runs = conditions
        .par_iter()
        .enumerate()
        .map(|(index, (noise_seed, condition))| {
            let start = index as f64 * (how.seconds + PAUSE_S);
            simulate_run(&seal, &how, condition, start, *noise_seed)
        })
        .collect();
    Truth { seal, seed, recording: how, runs }
}

impl Truth {
    /// Returns the log of the recording, not rounded.
    pub fn log(&self) -> Log {
        type Column = (&'static str, fn(&Row) -> f64);
        const COLUMNS: [Column; 6] = [
            ("time_s", |row| row.time_s),
            ("velocity_rad_s", |row| row.velocity_rad_s),
            ("torque_nm", |row| row.torque_nm),
            ("position_rad", |row| row.position_rad),
            ("radial_force_n", |row| row.radial_force_n),
            ("pressure_diff_pa", |row| row.pressure_diff_pa),
        ];
        let run = |(index, rows): (usize, &Vec<Row>)| LoggedRun {
            name: index.to_string(),
            columns: COLUMNS.iter().map(|(_, of)| rows.iter().map(of).collect()).collect(),
        };
        Log {
            columns: COLUMNS.iter().map(|(name, _)| (*name).to_owned()).collect(),
            runs: self.runs.iter().enumerate().map(run).collect(),
        }
    }

    /// Returns the content of `data.csv`.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "run,time_s,position_rad,velocity_rad_s,torque_nm,radial_force_n,pressure_diff_pa\n",
        );
        for (index, rows) in self.runs.iter().enumerate() {
            for row in rows {
                let Row { time_s, position_rad, velocity_rad_s, torque_nm, .. } = row;
                // Writing to a string does not fail.
                let _ = writeln!(
                    text,
                    "{index},{time_s:.6},{position_rad:.9},{velocity_rad_s:.9},{torque_nm:.6},\
                     {:.6},{:.3}",
                    row.radial_force_n, row.pressure_diff_pa
                );
            }
        }
        text
    }

    /// Returns the content of `truth.json`: the drawn parameters by name.
    pub fn json(&self) -> serde_json::Value {
        let Seal { k0, k1, k2, coulomb_nm, static_nm, stribeck_rad_s, .. } = self.seal;
        let Recording { runs, seconds, rate_hz, noise_nm, loaded, steady } = self.recording;
        json!({
            "schema": 1,
            "origin": "simulated",
            "scenario": "underwater-joint",
            "seed": self.seed,
            "hidden": [],
            "recording": {
                "runs": runs, "seconds": seconds, "rate_hz": rate_hz,
                "torque_noise_nm": noise_nm, "loaded": loaded, "steady": steady,
            },
            "parameters": {
                "coulomb_torque": {"value": coulomb_nm, "unit": "Nm"},
                "static_torque": {"value": static_nm, "unit": "Nm"},
                "stribeck_velocity": {"value": stribeck_rad_s, "unit": "rad/s"},
                "bristle_stiffness": {"value": k0, "unit": "Nm/rad"},
                "bristle_damping": {"value": k1, "unit": "Nm s/rad"},
                "viscous_friction": {"value": k2, "unit": "Nm s/rad"},
                "radial_force_coulomb": {"value": self.seal.per_force, "unit": "Nm/N"},
                "pressure_coulomb": {"value": self.seal.per_pressure, "unit": "Nm/Pa"},
                "radial_force_rate": {"value": self.seal.eta3, "unit": "rad/N"},
            },
        })
    }
}
