//! Simulation of the underwater joint of Ding et al. on its test stand.
//!
//! The ranges are those of the paper: 35, 70 and 100 rpm, side load 25-35 or 45-55 N, pressure difference 0-0.05 or
//! 0.25-0.30 MPa, and friction 2 to 3.5 Nm. The seal is drawn from a seed. Each run has its own speed, load and
//! pressure. The motions make every parameter identifiable.
//!
//! The torque sensor adds white noise. Velocity, load and pressure are exact, but for the resolution of the log. `truth.json` marks the data as simulated.

use crate::conditions::{Condition, Signal};
use crate::friction::Seal;
use crate::joint::Joint;
use crate::log::Log;
use crate::motion::{Motion, Speeds, Wave};
use crate::sampling::PlannedRun;
use crate::scenarios::setting::Setting;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use serde_json::json;
use std::f64::consts::TAU;

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

/// Recorded data and their ground truth.
#[derive(Clone, Debug)]
pub struct Truth {
    /// The drawn seal.
    pub seal: Seal,
    /// Seed of the seal.
    pub seed: u64,
    /// Recording parameters.
    pub recording: Recording,
    log: Log,
}

/// Pause between two runs in campaign time, s.
const PAUSE_S: f64 = 60.0;

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

/// Draws the motion of a run.
fn motion(index: usize, seal: &Seal, how: &Recording) -> Motion {
    let peak = [35.0, 70.0, 100.0][index % 3] * TAU / 60.0;
    let sine = |peak: f64, period_s: f64| Motion::Waves(vec![Wave { peak, hz: 1.0 / period_s }]);
    if how.steady {
        let mut speeds = Speeds::from_rest(true);
        speeds.ramp(if index.is_multiple_of(2) { peak } else { -peak }, 0.5);
        return Motion::Speeds(speeds);
    }
    match index % 4 {
        0 => sine(peak, 5.0),
        1 => {
            let travel = 6.0 * seal.static_nm / seal.k0;
            Motion::Presliding { travel, hz: 4.0, growth: how.seconds }
        }
        2 => sine(4.0 * seal.stribeck_rad_s, 4.0),
        _ => sine(1.5 * seal.stribeck_rad_s, 2.0),
    }
}

/// Draws side load and pressure of a run. The side load has a level and a slow oscillation.
fn draw_condition(random: &mut Pcg64, index: usize, how: &Recording) -> Condition {
    let start_s = index as f64 * (how.seconds + PAUSE_S);
    if !how.loaded {
        return Condition { start_s, ..Condition::default() };
    }
    // Four consecutive runs contain all combinations of high and low. The next four combine them with other motions.
    let turn = index + index / 4;
    let (high_force, high_pressure) = (turn % 2 == 1, turn / 2 % 2 == 1);
    let force = Signal {
        level: if high_force { 50.0 } else { 30.0 },
        swing: random.random_range(3.0..5.0),
        hz: random.random_range(0.5..3.0),
        ..Signal::default()
    };
    let pressure_pa = if high_pressure {
        random.random_range(0.25e6..0.30e6)
    } else {
        random.random_range(0.0..0.05e6)
    };
    let pressure = Signal { level: pressure_pa, ..Signal::default() };
    Condition { start_s, force, pressure, ..Condition::default() }
}

/// Draws a seal and records its runs. The same seed and recording give the same rows.
pub fn record(seed: u64, how: Recording) -> Truth {
    let mut random = Pcg64::seed_from_u64(seed);
    let seal = draw_seal(&mut random, how.loaded);
    let rows = (how.seconds * how.rate_hz).round() as usize;
    let runs = (0..how.runs).map(|index| PlannedRun {
        seed: random.random(),
        motion: motion(index, &seal, &how),
        condition: draw_condition(&mut random, index, &how),
        start_angle: 0.0,
        times: (0..rows).map(|row| row as f64 / how.rate_hz).collect(),
        lost: Vec::new(),
        held: 0.0,
    });
    let columns = ["position_rad", "radial_force_n", "pressure_diff_pa"];
    let mut setting = Setting::planned(seal, how.rate_hz, how.seconds, runs.collect());
    setting.columns = columns.to_vec();
    let joint = Joint::plain(seal);
    let torques: Vec<Vec<f64>> =
        setting.runs.par_iter().map(|run| setting.torque_of_run(&joint, run)).collect();
    let log = setting.log(&torques, how.noise_nm);
    Truth { seal, seed, recording: how, log }
}

impl Truth {
    /// Returns the log of the recording.
    pub fn log(&self) -> &Log {
        &self.log
    }

    /// Returns the content of `truth.json`: the drawn parameters by name.
    pub fn json(&self) -> serde_json::Value {
        let mut parameters = self.seal.json();
        parameters["radial_force_coulomb"] = json!({"value": self.seal.per_force, "unit": "Nm/N"});
        parameters["pressure_coulomb"] = json!({"value": self.seal.per_pressure, "unit": "Nm/Pa"});
        parameters["radial_force_rate"] = json!({"value": self.seal.eta3, "unit": "rad/N"});
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
            "parameters": parameters,
        })
    }
}
