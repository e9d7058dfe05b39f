//! A joint in service: drawn constants, habits, and the set of its first campaign.

use crate::GradeError;
use crate::drive::{Aid, Commissioned, Drive, PRESSURE_MAX_PA, TunedSet};
use crate::motion::{Habits, Motion};
use crate::plant::{Measured, PERIOD_S, Plant, Purpose, World, course_sampler};
use compensator_core::adaptation::Gains;
use compensator_core::model::ModelState;
use compensator_core::{LawKind, Parameters, Sample, TermKind};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Rows, Track, identify};
use simulated_machines::joint_plant::{DrawnJoint, FrictionFamily, Parameters as Constants};
use std::f64::consts::TAU;

/// Periods of the loop per row of a recording.
const ROW_PERIODS: usize = 4;
/// Differences of the seeds of a joint and of its campaigns: to identify a set, and to fit the true level.
const IDENTIFICATION: u64 = 0xca4;
const TRUE_LEVEL: u64 = 0x1e7e1;

/// A drawn joint.
#[derive(Clone, Debug)]
pub struct Joint {
    /// Seed of the draw.
    pub seed: u64,
    /// Family of its friction.
    pub family: FrictionFamily,
    /// Constants of its plant.
    pub constants: Constants,
    phase_rad: [f64; 2],
    /// What its builder has set.
    pub commissioned: Commissioned,
    /// Habits of its motion.
    pub habits: Habits,
}

impl Joint {
    /// Draws a joint. The temperature acts only if a drift needs it.
    ///
    /// # Errors
    /// Returns an error if no joint can be drawn.
    pub fn draw(seed: u64) -> Result<Self, GradeError> {
        let DrawnJoint { family, constants, phase_rad, .. } = DrawnJoint::draw(seed, &[], None)?;
        let mut random = course_sampler(seed, Purpose::Joint);
        let plant = Plant::new(family, &constants, phase_rad, false, seed);
        // Inertia in torques that the driver knows.
        let inertia = plant.inertia_kg_m2() / plant.torque_gain();
        let commissioned = Commissioned {
            inertia_kg_m2: inertia * random.between(0.95, 1.05),
            velocity_gain_factor: random.between(0.7, 1.3),
            position_gain_factor: random.between(0.7, 1.3),
        };
        let habits = Habits::draw(&mut random);
        Ok(Self { seed, family, constants, phase_rad, commissioned, habits })
    }

    /// Returns the sliding level at the start, gear included, Nm.
    pub fn level_nm(&self) -> f64 {
        let p = &self.constants;
        let area_m2 = TAU * p.shaft_radius_m * p.seal_width_m;
        p.friction_kinetic * p.seal_preload_pa * area_m2 * p.shaft_radius_m + p.gear_no_load_nm
    }

    /// Returns the plant at its start.
    pub fn plant(&self, has_coupling: bool) -> Plant {
        Plant::new(self.family, &self.constants, self.phase_rad, has_coupling, self.seed)
    }

    /// Returns the surroundings at the start.
    pub fn world(&self) -> World {
        World::calm(self.constants.water_temperature_c)
    }

    /// Returns a run with this aid from the start, in everyday motion.
    pub fn start(&self, aid: Aid, seed: u64, has_coupling: bool) -> Run {
        let drive = Drive::new(self.commissioned, aid, 0.0);
        Run::new(self.plant(has_coupling), drive, Motion::everyday(self.habits, seed, 0.0))
    }

    /// Returns a campaign on the plant. It takes the planned time of its motion.
    fn campaign(&self, plant: &Plant, seed: u64) -> Run {
        let mut plant = plant.clone();
        plant.reseed(seed);
        let motion = Motion::identification(plant.position_rad());
        let drive = Drive::new(self.commissioned, Aid::Off, plant.position_rad());
        Run::new(plant, drive, motion)
    }

    /// Identifies a set by a campaign on the plant in these surroundings.
    ///
    /// # Errors
    /// Returns an error if the fit fails.
    pub fn identify(
        &self,
        plant: &Plant,
        world: &World,
        start: Option<&TunedSet>,
    ) -> Result<TunedSet, GradeError> {
        let track = recorded(self.campaign(plant, self.seed ^ IDENTIFICATION), world);
        let rigid_body = [TermKind::UnmodelledInertia, TermKind::TorqueOffset];
        let spec = Spec::law(LawKind::Lugre).on(&rigid_body);
        let base = spec.parameters()?;
        let options = FitOptions {
            passive: true,
            starts: 1,
            stagnation: 3e-4,
            start: start.map(|set| {
                let mut from = base.clone();
                set.model.active().for_each(|id| from.set(id, f64::from(set.model.get(id))));
                from
            }),
            ..FitOptions::default()
        };
        let tracks = [track];
        let rows = Rows { tracks: &tracks, decimate: 1 };
        let found = identify(&spec, &base, rows, rows, &options).for_driver();
        let mut model: Parameters<f32> = found.parameters.convert();
        model.terms.retain(|term| !rigid_body.contains(term));
        model.envelope.pressure_diff_max_pa = PRESSURE_MAX_PA;
        model.validate()?;
        Ok(TunedSet { model, noise_nm: found.train.rmse as f32 })
    }
}

/// Records a campaign: means of some periods per row.
fn recorded(mut run: Run, world: &World) -> Track {
    let rows = (run.motion.planned_s() / PERIOD_S) as usize / ROW_PERIODS;
    let (mut samples, mut torques) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
    for _ in 0..rows {
        let (mut sample, mut torque_nm) = (Sample::<f64>::default(), 0.0);
        for _ in 0..ROW_PERIODS {
            let measured = run.period(world, |measured| measured);
            let share = 1.0 / ROW_PERIODS as f64;
            sample.velocity_rad_s += share * run.drive.encoder.velocity_rad_s;
            sample.acceleration_rad_s2 += share * run.drive.encoder.acceleration_rad_s2;
            sample.position_rad = run.drive.encoder.position_rad;
            torque_nm += share * run.drive.friction_nm(&measured);
        }
        samples.push(sample);
        torques.push(torque_nm);
    }
    Track::even(samples, torques, PERIOD_S * ROW_PERIODS as f64)
}

/// A joint in motion.
#[derive(Clone, Debug)]
pub struct Run {
    /// The joint.
    pub plant: Plant,
    /// Its driver.
    pub drive: Drive,
    /// Its motion.
    pub motion: Motion,
    /// Time since the start, s.
    pub time_s: f64,
    torque_nm: f64,
    sum_rad2: f64,
    scored: u64,
    /// Time of sliding, s.
    pub sliding_s: f64,
}

/// Speed from which a joint counts as sliding, rad/s.
pub const SLIDING_RAD_S: f64 = 0.05;

impl Run {
    /// Creates a run at its start.
    fn new(plant: Plant, drive: Drive, motion: Motion) -> Self {
        let (time_s, torque_nm, sum_rad2, sliding_s) = (0.0, 0.0, 0.0, 0.0);
        Self { plant, drive, motion, time_s, torque_nm, sum_rad2, scored: 0, sliding_s }
    }

    /// Advances by a period. `lie` changes the measurements.
    pub fn period(&mut self, world: &World, lie: impl FnOnce(Measured) -> Measured) -> Measured {
        let measured = lie(self.plant.step(world, self.torque_nm));
        let demand = self.motion.step(PERIOD_S);
        self.torque_nm = self.drive.step(&measured, &demand);
        let error_rad = demand.position_rad - self.plant.position_rad();
        self.sum_rad2 += error_rad * error_rad;
        self.scored += 1;
        self.time_s += PERIOD_S;
        if self.plant.velocity_rad_s().abs() > SLIDING_RAD_S {
            self.sliding_s += PERIOD_S;
        }
        measured
    }

    /// Advances until a time, s.
    pub fn advance_until(&mut self, time_s: f64, world: &impl Fn(f64) -> World) {
        while self.time_s < time_s {
            let now = world(self.time_s);
            self.period(&now, |measured| measured);
        }
    }

    /// Returns the RMS tracking error since the last call, rad, by the true position.
    pub fn take_rms(&mut self) -> f64 {
        let rms = (self.sum_rad2 / self.scored.max(1) as f64).sqrt();
        (self.sum_rad2, self.scored) = (0.0, 0);
        rms
    }

    /// Returns the commanded torque, Nm.
    pub fn torque_nm(&self) -> f64 {
        self.torque_nm
    }

    /// Returns a run from the present state with another aid.
    #[must_use]
    pub fn with(&self, aid: Aid) -> Self {
        let mut run = self.clone();
        run.drive.aid = aid;
        run
    }
}

/// The true motion and friction of a period.
struct TrueRow {
    velocity_rad_s: f32,
    /// In torques that the driver knows, Nm.
    friction_nm: f32,
}

/// Returns the gain on the levels of a set that fits a new campaign on the plant best.
///
/// All samples count, those at rest and at reversals too: the dynamic model with the set's structure and viscous coefficient
/// is stepped along the true motion, and compared with the true friction. A constant torque is fitted too.
pub fn true_level(joint: &Joint, plant: &Plant, set: &TunedSet, world: &World) -> f64 {
    let mut run = joint.campaign(plant, joint.seed ^ TRUE_LEVEL);
    let periods = (run.motion.planned_s() / PERIOD_S) as usize;
    let known = run.plant.torque_gain();
    let rows: Vec<TrueRow> = (0..periods)
        .map(|_| {
            run.period(world, |measured| measured);
            TrueRow {
                velocity_rad_s: run.plant.velocity_rad_s() as f32,
                friction_nm: (run.plant.friction_nm() / known) as f32,
            }
        })
        .collect();
    let (mut level, step) = (1.0, 0.02);
    for _ in 0..4 {
        let (present, changed) = (stepped(set, level, &rows), stepped(set, level + step, &rows));
        // Sums of 1, slope, slope^2, error, and slope times error.
        let mut sums = [0.0; 5];
        for ((row, present), changed) in rows.iter().zip(present).zip(changed) {
            let slope = (changed - present) / step;
            let error = f64::from(row.friction_nm) - present;
            let terms = [1.0, slope, slope * slope, error, slope * error];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let [count, slope, square, error, product] = sums;
        let change = (product - slope * error / count) / (square - slope * slope / count);
        level = (level + change).clamp(0.1, 8.0);
    }
    level
}

/// Returns the friction of a set with this gain on its levels along the true motion, Nm.
fn stepped(set: &TunedSet, level: f64, rows: &[TrueRow]) -> Vec<f64> {
    let gains = Gains { level: level as f32, ..Gains::default() };
    let base = set.model.build_unchecked::<f32>(PERIOD_S as f32);
    let mut model = base.clone();
    model.set_gains(&base, &gains);
    let mut state = ModelState::default();
    let friction = |row: &TrueRow| {
        let sample = Sample { velocity_rad_s: row.velocity_rad_s, ..Sample::default() };
        f64::from(model.step(&mut state, &sample))
    };
    rows.iter().map(friction).collect()
}
