//! A campaign without hidden effects: seal, runs, conditions and sensors.

use super::excite::{Drive, draw_motions};
use super::hidden_cause::HiddenCause;
use super::sensors::{LossLimits, PlannedSensors};
use crate::conditions::{Condition, Extra, Signal};
use crate::friction::Seal;
use crate::imposed::{Bristles, Division, MIN_STEPS_PER_ROW, Machine, Part, Trajectory};
use crate::joint::Joint;
use crate::log::Log;
use crate::sampler::Sampler;
use crate::sampling::{self, PlannedRun, ReadRun, Readings, TrueRows};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::OnceLock;

/// Quantities that the user can set. `None` to draw them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Number of runs.
    pub runs: Option<usize>,
    /// Length of each run, s.
    pub seconds: Option<f64>,
    /// Sample rate, Hz.
    pub rate_hz: Option<f64>,
    /// Standard deviation of the torque noise, Nm.
    pub noise_nm: Option<f64>,
    /// True to omit the columns of the hidden effects from the log. A diagnosis must then not name their cause.
    pub without_own_columns: bool,
    /// Divides each integration step into this number of parts, for tests of the integrator. 0 is treated as 1.
    pub finer: u32,
}

/// A campaign without hidden effects.
#[derive(Clone, Debug)]
pub struct Setting {
    /// The seal without effects.
    pub seal: Seal,
    /// Sample rate, Hz.
    pub rate_hz: f64,
    /// Length of each run, s.
    pub seconds: f64,
    /// The runs, in the order of time.
    pub runs: Vec<PlannedRun>,
    /// The optional columns of the log.
    pub columns: Vec<&'static str>,
    pub(super) sensors: PlannedSensors,
    /// Time from the start of the first run to the end of the last, s.
    pub campaign_s: f64,
    /// Maximum speed of all runs, rad/s.
    pub top_rad_s: f64,
    finer: f64,
    /// Integration points for joints without a delay and without a step limit.
    plain_paths: OnceLock<Vec<Trajectory>>,
}

/// Maximum integration step, s.
const MAX_STEP_S: f64 = 1e-4;

/// Range of the total number of rows of a log.
const ROWS: (f64, f64) = (9_000.0, 38_000.0);

/// Covariates of the data contract.
const COVARIATES: [&str; 4] =
    ["radial_force_n", "pressure_diff_pa", "temperature_c", "load_torque_nm"];

/// Size of a campaign.
struct Size {
    rate_hz: f64,
    runs: usize,
    seconds: f64,
}

/// Draws the size of a campaign.
fn draw_size(sampler: &mut Sampler, effects: &[HiddenCause], options: &Options) -> Size {
    // The contact age changes over many seconds, so these campaigns are long and have a low sample rate.
    let ages = effects.contains(&HiddenCause::DwellTimeStatic);
    let drawn_rate = sampler.log_between(100.0, if ages { 300.0 } else { 2000.0 });
    let rate_hz = options.rate_hz.unwrap_or((drawn_rate / 5.0).round() * 5.0);
    let rows = sampler.log_between(ROWS.0, ROWS.1);
    // Long enough for six informative runs, and short enough to limit repetition.
    let least_s = if ages { 100.0 } else { 28.0 };
    let total = (rows / rate_hz).max(least_s).min(ROWS.1 / rate_hz).min(170.0);
    let (shortest, longest): (f64, f64) = if ages { (10.0, 22.0) } else { (2.2, 12.0) };
    let drawn = sampler.log_between(shortest.max(total / 40.0), longest);
    let drawn = options.seconds.unwrap_or(drawn);
    let runs = options.runs.unwrap_or(((total / drawn).round() as usize).clamp(6, 40));
    let seconds = options.seconds.unwrap_or((total / runs as f64).max(1.0));
    Size { rate_hz, runs, seconds }
}

/// Draws the seal.
fn draw_seal(sampler: &mut Sampler, rate_hz: f64, effects: &[HiddenCause]) -> Seal {
    let coulomb_nm = sampler.between(1.6, 2.4);
    let static_nm = coulomb_nm * sampler.between(1.15, 1.55);
    // The log must resolve the bristle deflection at a useful acceleration.
    let stiffest = (2.0 * static_nm * rate_hz * rate_hz / 9.0).clamp(2.5e3, 2e4);
    let films = effects.contains(&HiddenCause::TemperatureViscous);
    Seal {
        k0: sampler.log_between(2e3, stiffest),
        k1: sampler.between(5.0, 40.0),
        k2: if films { sampler.between(0.07, 0.12) } else { sampler.between(0.02, 0.1) },
        coulomb_nm,
        static_nm,
        stribeck_rad_s: sampler.log_between(0.05, 0.25),
        per_pressure: 0.0,
        per_force: 0.0,
        eta3: 0.0,
    }
}

/// Draws an oscillation with this amplitude.
fn draw_swing(sampler: &mut Sampler, swing: f64) -> Signal {
    let (hz, phase) = (sampler.between(0.5, 3.0), sampler.between(0.0, TAU));
    Signal { swing, hz, phase, ..Signal::default() }
}

/// Draws an extra column of a run of `seconds`. `lubricant_age_s` is the time since the last greasing, at its start.
fn draw_extra(sampler: &mut Sampler, extra: Extra, lubricant_age_s: f64, seconds: f64) -> Signal {
    let (least, most) = extra.range();
    let level = sampler.between(least, most);
    let small = 0.02 * (most - least);
    match extra {
        Extra::LubricantAge => {
            let per_s = 1.0 / 3600.0;
            Signal { level: lubricant_age_s / 3600.0, per_s, ..Signal::default() }
        }
        Extra::CableTension => Signal { level, ..draw_swing(sampler, 0.1 * (most - least)) },
        Extra::Humidity | Extra::SupplyVoltage => {
            let per_s = sampler.between(-small, small) / seconds;
            Signal { level, per_s, ..Signal::default() }
        }
    }
}

/// Draws the operating conditions of each run.
fn draw_conditions(
    sampler: &mut Sampler,
    size: &Size,
    effects: &[HiddenCause],
    extras: &[Extra],
) -> Vec<Condition> {
    let lively = effects.contains(&HiddenCause::RadialForceRate);
    let (cycles, turn) = (sampler.between(0.8, 2.3), sampler.between(0.0, TAU));
    let (middle_c, half_c) = (sampler.between(10.0, 25.0), 0.5 * sampler.between(10.0, 30.0));
    let greased: Vec<usize> = (0..2).map(|_| 1 + sampler.below(size.runs.max(2) - 1)).collect();
    let mut greased_s = -3600.0 * sampler.between(0.0, 10.0);
    let mut start_s = 0.0;
    (0..size.runs)
        .map(|index| {
            let turned = TAU * cycles * index as f64 / size.runs as f64 + turn;
            let swing_n =
                if lively { sampler.between(4.0, 10.0) } else { sampler.between(1.0, 8.0) };
            let force =
                Signal { level: sampler.between(12.0, 60.0), ..draw_swing(sampler, swing_n) };
            let load_nm = sampler.between(0.3, 2.0);
            let load = Signal {
                level: sampler.sign() * sampler.between(0.5, 10.0),
                ..draw_swing(sampler, load_nm)
            };
            let pressure = Signal {
                level: sampler.between(1e4, 3e5),
                per_s: sampler.between(-8e3, 8e3) / size.seconds,
                ..Signal::default()
            };
            let temperature = Signal {
                level: middle_c + half_c * (0.8 * turned.sin() + 0.2 * sampler.between(-1.0, 1.0)),
                per_s: sampler.between(-0.8, 0.8) / size.seconds,
                swing: sampler.between(0.05, 0.3),
                hz: sampler.between(0.02, 0.08),
                phase: sampler.between(0.0, TAU),
            };
            if greased.contains(&index) {
                greased_s = start_s - sampler.between(60.0, 600.0);
            }
            let age_s = start_s - greased_s;
            let draw = |&extra: &Extra| (extra, draw_extra(sampler, extra, age_s, size.seconds));
            let extras = extras.iter().map(draw).collect();
            let condition = Condition { start_s, force, pressure, temperature, load, extras };
            start_s += size.seconds + sampler.log_between(120.0, 3600.0);
            condition
        })
        .collect()
}

/// Draws conditions without strong accidental correlations between quantities, or with time.
///
/// With six runs such correlations are likely, and the effects of correlated quantities are confounded.
fn draw_uncorrelated_conditions(
    sampler: &mut Sampler,
    size: &Size,
    effects: &[HiddenCause],
    extras: &[Extra],
) -> Vec<Condition> {
    /// Maximum number of trials.
    const MAX_TRIALS: usize = 60;
    /// Correlation below which conditions are accepted.
    const MAX_CORRELATION: f64 = 0.5;
    let mut best = draw_conditions(sampler, size, effects, extras);
    let mut least = largest_correlation(&best);
    for _ in 1..MAX_TRIALS {
        if least < MAX_CORRELATION {
            break;
        }
        let next = draw_conditions(sampler, size, effects, extras);
        let relation = largest_correlation(&next);
        if relation < least {
            (best, least) = (next, relation);
        }
    }
    best
}

/// Returns the largest correlation between the levels of any two quantities over the runs.
fn largest_correlation(conditions: &[Condition]) -> f64 {
    let of = |level: &dyn Fn(&Condition) -> f64| conditions.iter().map(level).collect::<Vec<f64>>();
    let mut series = vec![
        of(&|c| c.start_s),
        of(&|c| c.force.level),
        of(&|c| c.pressure.level),
        of(&|c| c.temperature.level),
        of(&|c| c.load.level.abs()),
    ];
    let extras = conditions.first().map_or(0, |condition| condition.extras.len());
    series.extend((0..extras).map(|at| of(&|c| c.extras[at].1.level)));
    let mut most = 0.0f64;
    for (at, one) in series.iter().enumerate() {
        for other in &series[..at] {
            most = most.max(correlation(one, other).abs());
        }
    }
    most
}

/// Returns the correlation of two series of equal length. It is 0 if one of them is constant.
pub fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let (mean_a, mean_b) = (mean(one), mean(other));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in one.iter().zip(other) {
        ab += (a - mean_a) * (b - mean_b);
        aa += (a - mean_a) * (a - mean_a);
        bb += (b - mean_b) * (b - mean_b);
    }
    if aa * bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

/// Draws the optional columns of the log. Columns of the hidden effects are always included.
fn draw_columns(
    sampler: &mut Sampler,
    effects: &[HiddenCause],
    extras: &[Extra],
) -> Vec<&'static str> {
    let mut columns: Vec<&'static str> = Vec::new();
    let causes_effect = |column: &str| effects.iter().any(|effect| effect.column() == Some(column));
    for (column, share) in [("position_rad", 0.9), ("acceleration_rad_s2", 0.25)] {
        // The acceleration can be computed from the velocity, so no effect requires its column.
        if sampler.chance(share) || (causes_effect(column) && column == "position_rad") {
            columns.push(column);
        }
    }
    for column in COVARIATES {
        if sampler.chance(0.75) || causes_effect(column) {
            columns.push(column);
        }
    }
    columns.extend(extras.iter().map(|extra| extra.column()));
    columns
}

impl Setting {
    /// Draws a campaign in which `effects` are visible.
    pub fn draw(seed: u64, effects: &[HiddenCause], extras: &[Extra], options: &Options) -> Self {
        let mut sampler = Sampler::new(seed, 0);
        let size = draw_size(&mut sampler, effects, options);
        let seal = draw_seal(&mut sampler, size.rate_hz, effects);
        let drive = Drive {
            top_rad_s: sampler.between(4.0, 10.47),
            steepest_rad_s2: Drive::steepest(&seal, size.rate_hz),
            longest_rest_s: (0.6 * size.seconds).clamp(0.1, 20.0),
            rate_hz: size.rate_hz,
            seconds: size.seconds,
        };
        let sensors = PlannedSensors::draw(&mut sampler);
        let loss = LossLimits {
            rate_hz: size.rate_hz,
            seconds: size.seconds,
            sliding_rad: 8.0 * seal.static_nm / seal.k0,
        };
        let mut extras = extras.to_vec();
        if extras.is_empty() && sampler.chance(0.3) {
            extras.extend(sampler.pick(&[
                Extra::Humidity,
                Extra::SupplyVoltage,
                Extra::CableTension,
            ]));
        }
        let columns = draw_columns(&mut sampler, effects, &extras);
        let motions = draw_motions(&mut sampler, &seal, &drive, effects, size.runs);
        let conditions = draw_uncorrelated_conditions(&mut sampler, &size, effects, &extras);
        let runs: Vec<PlannedRun> = motions
            .into_iter()
            .zip(conditions)
            .map(|(motion, condition)| {
                let lost_s = sensors.lost_s(&mut sampler, &motion, &loss);
                let times = sensors.times(&mut sampler, size.rate_hz, size.seconds);
                let row = |time_s: f64| times.partition_point(|t| *t < time_s);
                let lost = row(lost_s.start)..row(lost_s.end);
                let start_angle = sampler.between(-TAU, TAU);
                let held = sampler.between(-0.6, 0.6);
                let seed = sampler.seed();
                PlannedRun { motion, start_angle, condition, times, lost: vec![lost], held, seed }
            })
            .collect();
        let finer = f64::from(options.finer.max(1));
        let setting = Self::planned(seal, size.rate_hz, size.seconds, runs);
        Self { columns, sensors, finer, ..setting }
    }

    /// Returns a campaign of these runs, with exact sensors and without optional columns.
    pub fn planned(seal: Seal, rate_hz: f64, seconds: f64, runs: Vec<PlannedRun>) -> Self {
        let peaks = runs.iter().map(|run| run.motion.peak(seconds));
        let top_rad_s = peaks.fold(0.0, f64::max);
        let campaign_s = runs.last().map_or(0.0, |run| run.condition.start_s + seconds);
        Self {
            seal,
            rate_hz,
            seconds,
            runs,
            columns: Vec::new(),
            sensors: PlannedSensors::default(),
            campaign_s,
            top_rad_s,
            finer: 1.0,
            plain_paths: OnceLock::new(),
        }
    }

    /// Adds a column to the log if it is missing.
    pub fn log_column(&mut self, column: &'static str) {
        let always = ["velocity_rad_s", "time_s"].contains(&column);
        if !always && !self.columns.contains(&column) {
            self.columns.push(column);
        }
    }

    /// Returns the log of all runs. Sensor noise is added to the true torques, Nm.
    pub(crate) fn log(&self, torques: &[Vec<f64>], noise_nm: f64) -> Log {
        let sensors = PlannedSensors { noise_nm, ..self.sensors };
        let runs = || self.runs.iter().zip(torques);
        let readings: Vec<Readings> = runs()
            .map(|(run, torque)| Readings::take(&sensors, run.seed, &TrueRows::new(run, torque)))
            .collect();
        let reads = self.runs.iter().zip(&readings);
        let reads = reads.map(|(run, readings)| ReadRun { run, readings, further: Vec::new() });
        sampling::log(&sensors, &self.columns, &reads.collect::<Vec<ReadRun>>())
    }

    /// Creates the integration points of a run for this joint.
    fn path(&self, joint: &Joint, run: &PlannedRun) -> Trajectory {
        let longest_s = MAX_STEP_S.min(joint.longest_step_s(run.motion.peak(self.seconds)));
        let times: Vec<f64> = run.times.iter().map(|t| t - joint.delay_s).collect();
        let division = Division {
            start_s: times.first().copied().unwrap_or_default(),
            longest_part_s: f64::INFINITY,
            steps: |part: &Part| {
                (part.seconds / longest_s).ceil().max(MIN_STEPS_PER_ROW) * self.finer
            },
        };
        Trajectory::new(&run.motion, run.start_angle, &times, &division)
    }

    /// Returns the true torque of each row of a run, Nm. The joint is cold at its start. Its integration points are not kept.
    pub fn torque_of_run(&self, joint: &Joint, run: &PlannedRun) -> Vec<f64> {
        torque(joint, run, &self.path(joint, run), &mut 0.0)
    }

    /// Returns the true torque of each row of each run, Nm.
    pub fn torques(&self, joint: &Joint) -> Vec<Vec<f64>> {
        let paths = || self.runs.par_iter().map(|run| self.path(joint, run)).collect();
        let special: Vec<Trajectory>;
        let is_special = joint.delay_s != 0.0 || joint.longest_step_s(self.top_rad_s) < MAX_STEP_S;
        let paths = if is_special {
            special = paths();
            &special
        } else {
            self.plain_paths.get_or_init(paths)
        };
        let Some(warming) = joint.warming else {
            let runs = self.runs.par_iter().zip(paths);
            return runs.map(|(run, path)| torque(joint, run, path, &mut 0.0)).collect();
        };
        // The heat is carried from run to run and decays in the pauses.
        let (mut heat_j, mut until_s) = (0.0, 0.0);
        let warm = |(run, path): (&PlannedRun, &Trajectory)| {
            let start_s = run.condition.start_s;
            heat_j *= (-(start_s - until_s) / warming.cooling_s).exp();
            until_s = start_s + self.seconds;
            torque(joint, run, path, &mut heat_j)
        };
        self.runs.iter().zip(paths).map(warm).collect()
    }
}

/// Returns the torque of each row of a run, Nm, and updates the friction heat, J.
fn torque(joint: &Joint, run: &PlannedRun, path: &Trajectory, heat_j: &mut f64) -> Vec<f64> {
    let contact = &Bristles;
    let machine =
        Machine { joint, contact, covariate_hz: None, splits_reversals: true, film_heats: true };
    machine.torques(&run.condition, path, run.held, heat_j)
}
