//! A campaign without a hidden effect: plant, sensors, runs and covariates.
//!
//! It is drawn from a seed alone and is not adapted to a diagnosis. Sample rates are 50 Hz to 2 kHz. There are 3 to 40
//! runs. The presliding travel may be far smaller than the travel between two rows. Logs begin and end anywhere in a
//! motion. Covariates may be correlated (up to 0.9), take few values, or rise with the order of the runs.

use super::family::{Family, PlantKind};
use super::lubricated::LubricatedSeal;
use super::mechanism::Beside;
use super::motions::{Drive, STYLES, draw_motion};
use super::plant::{Element, Plant, RunInput};
use super::sensing::{Sensing, SensorKind};
use simulated_machines::conditions::{Condition, Extra, Signal};
use simulated_machines::friction::Seal;
use simulated_machines::imposed::{Division, MIN_STEPS_PER_ROW, Part, Trajectory};
use simulated_machines::sampler::Sampler;
use simulated_machines::sampling::PlannedRun;
use std::f64::consts::TAU;
use std::ops::Range;

/// Range of the sample rate, Hz.
const RATE_HZ: (f64, f64) = (50.0, 2000.0);
/// Range of the number of runs.
const RUNS: (f64, f64) = (3.0, 40.9);
/// Maximum integration step while the contact slides, s.
const MAX_SLIDING_STEP_S: f64 = 5e-4;
/// Maximum integration step near standstill, s.
const MAX_STANDSTILL_STEP_S: f64 = 1e-4;

/// A planned run, with what acts on its joint besides the operating conditions.
#[derive(Clone, Debug)]
pub(super) struct RunPlan {
    pub run: PlannedRun,
    pub beside: Beside,
}

impl RunPlan {
    /// Returns the run with a trajectory as the input of a machine.
    pub fn input<'a>(&'a self, trajectory: &'a Trajectory) -> RunInput<'a> {
        let PlannedRun { condition, held, .. } = &self.run;
        RunInput { condition, beside: &self.beside, trajectory, held: *held }
    }
}

/// A column of the log that is neither a motion nor a covariate of the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AddedColumn {
    /// Velocity of another joint, rad/s.
    OtherVelocity,
    /// Acceleration of another joint, rad/s^2.
    OtherAcceleration,
    /// The payload, kg.
    Payload,
    /// Current of the motor, A: another reading of the torque.
    MotorCurrent,
    /// Set-point of the joint's own velocity, rad/s.
    VelocitySetpoint,
}

/// A campaign: its plant, sensors and planned runs.
#[derive(Clone, Debug)]
pub(super) struct Campaign {
    pub family: Family,
    pub seal: Seal,
    pub plant: Plant,
    pub sensing: Sensing,
    pub rate_hz: f64,
    pub drive: Drive,
    pub runs: Vec<RunPlan>,
    /// Covariates and extra columns of the log.
    pub columns: Vec<&'static str>,
    pub extras: Vec<Extra>,
    pub added: Vec<(&'static str, AddedColumn)>,
    /// Rigid-body parts of the torque, named as in `--rigid-body`.
    pub rigid_body: Vec<&'static str>,
    /// Time from the start of the first run to the end of the last, s.
    pub campaign_s: f64,
    /// Largest correlation between covariates that was drawn.
    pub correlation: f64,
}

/// A covariate of the data contract, with its usual range.
#[derive(Clone, Copy)]
struct Covariate {
    column: &'static str,
    range: HalfRange,
}

impl Covariate {
    const fn new(column: &'static str, middle: f64, half: f64) -> Self {
        Self { column, range: HalfRange { middle, half } }
    }
}

/// Covariates of the data contract. The range of the load is that of a joint of 1 Nm.
const COVARIATES: [Covariate; 4] = [
    Covariate::new("radial_force_n", 40.0, 35.0),
    Covariate::new("pressure_diff_pa", 2e5, 1.8e5),
    Covariate::new("temperature_c", 22.0, 13.0),
    Covariate::new(LOAD_COLUMN, 0.0, 1.0),
];
/// Index of the temperature in [`COVARIATES`].
const TEMPERATURE: usize = 2;
const LOAD_COLUMN: &str = "load_torque_nm";

impl Campaign {
    /// Draws a campaign of a family with the given sensor kind and plant.
    ///
    /// The order of the draws is part of the result: it must not change.
    pub fn draw(sampler: &mut Sampler, kind: SensorKind, plant: PlantKind, family: Family) -> Self {
        let rate_hz = sampler.log_between(RATE_HZ.0, RATE_HZ.1).round();
        let (least, most) = family.row_range();
        let rows = sampler.log_between(least, most);
        let total_s = rows / rate_hz;
        let count = sampler.log_between(RUNS.0, RUNS.1).min(total_s).max(RUNS.0) as usize;
        let seconds = total_s / count as f64;

        let (seal, drive) = draw_seal_and_drive(sampler, seconds);
        let draw_sensing = if family.draw_second_maker(sampler) {
            Sensing::draw_second_maker
        } else {
            Sensing::draw
        };
        let sensing = draw_sensing(sampler, kind, rate_hz, seal.coulomb_nm);
        let plant = match plant {
            PlantKind::Bristles => Plant::Bristles,
            PlantKind::SlipElements => draw_slip_elements(sampler),
            PlantKind::LubricatedSeal => {
                Plant::LubricatedSeal(LubricatedSeal::draw(sampler, drive.top_rad_s))
            }
        };

        let extras = draw_extras(sampler);
        let (conditions, correlation) =
            draw_conditions(sampler, count, seconds, seal.coulomb_nm, &extras);
        let campaign_s = conditions.last().map_or(0.0, |last| last.start_s + seconds);
        let runs = draw_runs(sampler, conditions, rate_hz, &drive);
        let rigid_body = draw_rigid_body(sampler, &sensing);
        let columns = draw_columns(sampler, &rigid_body);
        Self {
            family,
            seal,
            plant,
            sensing,
            rate_hz,
            drive,
            runs,
            columns,
            extras,
            added: Vec::new(),
            rigid_body,
            campaign_s,
            correlation,
        }
    }

    /// Returns the largest magnitude of a covariate in the campaign.
    pub fn largest(&self, of: impl Fn(&Condition) -> Signal) -> f64 {
        let largest = |plan: &RunPlan| {
            let signal = of(&plan.run.condition);
            let end = signal.level + signal.per_s * self.drive.seconds;
            signal.level.abs().max(end.abs()) + signal.swing.abs()
        };
        self.runs.iter().map(largest).fold(0.0, f64::max)
    }

    /// Returns the smallest and largest value of a covariate in the campaign.
    pub fn range(&self, of: impl Fn(&Condition) -> Signal) -> (f64, f64) {
        let ends = self.runs.iter().flat_map(|plan| {
            let signal = of(&plan.run.condition);
            [signal.at(0.0), signal.at(self.drive.seconds)]
        });
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), x| (l.min(x), m.max(x)))
    }

    /// Returns the true trajectories of all runs.
    pub fn trajectories(&self) -> Vec<Trajectory> {
        self.runs.iter().map(|plan| self.trajectory(&plan.run)).collect()
    }

    /// Returns the true trajectory of a run from the start of its motion.
    fn trajectory(&self, run: &PlannedRun) -> Trajectory {
        let slow = 2.0 * self.drive.stribeck_rad_s;
        let row_s = 1.0 / self.rate_hz;
        let steps = |part: &Part| {
            let (before, after) = (part.begin.velocity, part.end.velocity);
            let is_near_standstill = before.abs().min(after.abs()) < slow || before * after <= 0.0;
            let longest =
                if is_near_standstill { MAX_STANDSTILL_STEP_S } else { MAX_SLIDING_STEP_S };
            (part.seconds / longest.min(row_s / MIN_STEPS_PER_ROW)).ceil()
        };
        let division = Division { start_s: 0.0, longest_part_s: row_s, steps };
        Trajectory::new(&run.motion, run.start_angle, &run.times, &division)
    }
}

/// Draws the seal and the limits of the drive for runs of `seconds`.
fn draw_seal_and_drive(sampler: &mut Sampler, seconds: f64) -> (Seal, Drive) {
    let coulomb_nm = sampler.log_between(0.05, 30.0);
    let static_nm = coulomb_nm * sampler.between(1.0, 1.6);
    let top_rad_s = sampler.log_between(0.3, 12.0);
    let steepest_rad_s2 = sampler.log_between(2.0, 60.0);
    let widest = (0.3 * top_rad_s * top_rad_s / steepest_rad_s2).clamp(3e-5, 0.05);
    let travel_rad = sampler.log_between(1e-5, widest);
    let stribeck_rad_s = sampler.log_between(0.01, 0.3) * top_rad_s.min(3.0);
    // Velocity after crossing the presliding travel from rest. Damping adds at most half a level there.
    let crossing_rad_s = (2.0 * steepest_rad_s2 * travel_rad).sqrt();
    let seal = Seal {
        k0: static_nm / travel_rad,
        k1: coulomb_nm / crossing_rad_s * sampler.between(0.0, 0.5),
        k2: coulomb_nm / top_rad_s * sampler.log_between(0.03, 1.0),
        coulomb_nm,
        static_nm,
        stribeck_rad_s,
        per_pressure: 0.0,
        per_force: 0.0,
        eta3: 0.0,
    };
    let drive = Drive { top_rad_s, steepest_rad_s2, stribeck_rad_s, travel_rad, seconds };

    (seal, drive)
}

/// Draws one planned run for each condition.
fn draw_runs(
    sampler: &mut Sampler,
    conditions: Vec<Condition>,
    rate_hz: f64,
    drive: &Drive,
) -> Vec<RunPlan> {
    let few = sampler.chance(0.25);
    let styles: Vec<_> = if few { vec![STYLES[sampler.below(6)]] } else { STYLES.to_vec() };
    let has_gaps = sampler.chance(0.35);
    let jitter = if sampler.chance(0.4) { sampler.between(0.0, 0.15) } else { 0.0 };
    let starts_anywhere = sampler.chance(0.6);
    let seconds = drive.seconds;
    let runs = conditions.into_iter().map(|condition| {
        let style = sampler.pick(&styles).unwrap_or(STYLES[0]);
        let begin_s = if starts_anywhere { sampler.between(0.0, 0.5) * seconds } else { 0.0 };
        let whole = Drive { seconds: seconds + begin_s, ..*drive };
        let motion = draw_motion(sampler, &whole, style);
        let count = ((seconds * rate_hz) as usize).max(50);
        let times: Vec<f64> = (0..count)
            .map(|row| {
                let shift = if jitter > 0.0 { jitter * sampler.between(-0.5, 0.5) } else { 0.0 };
                begin_s + (row as f64 + shift.max(-(row as f64))) / rate_hz
            })
            .collect();
        let lost = if has_gaps { draw_lost_rows(sampler, count) } else { Vec::new() };
        let run = PlannedRun {
            motion,
            start_angle: sampler.between(-TAU, TAU),
            condition,
            times,
            lost,
            held: sampler.between(-0.9, 0.9),
            seed: sampler.seed(),
        };
        RunPlan { run, beside: Beside::default() }
    });

    runs.collect()
}

/// Draws the rigid-body parts of the torque, named as in `--rigid-body`.
fn draw_rigid_body(sampler: &mut Sampler, sensing: &Sensing) -> Vec<&'static str> {
    let mut rigid_body = Vec::new();
    if sampler.chance(0.35) {
        for part in ["inertia", "gravity", "load", "offset"] {
            let needs_angle = part == "gravity" && !sensing.has_position();
            if sampler.chance(0.5) && !needs_angle {
                rigid_body.push(part);
            }
        }
    }

    rigid_body
}

/// Draws the optional columns of the log.
fn draw_columns(sampler: &mut Sampler, rigid_body: &[&'static str]) -> Vec<&'static str> {
    let mut columns: Vec<&'static str> = Vec::new();
    for Covariate { column, .. } in COVARIATES {
        if sampler.chance(0.7) || (column == LOAD_COLUMN && rigid_body.contains(&"load")) {
            columns.push(column);
        }
    }
    if sampler.chance(0.15) {
        columns.push("acceleration_rad_s2");
    }

    columns
}

/// Draws a plant of six to twelve slip elements. Their travels span more than a decade.
fn draw_slip_elements(sampler: &mut Sampler) -> Plant {
    let count = 6 + sampler.below(7);
    let narrowest = sampler.log_between(0.02, 0.3);
    let drawn: Vec<(f64, f64)> = (0..count)
        .map(|at| {
            let along = at as f64 / (count - 1) as f64;
            (sampler.between(0.3, 1.0), narrowest * (2.0 / narrowest).powf(along))
        })
        .collect();
    let all: f64 = drawn.iter().map(|(share, _)| share).sum();
    let element = |(share, travel): (f64, f64)| Element { share: share / all, travel };
    Plant::SlipElements {
        elements: drawn.into_iter().map(element).collect(),
        lag_s: sampler.log_between(5e-4, 2e-2),
    }
}

/// Draws the lost rows of a run: none, or one or two ranges at any place.
fn draw_lost_rows(sampler: &mut Sampler, rows: usize) -> Vec<Range<usize>> {
    if sampler.chance(0.5) {
        return Vec::new();
    }
    (0..1 + sampler.below(2))
        .map(|_| {
            let length = (rows as f64 * sampler.log_between(0.005, 0.1)) as usize + 6;
            let from = sampler.below(rows.saturating_sub(length).max(1));
            from..(from + length).min(rows)
        })
        .collect()
}

/// Draws the extra columns of the log.
fn draw_extras(sampler: &mut Sampler) -> Vec<Extra> {
    let all = [Extra::Humidity, Extra::SupplyVoltage, Extra::CableTension, Extra::LubricantAge];
    all.into_iter().filter(|_| sampler.chance(0.15)).collect()
}

/// Normalised course of each quantity in each run, before it has its range.
struct Courses {
    /// Levels from -1 to 1.
    levels: Vec<Vec<f64>>,
    /// True if the quantity varies within the runs.
    varies: Vec<bool>,
    /// Frequency, Hz, and phase, rad, of the variation.
    waves: Vec<Vec<(f64, f64)>>,
    /// Largest correlation between two quantities that was drawn.
    correlation: f64,
}

impl Courses {
    /// Draws independent courses, and then mixes some levels with those of a leading quantity.
    fn draw(sampler: &mut Sampler, quantities: usize, runs: usize, seconds: f64) -> Self {
        let steps = sampler.chance(0.3).then(|| 2 + sampler.below(5));
        let rounded = |x: f64| match steps {
            Some(steps) => ((x + 1.0) * 0.5 * steps as f64).round() / steps as f64 * 2.0 - 1.0,
            None => x,
        };
        let mut levels: Vec<Vec<f64>> = (0..quantities)
            .map(|_| (0..runs).map(|_| rounded(sampler.between(-1.0, 1.0))).collect())
            .collect();
        // In some campaigns one quantity, mostly the temperature, rises with the order of the runs.
        if sampler.chance(0.3) {
            let which = if sampler.chance(0.6) { TEMPERATURE } else { sampler.below(quantities) };
            let share = sampler.between(0.5, 1.0);
            for (at, level) in levels[which].iter_mut().enumerate() {
                let rise = 2.0 * at as f64 / (runs.max(2) - 1) as f64 - 1.0;
                *level = share * rise + (1.0 - share) * *level;
            }
        }
        let varies: Vec<bool> = (0..quantities).map(|_| sampler.chance(0.6)).collect();
        let mut wave = || (sampler.log_between(0.5 / seconds, 5.0), sampler.between(0.0, TAU));
        let waves = (0..quantities).map(|_| (0..runs).map(|_| wave()).collect()).collect();
        let mut courses = Self { levels, varies, waves, correlation: 0.0 };
        (0..2).for_each(|_| courses.correlate(sampler));
        courses
    }

    /// Lets a quantity follow another in some campaigns.
    fn correlate(&mut self, sampler: &mut Sampler) {
        let Self { levels, waves, .. } = self;
        let quantities = levels.len();
        let (leader, follower) = (sampler.below(quantities), sampler.below(quantities));
        if leader == follower || sampler.chance(0.4) {
            return;
        }
        let correlation = sampler.between(0.3, 0.9);
        self.correlation = self.correlation.max(correlation);
        let independent = (1.0f64 - correlation * correlation).sqrt();
        for run in 0..levels[leader].len() {
            levels[follower][run] =
                correlation * levels[leader][run] + independent * levels[follower][run];
            waves[follower][run] = waves[leader][run];
        }
    }

    /// Draws the signal of a quantity in a run, about a middle and with half of its range.
    fn signal(&self, sampler: &mut Sampler, place: Place, range: HalfRange) -> Signal {
        let Place { quantity, run, seconds } = place;
        let HalfRange { middle, half } = range;
        let (hz, phase) = self.waves[quantity][run];
        let varies = self.varies[quantity];
        let swing = if varies { half * sampler.between(0.02, 0.35) } else { 0.0 };
        let is_slow = quantity == TEMPERATURE || quantity >= COVARIATES.len();
        Signal {
            level: middle + half * self.levels[quantity][run],
            per_s: if varies { half * sampler.between(-0.3, 0.3) / seconds } else { 0.0 },
            swing: if is_slow { 0.1 * swing } else { swing },
            hz: if is_slow { hz.min(0.1) } else { hz },
            phase,
        }
    }
}

/// A quantity in a run of a length.
#[derive(Clone, Copy)]
struct Place {
    quantity: usize,
    run: usize,
    seconds: f64,
}

/// Range of a quantity.
#[derive(Clone, Copy)]
struct HalfRange {
    middle: f64,
    half: f64,
}

/// Draws the covariates of each run.
///
/// Returns them with the largest correlation between two quantities that was drawn.
fn draw_conditions(
    sampler: &mut Sampler,
    runs: usize,
    seconds: f64,
    coulomb_nm: f64,
    extras: &[Extra],
) -> (Vec<Condition>, f64) {
    let courses = Courses::draw(sampler, COVARIATES.len() + extras.len(), runs, seconds);
    let pause_s = sampler.log_between(1.0, 600.0);
    let load_nm = coulomb_nm * sampler.log_between(0.3, 10.0);
    let mut start_s = 0.0;
    let conditions = (0..runs).map(|run| {
        let mut signal =
            |quantity, range| courses.signal(sampler, Place { quantity, run, seconds }, range);
        let [force, pressure, temperature, load] = std::array::from_fn(|quantity| {
            let Covariate { column, range } = COVARIATES[quantity];
            let half = if column == LOAD_COLUMN { load_nm } else { range.half };
            signal(quantity, HalfRange { half, ..range })
        });
        let extras = extras.iter().enumerate().map(|(place, &extra)| {
            let (least, most) = extra.range();
            let range = HalfRange { middle: 0.5 * (least + most), half: 0.5 * (most - least) };
            (extra, signal(COVARIATES.len() + place, range))
        });
        let extras = extras.collect();
        let condition = Condition { start_s, force, pressure, temperature, load, extras };
        start_s += 1.5 * seconds + pause_s;
        condition
    });
    (conditions.collect(), courses.correlation)
}
