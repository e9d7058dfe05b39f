//! The plant's test stand: a stiff drive imposes the motion, and what rubs is measured.
//!
//! Three campaigns, after Ding et al.: *unloaded* (II-B: the fit of the plain law, "radial loading and underwater pressure
//! simulation were not performed"), *eight kinds* with repeats (Table II as the readings take it), and a full
//! *factorial* of speed, side load, pressure and brake in which everything moves. A run is logged at 250 Hz: the torque with
//! the sensor's noise (Table I), side load and pressure with theirs, the thermometer; motion as the stand imposes it.

use super::parameters::Parameters;
use super::seal::{Around, Seal};
use crate::log::{Log, LoggedRun};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use std::f64::consts::TAU;

/// Rate of the logs, Hz, and steps between two rows.
const RATE_HZ: f64 = 250.0;
const STEPS: usize = 160;

/// Length of a run of the eight kinds, s.
const KIND_S: f64 = 2.0;

/// Time between two runs, s: the joint cools.
const PAUSE_S: f64 = 60.0;

/// Low and high side load (N) and pressure difference (Pa) of Table II, as the readings take it.
const FORCE_N: [(f64, f64); 2] = [(25.0, 35.0), (45.0, 55.0)];
const PRESSURE_PA: [(f64, f64); 2] = [(0.0, 0.05e6), (0.25e6, 0.30e6)];

/// Torque of the stand's brake, Nm.
pub const BRAKE_NM: f64 = 6.0;

/// The eight kinds: rpm, side load high, pressure high. The print has lost which rows had high pressure; this is one way
/// to choose eight of the twelve combinations with its speeds and loads.
pub const KINDS: [(f64, usize, usize); 8] = [
    (35.0, 0, 0),
    (35.0, 1, 0),
    (35.0, 1, 1),
    (70.0, 0, 0),
    (70.0, 0, 1),
    (100.0, 0, 1),
    (100.0, 1, 0),
    (100.0, 1, 1),
];

/// Columns of a bench log.
pub const COLUMNS: [&str; 8] = [
    "time_s",
    "velocity_rad_s",
    "torque_nm",
    "position_rad",
    "radial_force_n",
    "pressure_diff_pa",
    "temperature_c",
    "load_torque_nm",
];

/// How the stand moves the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    /// From rest to a speed (rad/s) in 0.4 s, then held.
    Start(f64),
    /// To and fro, up to a speed (rad/s), with a period (s).
    Sine(f64, f64),
    /// Steps of speed, a second each, up and then down again on the other side: as a static test.
    Stairs,
    /// Small strokes of 4 Hz that grow to this travel (rad): as a dynamic test.
    Presliding(f64),
}

impl Motion {
    fn velocity(&self, t: f64, seconds: f64) -> f64 {
        match *self {
            Self::Start(speed) => speed * smooth(t / 0.4),
            Self::Sine(peak, period) => peak * (TAU * t / period).sin(),
            Self::Stairs => {
                const RPM: [f64; 10] = [1.0, 3.0, 8.0, 20.0, 60.0, -1.0, -3.0, -8.0, -20.0, -60.0];
                let each = seconds / RPM.len() as f64;
                let step = ((t / each) as usize).min(RPM.len() - 1);
                let before = if step == 0 { 0.0 } else { RPM[step - 1] };
                let share = smooth((t - step as f64 * each) / 0.1);
                (before + (RPM[step] - before) * share) * TAU / 60.0
            }
            Self::Presliding(travel) => {
                let (w, share) = (TAU * 4.0, t / seconds);
                travel * (2.0 * share / seconds * (w * t).sin() + share * share * w * (w * t).cos())
            }
        }
    }
}

/// 0 to 1 with zero slope at both ends.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// A run to be made.
#[derive(Clone, Debug)]
struct Plan {
    name: String,
    motion: Motion,
    seconds: f64,
    force_n: f64,
    /// Swing of the side load, N, its frequency, Hz, and phase, rad.
    swing: (f64, f64, f64),
    pressure_pa: f64,
    brake_nm: f64,
    start_rad: f64,
    /// Temperature of water and seal at the start, deg C.
    temperature_c: f64,
    seed: u64,
}

/// How much is measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Amount {
    /// Length of unloaded runs and of those of the factorial, s.
    pub seconds: f64,
    /// A fast and a slow motion in each cell of the factorial; else one of them, drawn.
    pub both_motions: bool,
    /// Repeats of each of the eight kinds to learn from.
    pub learned: usize,
    /// Further repeats, to judge by.
    pub held_out: usize,
}

/// What was measured of one machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Campaigns {
    /// Without side load and pressure.
    pub unloaded: Log,
    /// The full factorial.
    pub factorial: Log,
    /// The eight kinds, to learn from.
    pub learned: Log,
    /// The eight kinds, to judge by.
    pub held_out: Log,
}

/// The stand with one machine on it.
#[derive(Clone, Copy, Debug)]
pub struct Bench {
    /// The machine.
    pub parameters: Parameters,
    /// Where its eccentricity and out-of-roundness lie, rad.
    pub phase_rad: [f64; 2],
    /// Least and most temperature of the water and the seal in it that the factorial's runs begin at, deg C; the other
    /// campaigns are in the machine's own water. Where both are that one's, nothing of temperature can be learned.
    pub temperature_c: [f64; 2],
    /// Draws noise and conditions.
    pub seed: u64,
}

impl Bench {
    /// Makes all campaigns of one machine, in random order: what drifts over the campaign goes with none of them.
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
            Log { columns: COLUMNS.map(str::to_owned).to_vec(), runs: runs.collect() }
        });
        Campaigns { unloaded, factorial, learned, held_out }
    }

    /// Without side load and pressure, as the paper fitted the plain law: static and dynamic tests.
    fn unloaded(&self, seconds: f64) -> Vec<Plan> {
        let motions = [
            Motion::Stairs,
            Motion::Presliding(2e-3),
            Motion::Sine(0.5, 4.0),
            Motion::Sine(7.0, 5.0),
            Motion::Stairs,
            Motion::Presliding(6e-3),
            Motion::Sine(0.2, 2.0),
            Motion::Sine(10.5, 5.0),
        ];
        let mut random = Pcg64::seed_from_u64(self.seed ^ 0x11);
        let plan = |(index, motion): (usize, Motion)| Plan {
            name: format!("u{index}"),
            motion,
            seconds,
            force_n: 0.0,
            swing: (0.0, 0.0, 0.0),
            pressure_pa: 0.0,
            brake_nm: 0.0,
            start_rad: random.random_range(0.0..TAU),
            temperature_c: self.parameters.water_temperature_c,
            seed: random.random(),
        };
        motions.into_iter().enumerate().map(plan).collect()
    }

    /// The eight kinds, so many repeats each from repeat `first` on, forwards and backwards in turn.
    fn kinds(&self, first: usize, repeats: usize) -> Vec<Plan> {
        let each = |kind: usize| (first..first + repeats).map(move |repeat| (kind, repeat));
        let plan = |(kind, repeat): (usize, usize)| {
            let (rpm, force, pressure) = KINDS[kind];
            let index = (kind * 1000 + repeat) as u64;
            let mut random = Pcg64::seed_from_u64(self.seed ^ (0x22_0000 + index));
            let mut between = |(least, most): (f64, f64)| random.random_range(least..most);
            let (force_n, pressure_pa) = (between(FORCE_N[force]), between(PRESSURE_PA[pressure]));
            let swing = (between((0.5, 2.0)), 1.5, between((0.0, TAU)));
            let start_rad = between((0.0, TAU));
            let way = if repeat.is_multiple_of(2) { 1.0 } else { -1.0 };
            Plan {
                name: format!("k{}.{repeat}", kind + 1),
                motion: Motion::Start(way * rpm * TAU / 60.0),
                seconds: KIND_S,
                force_n,
                swing,
                pressure_pa,
                brake_nm: 0.0,
                start_rad,
                temperature_c: self.parameters.water_temperature_c,
                seed: random.random(),
            }
        };
        (0..KINDS.len()).flat_map(each).map(plan).collect()
    }

    /// Every combination of three speeds, low and high side load, pressure and brake, each in two motions or one, and each
    /// run in water of another temperature.
    fn factorial(&self, seconds: f64, both_motions: bool) -> Vec<Plan> {
        let mut random = Pcg64::seed_from_u64(self.seed ^ 0x33);
        let mut warmth = Pcg64::seed_from_u64(self.seed ^ 0x55);
        let [coldest, warmest] = self.temperature_c;
        let mut plans = Vec::new();
        for index in 0..24usize {
            let rpm = [35.0, 70.0, 100.0][index % 3];
            let (force, pressure, brake) = (index / 3 % 2, index / 6 % 2, index / 12 % 2);
            let fast = Motion::Sine(rpm * TAU / 60.0, 5.0);
            let slow = match index % 4 {
                0 => Motion::Stairs,
                1 => Motion::Presliding(5e-3),
                2 => Motion::Sine(0.5, 4.0),
                _ => Motion::Sine(1.2, 3.0),
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
                    force_n: between(FORCE_N[force]),
                    swing: (between((2.0, 5.0)), between((0.5, 3.0)), between((0.0, TAU))),
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

    fn run(&self, plan: &Plan, start_s: f64) -> LoggedRun {
        let p = &Parameters { water_temperature_c: plan.temperature_c, ..self.parameters };
        let mut random = Pcg64::seed_from_u64(plan.seed);
        let mut seal = Seal::new(p, self.phase_rad);
        let at = |t: f64, velocity: f64| {
            let (size, frequency, phase) = plan.swing;
            // A powder brake is against the motion, and soft at rest.
            let brake = plan.brake_nm * (velocity / 0.05).tanh();
            Around {
                radial_force_n: plan.force_n + size * (TAU * frequency * t + phase).sin(),
                pressure_diff_pa: plan.pressure_pa,
                load_torque_nm: brake,
            }
        };
        seal.settle(&at(0.0, 0.0));
        let dt = 1.0 / RATE_HZ / STEPS as f64;
        let rows = (plan.seconds * RATE_HZ) as usize;
        let mut columns: Vec<Vec<f64>> = vec![Vec::with_capacity(rows); COLUMNS.len()];
        let mut position = plan.start_rad;
        for row in 0..rows {
            let t = row as f64 / RATE_HZ;
            if row > 0 {
                for step in 0..STEPS {
                    let now = t + (step as f64 + 1.0 - STEPS as f64) * dt;
                    let velocity = plan.motion.velocity(now, plan.seconds);
                    seal.step(velocity, position, &at(now, velocity), dt);
                    position += velocity * dt;
                }
            }
            let velocity = plan.motion.velocity(t, plan.seconds);
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
    fn campaigns_have_their_runs_and_the_same_seed_gives_the_same_bits() {
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
        // Water of another temperature in each run of the factorial, and of the machine's own in the others.
        let column = COLUMNS.iter().position(|name| *name == "temperature_c").unwrap();
        let begins = |log: &Log| {
            let mut all: Vec<f64> = log.runs.iter().map(|run| run.columns[column][0]).collect();
            all.sort_by(f64::total_cmp);
            all
        };
        let warmth = begins(&measured.factorial);
        assert!(warmth[0] >= 10.0 && warmth[23] <= 30.0 && warmth[23] - warmth[0] > 10.0);
        assert!(warmth.windows(2).all(|pair| pair[0] < pair[1]));
        let own = begins(&measured.learned);
        assert!(own.iter().all(|at| *at == parameters.water_temperature_c));
        // No two runs at one time, and the unloaded ones not all first.
        let starts = |log: &Log| log.runs.iter().map(|run| run.columns[0][0]).collect::<Vec<_>>();
        let unloaded = starts(&measured.unloaded);
        let others =
            [&measured.factorial, &measured.learned, &measured.held_out].map(starts).concat();
        assert!(others.iter().all(|start| !unloaded.contains(start)));
        let first = others.iter().copied().fold(f64::INFINITY, f64::min);
        assert!(unloaded.iter().any(|start| *start > first));
    }
}
