//! How the friction of a joint drifts, and the grade of each arm at several moments of it.

use crate::GradeError;
use crate::drive::{Aid, TunedSet};
use crate::joint::{Joint, Run, true_level};
use crate::plant::{Purpose, World, course_sampler};
use compensator_core::adaptation::Gains;
use std::f64::consts::TAU;

/// Time of a moment that is graded, s, and the time before it in which each arm settles.
const SCORED_S: f64 = 60.0;
const LEAD_S: f64 = 5.0;

/// Duration of a drift, s.
const DRIFT_S: f64 = 1200.0;

/// A drift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drift {
    /// The friction doubles over 20 minutes.
    Doubles,
    /// The temperature swings by 15 K to each side in 20 minutes, without a thermometer.
    Temperature,
    /// A dive to 30 bar and back, without a pressure sensor.
    Pressure,
    /// A new seal after a stop.
    NewSeal,
}

impl Drift {
    /// Every drift.
    pub const ALL: [Self; 4] = [Self::Doubles, Self::Temperature, Self::Pressure, Self::NewSeal];

    /// Returns the name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Doubles => "friction doubles",
            Self::Temperature => "temperature",
            Self::Pressure => "pressure",
            Self::NewSeal => "new seal",
        }
    }

    /// Returns the times of the moments, s. That of a new seal is given by the sliding of the joint.
    fn moments(self) -> &'static [f64] {
        match self {
            Self::Doubles => &[400.0, 800.0, 1130.0],
            Self::Temperature => &[270.0, 570.0, 870.0],
            Self::Pressure => &[240.0, 570.0, 930.0],
            Self::NewSeal => &[],
        }
    }

    /// Returns the joint with the constants that the drift needs.
    fn prepare(self, joint: &mut Joint) {
        let mut random = course_sampler(joint.seed, Purpose::Drift);
        let constants = &mut joint.constants;
        match self {
            Self::Temperature => {
                constants.level_per_kelvin = random.between(0.002, 0.01);
                constants.film_per_kelvin = random.between(0.01, 0.04);
            }
            Self::Pressure => constants.pressure_share = random.between(0.2, 0.7),
            Self::Doubles | Self::NewSeal => {}
        }
    }

    /// Returns the surroundings at a time, s.
    fn world(self, joint: &Joint, time_s: f64) -> World {
        let mut world = joint.world();
        let share = (time_s / DRIFT_S).clamp(0.0, 1.0);
        match self {
            Self::Doubles => {
                // The gear's share of the friction does not wear.
                let gear = joint.constants.gear_no_load_nm / joint.level_nm();
                world.wear = 1.0 + share / (1.0 - gear);
            }
            Self::Temperature => world.water_c += 15.0 * (TAU * share).sin(),
            Self::Pressure => {
                let descent = (time_s / 480.0).min((DRIFT_S - time_s) / 480.0);
                world.pressure_pa = 3e6 * descent.clamp(0.0, 1.0);
            }
            Self::NewSeal => {}
        }
        world
    }
}

/// What a row of the table compares: places of [`MomentGrade::rms_rad`].
pub const ARMS: [&str; 5] = ["off", "fixed", "adaptive", "tuned anew", "observer"];
/// Nothing acts against friction.
pub const OFF: usize = 0;
/// The set of the first campaign.
pub const FIXED: usize = 1;
/// The adaptation.
pub const ADAPTIVE: usize = 2;
/// A set of a campaign at the moment.
pub const ANEW: usize = 3;
/// The disturbance observer.
pub const OBSERVER: usize = 4;

/// RMS tracking errors at a moment of a drift.
#[derive(Clone, Debug)]
pub struct MomentGrade {
    /// Seed of the joint.
    pub seed: u64,
    /// Family of its friction.
    pub family: &'static str,
    /// The drift.
    pub drift: Drift,
    /// Time, s.
    pub time_s: f64,
    /// RMS errors of the arms, rad.
    pub rms_rad: [f64; ARMS.len()],
    /// Learnt gains.
    pub learnt: Gains<f32>,
    /// Gain on the levels that fits the joint at this moment.
    pub true_level: f64,
}

/// Grades a joint in a drift.
///
/// # Errors
/// Returns an error if a set cannot be identified.
pub fn grade_drift(seed: u64, drift: Drift) -> Result<Vec<MomentGrade>, GradeError> {
    let mut joint = Joint::draw(seed)?;
    drift.prepare(&mut joint);
    let set = joint.identify(&joint.plant(false), &joint.world(), None)?;
    let mut run = joint.start(Aid::adaptive(&set)?, seed, false);
    if drift == Drift::NewSeal {
        return new_seal(&joint, &set, run).map(|grade| vec![grade]);
    }
    let world = |time_s: f64| drift.world(&joint, time_s);
    let mut grades = Vec::new();
    for moment_s in drift.moments() {
        run.advance_until(*moment_s, &world);
        grades.push(moment(&joint, &set, &run, drift, &world)?);
    }
    Ok(grades)
}

/// Grades a joint with a new seal, after a minute of sliding.
fn new_seal(joint: &Joint, set: &TunedSet, mut run: Run) -> Result<MomentGrade, GradeError> {
    let mut random = course_sampler(joint.seed, Purpose::Seal);
    let before = joint.world();
    run.advance_until(random.between(120.0, 300.0), &|_| before);
    run.motion.set_stopped(true);
    run.advance_until(run.time_s + 10.0, &|_| before);
    let wear = if random.chance(0.5) { 1.6 } else { 0.65 };
    let world = World { wear, ..before };
    run.advance_until(run.time_s + 10.0, &|_| world);
    run.motion.set_stopped(false);
    let slid_s = run.sliding_s;
    while run.sliding_s < slid_s + 60.0 && run.time_s < 3600.0 {
        run.period(&world, |measured| measured);
    }
    moment(joint, set, &run, Drift::NewSeal, &|_| world)
}

/// Grades every arm from the state of a run on.
fn moment(
    joint: &Joint,
    set: &TunedSet,
    run: &Run,
    drift: Drift,
    world: &impl Fn(f64) -> World,
) -> Result<MomentGrade, GradeError> {
    let frozen = world(run.time_s + LEAD_S + 0.5 * SCORED_S);
    let anew = joint.identify(&run.plant, &frozen, Some(set))?;
    let runs = [
        run.with(Aid::Off),
        run.with(Aid::fixed(set)?),
        run.clone(),
        run.with(Aid::fixed(&anew)?),
        run.with(Aid::Observer(0.0)),
    ];
    let mut learnt = Gains::default();
    let true_level = true_level(joint, &run.plant, set, &frozen);
    let mut rms_rad = [0.0; ARMS.len()];
    for (rms, mut run) in rms_rad.iter_mut().zip(runs) {
        run.advance_until(run.time_s + LEAD_S, world);
        run.take_rms();
        run.advance_until(run.time_s + SCORED_S, world);
        *rms = run.take_rms();
        if matches!(run.drive.aid, Aid::Adaptive(_)) {
            learnt = run.drive.gains();
        }
    }
    let (seed, family, time_s) = (joint.seed, joint.family.name(), run.time_s);
    Ok(MomentGrade { seed, family, drift, time_s, rms_rad, learnt, true_level })
}

/// Grade of a joint that does not change.
#[derive(Clone, Debug)]
pub struct SteadyGrade {
    /// Seed of the joint.
    pub seed: u64,
    /// Family of its friction.
    pub family: &'static str,
    /// Largest relative difference of the learnt level and the true one after each part of the course.
    pub level_error: f64,
    /// Largest RMS error of a part relative to that of the tuned set.
    pub worst_ratio: f64,
    /// RMS error over the course relative to that of the tuned set.
    pub ratio: f64,
    /// Learnt gains at the end.
    pub learnt: Gains<f32>,
    /// Gain on the levels that fits the joint.
    pub true_level: f64,
}

/// Duration of a part of the steady course, s.
const PART_S: f64 = 600.0;

/// Grades a joint that does not change, over some parts of ten minutes.
///
/// # Errors
/// As [`grade_drift`].
pub fn grade_steady(seed: u64, parts: usize) -> Result<SteadyGrade, GradeError> {
    let joint = Joint::draw(seed)?;
    let set = joint.identify(&joint.plant(false), &joint.world(), None)?;
    let calm = joint.world();
    let mut runs =
        [Aid::adaptive(&set)?, Aid::fixed(&set)?].map(|aid| joint.start(aid, seed, false));
    let true_level = true_level(&joint, &runs[1].plant, &set, &calm);
    let (mut level_error, mut worst_ratio) = (0.0f64, 0.0f64);
    let mut sums = [0.0; 2];
    for part in 1..=parts {
        let mut rms = [0.0; 2];
        for (rms, run) in rms.iter_mut().zip(&mut runs) {
            run.advance_until(part as f64 * PART_S, &|_| calm);
            *rms = run.take_rms();
        }
        worst_ratio = worst_ratio.max(rms[0] / rms[1]);
        (sums[0], sums[1]) = (sums[0] + rms[0] * rms[0], sums[1] + rms[1] * rms[1]);
        let level = f64::from(runs[0].drive.gains().level);
        level_error = level_error.max((level / true_level - 1.0).abs());
    }
    let learnt = runs[0].drive.gains();
    let ratio = (sums[0] / sums[1]).sqrt();
    let family = joint.family.name();
    Ok(SteadyGrade { seed, family, level_error, worst_ratio, ratio, learnt, true_level })
}
