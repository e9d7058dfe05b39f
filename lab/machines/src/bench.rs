//! Test stand of the underwater joint: a stiff drive imposes the motion, and the friction torque is measured.
//!
//! There are three campaigns after Ding et al.:
//!
//! - *unloaded*: the fit of the plain law (II-B, "radial loading and underwater pressure simulation were not performed"),
//! - *eight kinds* with repeats (an interpretation of Table II),
//! - *factorial*: all combinations of speed, side load, pressure and brake.
//!
//! Runs are logged at 250 Hz. Torque, side load and pressure have sensor noise (Table I). The temperature is that of the
//! thermometer. The motion is the imposed one, without noise.

use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use simulated_machines::conditions::Signal;
use simulated_machines::joint_plant::Parameters;
use simulated_machines::joint_plant::seal::{Around, Seal};
use simulated_machines::log::JOINT_COLUMNS;
use simulated_machines::motion::{Motion, Speeds, Wave};
use simulated_machines::{Log, LoggedRun};
use std::f64::consts::TAU;

/// Sample rate of the logs, Hz, and integration steps per row.
const RATE_HZ: f64 = 250.0;
const STEPS_PER_ROW: usize = 160;

/// Length of a run of the eight kinds, s.
const KIND_S: f64 = 2.0;

/// Pause between two runs, s, in which the joint cools.
const PAUSE_S: f64 = 60.0;

/// Ranges of low and high side load (N) and pressure difference (Pa), as interpreted from Table II.
const FORCE_N: [(f64, f64); 2] = [(25.0, 35.0), (45.0, 55.0)];
const PRESSURE_PA: [(f64, f64); 2] = [(0.0, 0.05e6), (0.25e6, 0.30e6)];

/// Index of a low or a high range.
const LOW: usize = 0;
const HIGH: usize = 1;

/// Torque of the stand's brake, Nm.
pub const BRAKE_NM: f64 = 6.0;

/// A kind of run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunKind {
    /// Speed, rpm.
    pub rpm: f64,
    force: usize,
    pressure: usize,
}

impl RunKind {
    const fn new(rpm: f64, force: usize, pressure: usize) -> Self {
        Self { rpm, force, pressure }
    }
}

/// The eight kinds: speed, range of the side load, range of the pressure.
///
/// The paper does not show which rows had high pressure. This is one possible choice of eight of the twelve combinations
/// with its speeds and loads.
pub const KINDS: [RunKind; 8] = [
    RunKind::new(35.0, LOW, LOW),
    RunKind::new(35.0, HIGH, LOW),
    RunKind::new(35.0, HIGH, HIGH),
    RunKind::new(70.0, LOW, LOW),
    RunKind::new(70.0, LOW, HIGH),
    RunKind::new(100.0, LOW, HIGH),
    RunKind::new(100.0, HIGH, LOW),
    RunKind::new(100.0, HIGH, HIGH),
];

/// From rest to a speed (rad/s) in 0.4 s, then held.
fn start(speed: f64) -> Motion {
    let mut speeds = Speeds::from_rest(true);
    speeds.ramp(speed, 0.4);
    Motion::Speeds(speeds)
}

/// Sinusoidal velocity with a peak (rad/s) and a period (s).
fn sine(peak: f64, period_s: f64) -> Motion {
    Motion::Waves(vec![Wave { peak, hz: 1.0 / period_s }])
}

/// Steps of speed within this time (s), first in positive and then in negative direction, as in a static test.
fn stairs(seconds: f64) -> Motion {
    const RPM: [f64; 10] = [1.0, 3.0, 8.0, 20.0, 60.0, -1.0, -3.0, -8.0, -20.0, -60.0];
    let mut speeds = Speeds::from_rest(true);
    let step_s = seconds / RPM.len() as f64;
    let ramp_s = step_s.min(0.1);
    for rpm in RPM {
        speeds.ramp(rpm * TAU / 60.0, ramp_s);
        speeds.hold(step_s - ramp_s);
    }
    Motion::Speeds(speeds)
}

/// Oscillations of 4 Hz that grow within this time (s) to a travel (rad), as in a dynamic test.
fn presliding(travel: f64, seconds: f64) -> Motion {
    Motion::Presliding { travel, hz: 4.0, growth: seconds }
}

/// A planned run.
#[derive(Clone, Debug)]
struct Plan {
    name: String,
    motion: Motion,
    seconds: f64,
    /// Side load, N, and pressure difference, Pa.
    force: Signal,
    pressure_pa: f64,
    brake_nm: f64,
    start_rad: f64,
    /// Temperature of water and seal at the start, deg C.
    temperature_c: f64,
    seed: u64,
}

/// Extent of the measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amount {
    /// Length of the unloaded and the factorial runs, s.
    pub seconds: f64,
    /// True for a fast and a slow motion in each cell of the factorial, false to draw one of them.
    pub both_motions: bool,
    /// Training repeats of each of the eight kinds.
    pub learned: usize,
    /// Held-out repeats of each of the eight kinds.
    pub held_out: usize,
}

/// Measurements of one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Campaigns {
    /// Runs without side load and pressure.
    pub unloaded: Log,
    /// Runs of the full factorial.
    pub factorial: Log,
    /// Training runs of the eight kinds.
    pub learned: Log,
    /// Held-out runs of the eight kinds.
    pub held_out: Log,
}

/// Test stand with one machine.
#[derive(Clone, Copy, Debug)]
pub struct Bench {
    /// Parameters of the machine.
    pub parameters: Parameters,
    /// Angles of the eccentricity and the out-of-roundness, rad.
    pub phase_rad: [f64; 2],
    /// Range of the water and seal temperature at the start of the factorial's runs, deg C.
    ///
    /// The other campaigns use the machine's water temperature. If both limits equal it, the temperature effect is not
    /// identifiable.
    pub temperature_c: [f64; 2],
    /// Seed of noise and conditions.
    pub seed: u64,
}

impl Bench {
    /// Measures all campaigns of one machine.
    ///
    /// The runs have a random order, so that a drift is not confounded with a campaign.
    pub fn measure(&self, amount: &Amount) -> Campaigns {
        let groups = [
            self.unloaded(amount.seconds),
            self.factorial(amount.seconds, amount.both_motions),
            self.kinds(0, amount.learned),
            self.kinds(amount.learned, amount.held_out),
        ];
        let mut slots: Vec<usize> = (0..groups.iter().map(Vec::len).sum()).collect();
        let mut random = Pcg64::seed_from_u64(self.seed ^ 0x44);
        for last in (1..slots.len()).rev() {
            slots.swap(last, random.random_range(0..=last));
        }
        let length = amount.seconds.max(KIND_S) + PAUSE_S;
        let mut slots = slots.into_iter().map(|slot| slot as f64 * length);
        let [unloaded, factorial, learned, held_out] = groups.map(|plans| {
            let starts: Vec<f64> = slots.by_ref().take(plans.len()).collect();
            let runs = plans.par_iter().zip(starts).map(|(plan, start)| self.run(plan, start));
            Log { columns: JOINT_COLUMNS.map(str::to_owned).to_vec(), runs: runs.collect() }
        });
        Campaigns { unloaded, factorial, learned, held_out }
    }

    /// Plans the static and dynamic tests without side load and pressure.
    fn unloaded(&self, seconds: f64) -> Vec<Plan> {
        let motions = [
            stairs(seconds),
            presliding(2e-3, seconds),
            sine(0.5, 4.0),
            sine(7.0, 5.0),
            stairs(seconds),
            presliding(6e-3, seconds),
            sine(0.2, 2.0),
            sine(10.5, 5.0),
        ];
        let mut random = Pcg64::seed_from_u64(self.seed ^ 0x11);
        let plan = |(index, motion): (usize, Motion)| Plan {
            name: format!("u{index}"),
            motion,
            seconds,
            force: Signal::default(),
            pressure_pa: 0.0,
            brake_nm: 0.0,
            start_rad: random.random_range(0.0..TAU),
            temperature_c: self.parameters.water_temperature_c,
            seed: random.random(),
        };
        motions.into_iter().enumerate().map(plan).collect()
    }

    /// Plans `repeats` runs of each kind, from repeat `first` on, in alternating directions.
    fn kinds(&self, first: usize, repeats: usize) -> Vec<Plan> {
        let each = |kind: usize| (first..first + repeats).map(move |repeat| (kind, repeat));
        let plan = |(kind, repeat): (usize, usize)| {
            let RunKind { rpm, force, pressure } = KINDS[kind];
            let index = (kind * 1000 + repeat) as u64;
            let mut random = Pcg64::seed_from_u64(self.seed ^ (0x22_0000 + index));
            let mut between = |(least, most): (f64, f64)| random.random_range(least..most);
            let (level, pressure_pa) = (between(FORCE_N[force]), between(PRESSURE_PA[pressure]));
            let (swing, phase) = (between((0.5, 2.0)), between((0.0, TAU)));
            let start_rad = between((0.0, TAU));
            let direction = if repeat.is_multiple_of(2) { 1.0 } else { -1.0 };
            Plan {
                name: format!("k{}.{repeat}", kind + 1),
                motion: start(direction * rpm * TAU / 60.0),
                seconds: KIND_S,
                force: Signal { level, swing, hz: 1.5, phase, per_s: 0.0 },
                pressure_pa,
                brake_nm: 0.0,
                start_rad,
                temperature_c: self.parameters.water_temperature_c,
                seed: random.random(),
            }
        };
        (0..KINDS.len()).flat_map(each).map(plan).collect()
    }

    /// Plans all combinations of three speeds, low and high side load, pressure and brake.
    ///
    /// Each has one or two motions, and each run has its own water temperature.
    fn factorial(&self, seconds: f64, both_motions: bool) -> Vec<Plan> {
        let mut random = Pcg64::seed_from_u64(self.seed ^ 0x33);
        let mut warmth = Pcg64::seed_from_u64(self.seed ^ 0x55);
        let [coldest, warmest] = self.temperature_c;
        let mut plans = Vec::new();
        for index in 0..24usize {
            let rpm = [35.0, 70.0, 100.0][index % 3];
            let (force, pressure, brake) = (index / 3 % 2, index / 6 % 2, index / 12 % 2);
            let fast = sine(rpm * TAU / 60.0, 5.0);
            let slow = match index % 4 {
                0 => stairs(seconds),
                1 => presliding(5e-3, seconds),
                2 => sine(0.5, 4.0),
                _ => sine(1.2, 3.0),
            };
            let motions = if both_motions {
                vec![fast, slow]
            } else if random.random_bool(0.5) {
                vec![fast]
            } else {
                vec![slow]
            };
            for (number, motion) in motions.into_iter().enumerate() {
                let mut between = |(least, most): (f64, f64)| random.random_range(least..most);
                plans.push(Plan {
                    name: format!("f{index}.{number}"),
                    motion,
                    seconds,
                    force: Signal {
                        level: between(FORCE_N[force]),
                        swing: between((2.0, 5.0)),
                        hz: between((0.5, 3.0)),
                        phase: between((0.0, TAU)),
                        per_s: 0.0,
                    },
                    pressure_pa: between(PRESSURE_PA[pressure]),
                    brake_nm: [0.0, BRAKE_NM][brake],
                    start_rad: between((0.0, TAU)),
                    temperature_c: coldest + (warmest - coldest) * warmth.random::<f64>(),
                    seed: random.random(),
                });
            }
        }
        plans
    }

    /// Simulates a run and returns its log.
    fn run(&self, plan: &Plan, start_s: f64) -> LoggedRun {
        let p = &Parameters { water_temperature_c: plan.temperature_c, ..self.parameters };
        let mut random = Pcg64::seed_from_u64(plan.seed);
        let mut seal = Seal::new(p, self.phase_rad);
        let at = |t: f64, velocity: f64| {
            // A powder brake opposes the motion, with a smooth transition at rest.
            let brake = plan.brake_nm * (velocity / 0.05).tanh();
            Around {
                radial_force_n: plan.force.at(t),
                pressure_diff_pa: plan.pressure_pa,
                load_torque_nm: brake,
            }
        };
        seal.settle(&at(0.0, 0.0));
        let dt = 1.0 / RATE_HZ / STEPS_PER_ROW as f64;
        let rows = (plan.seconds * RATE_HZ) as usize;
        let mut columns: Vec<Vec<f64>> = vec![Vec::with_capacity(rows); JOINT_COLUMNS.len()];
        let mut position = plan.start_rad;
        for row in 0..rows {
            let t = row as f64 / RATE_HZ;
            if row > 0 {
                for step in 0..STEPS_PER_ROW {
                    let now = t + (step as f64 + 1.0 - STEPS_PER_ROW as f64) * dt;
                    let velocity = plan.motion.at(now).velocity;
                    seal.step(velocity, position, &at(now, velocity), dt);
                    position += velocity * dt;
                }
            }
            let velocity = plan.motion.at(t).velocity;
            let around = at(t, velocity);
            let mut noisy = |value: f64, deviation: f64| {
                let noise: f64 = StandardNormal.sample(&mut random);
                value + deviation * noise
            };
            let values = [
                start_s + t,
                velocity,
                noisy(seal.torque_nm(), p.torque_noise_nm),
                position,
                noisy(around.radial_force_n, p.force_noise_n),
                noisy(around.pressure_diff_pa, p.pressure_noise_pa),
                seal.shown_temperature_c(),
                around.load_torque_nm,
            ];
            columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
        }
        LoggedRun { name: plan.name.clone(), columns }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn measure_returns_all_runs_and_is_reproducible() {
        let parameters = Parameters::default();
        let temperature_c = [10.0, 30.0];
        let bench = Bench { parameters, phase_rad: [1.0, 2.0], temperature_c, seed: 3 };
        let amount = Amount { seconds: 1.0, both_motions: false, learned: 2, held_out: 1 };
        let measured = bench.measure(&amount);
        let runs = |log: &Log| log.runs.len();
        assert_eq!((runs(&measured.unloaded), runs(&measured.factorial)), (8, 24));
        assert_eq!((runs(&measured.learned), runs(&measured.held_out)), (16, 8));
        assert_eq!(measured, bench.measure(&amount));
        assert_ne!(measured, Bench { seed: 4, ..bench }.measure(&amount));
        // Each factorial run has its own water temperature; the others have that of the machine.
        let column = JOINT_COLUMNS.iter().position(|name| *name == "temperature_c").unwrap();
        let begins = |log: &Log| {
            let mut all: Vec<f64> = log.runs.iter().map(|run| run.columns[column][0]).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        let warmth = begins(&measured.factorial);
        assert!(warmth[0] >= 10.0 && warmth[23] <= 30.0 && warmth[23] - warmth[0] > 10.0);
        assert!(warmth.windows(2).all(|pair| pair[0] < pair[1]));
        let learned_temperatures = begins(&measured.learned);
        assert!(learned_temperatures.iter().all(|at| *at == parameters.water_temperature_c));
        // No two runs start at the same time, and the unloaded runs are not all first.
        let starts = |log: &Log| log.runs.iter().map(|run| run.columns[0][0]).collect::<Vec<_>>();
        let unloaded = starts(&measured.unloaded);
        let others =
            [&measured.factorial, &measured.learned, &measured.held_out].map(starts).concat();
        assert!(others.iter().all(|start| !unloaded.contains(start)));
        let first = others.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(unloaded.iter().any(|start| *start > first));
    }
}
