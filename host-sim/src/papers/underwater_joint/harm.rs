//! What a wrong model or a failing sensor does: a map, against no compensation under the same circumstances.
//!
//! Each circumstance is met in the three pool tests (does tracking get worse?) and holding 2 kg (does the joint swing?).
//! Demanded: no sustained limit cycle, current within its limit, tracking never more than 5 % worse than without
//! compensation. And what the driver itself says of it: its watch compares the torque with the model while the joint slides,
//! and a model that gives back more friction than there is shows there before it does harm.

use super::arms::{Arm, PERFECT, SHARE};
use super::measures::{hold_swing_rad, position_rmse_rad, velocity_rmse_rad_s};
use super::tasks::{Conditions, Course, Task, run};
use crate::joint_rig::{Faults, SealSensor};
use compensator_core::ParameterId as Id;
use rayon::prelude::*;
use simulated_machines::joint_plant::bench::BRAKE_NM;

/// The pool tests of the map, in its columns' order.
pub const TASKS: [Task; 3] = [Task::LowSpeed, Task::VelocityTracking, Task::Impact];

/// Tracking may be worse by this share.
pub const WORSE: f64 = 1.05;

/// A joint that is held and swings by more, rad from end to end in the last second, is in a limit cycle: half a degree. The
/// plant's encoder resolves 7.5e-6 rad.
pub const SWINGS_RAD: f64 = 0.0087;

/// The joint's current limit, A, with a count of the converter's noise.
const MOST_A: f64 = 26.0 + 0.5;

/// What is changed in a model for the map, up and down.
const CHANGED: f32 = 0.3;

/// How far both friction levels are off together: too little given back, and, above 1, too much.
const LEVELS: [f32; 4] = [1.0 - CHANGED, 1.1, 1.2, 1.0 + CHANGED];

/// Name of the map's first line: the model as it is.
pub const AS_IDENTIFIED: &str = "as identified";

/// One circumstance.
#[derive(Clone, Debug)]
pub struct Circumstance {
    /// In words.
    pub name: String,
    /// The model has more friction than the seal at every speed.
    pub over_compensates: bool,
    /// The compensated joint's velocity error over the uncompensated one's, same circumstances, of each of [`TASKS`];
    /// none where the driver refused the parameters.
    pub worse: Option<[f64; TASKS.len()]>,
    /// The same of the jump's position error: what its loop holds. The velocity it is asked for cannot be followed, as the
    /// current is at its limit; what is late is caught up, which counts as an error of velocity.
    pub jump_position_worse: Option<f64>,
    /// Swing while holding, rad from end to end.
    pub swing_rad: f64,
    /// The same without compensation.
    pub swing_without_rad: f64,
    /// Largest current, A.
    pub largest_a: f64,
    /// The driver stopped by itself.
    pub stopped: bool,
    /// When the driver said "model out of band" while it followed the sine, s from its start.
    pub told_s: Option<f64>,
}

impl Circumstance {
    /// Whether what is demanded holds. A joint that swings without compensation, too, is not made to by it.
    pub fn harmless(&self) -> bool {
        let swings = self.swing_rad > SWINGS_RAD && self.swing_rad > WORSE * self.swing_without_rad;
        self.follows() && !swings && self.largest_a <= MOST_A
    }

    /// Whether it follows in every task as well as without compensation, or nearly.
    pub fn follows(&self) -> bool {
        self.worse.is_none_or(|worse| worse.iter().all(|worse| *worse <= WORSE))
    }
}

/// An arm under circumstances, before it is met.
struct Case {
    name: String,
    arm: Arm,
    conditions: Conditions,
    over_compensates: bool,
}

/// The map of an arm. Its second line is the perfect model's: what is worse there, too, is so by less friction; what is not,
/// by a wrong model.
pub fn map(arm: &Arm, none: &Arm, perfect: &Arm, joint: &Conditions) -> Vec<Circumstance> {
    let mut cases = Vec::new();
    let mut add = |name: String, arm: Arm, conditions: Conditions| {
        cases.push(Case { name, arm, conditions, over_compensates: false });
    };
    add(AS_IDENTIFIED.into(), arm.clone(), *joint);
    add(PERFECT.into(), perfect.clone(), *joint);
    for id in arm.set.friction.model.active() {
        let value = arm.set.friction.model.get(id);
        if value == 0.0 || matches!(id, Id::TemperatureReference | Id::RippleOrder) {
            continue;
        }
        for factor in [1.0 - CHANGED, 1.0 + CHANGED] {
            let mut changed = arm.clone();
            changed.set.friction.model.set(id, value * factor);
            let sign = if factor > 1.0 { '+' } else { '−' };
            add(format!("{} {sign}30 %", id.info().name), changed, *joint);
        }
    }
    // What a driver believes of a load: no more than the bench had on its brake.
    let mut narrow = arm.clone();
    narrow.set.friction.model.envelope.load_torque_max_nm = BRAKE_NM as f32;
    add(format!("load torque believed to the bench's {BRAKE_NM} Nm"), narrow, *joint);
    let mut full = arm.clone();
    full.set.friction.compensator.scale = 1.0;
    add(format!("share 1 in place of {SHARE}"), full, *joint);
    for (name, seal) in [
        ("side load and pressure stale", SealSensor::Stale),
        ("side load and pressure stuck", SealSensor::Stuck),
        ("side load and pressure: half the frames lost", SealSensor::Dropped),
        ("side load and pressure absent", SealSensor::Absent),
    ] {
        let faults = Faults::seal_sensor(seal);
        add(name.to_owned(), arm.clone(), Conditions { faults, ..*joint });
    }
    for delay_ms in 1..=3 {
        let faults = Faults { delay_ms, ..Faults::default() };
        add(format!("frames {delay_ms} ms late"), arm.clone(), Conditions { faults, ..*joint });
    }
    let faults = Faults { encoder_lost: 0.05, ..Faults::default() };
    add("5 % of encoder readings lost".into(), arm.clone(), Conditions { faults, ..*joint });
    let mut noisy = *joint;
    noisy.parameters.current_noise_a *= 4.0;
    noisy.parameters.force_noise_n *= 4.0;
    noisy.parameters.pressure_noise_pa *= 4.0;
    add("noise x4".into(), arm.clone(), noisy);
    for factor in [0.3, 0.5, 2.0, 3.0] {
        let mut other = *joint;
        other.parameters.presliding_stiffness_nm_per_rad *= factor;
        other.parameters.gear_stiffness_nm_per_rad *= factor;
        add(format!("plant's stiffness x{factor}"), arm.clone(), other);
    }
    for factor in LEVELS {
        let mut changed = arm.clone();
        let model = &mut changed.set.friction.model;
        for id in [Id::CoulombTorque, Id::StaticTorque] {
            model.set(id, model.get(id) * factor);
        }
        let sign = if factor > 1.0 { '+' } else { '−' };
        let percent = (100.0 * (factor - 1.0).abs()).round();
        let name = format!("both levels {sign}{percent} %");
        let over_compensates = factor > 1.0;
        cases.push(Case { name, arm: changed, conditions: *joint, over_compensates });
    }
    // Most circumstances are of the model alone, and the joint without one is the same in all of them.
    let same = Without::meet(none, joint);
    cases.into_par_iter().map(|case| meet(case, none, joint, same.as_ref())).collect()
}

/// What the joint does without compensation.
#[derive(Clone, Copy)]
struct Without {
    errors: [f64; TASKS.len()],
    jump_rad: f64,
    swing_rad: f64,
}

impl Without {
    fn meet(none: &Arm, conditions: &Conditions) -> Option<Self> {
        let [lifts, tracks, jumps] = TASKS.map(|task| run(task, none, conditions).ok());
        let jumps = jumps?;
        let swing_rad = hold_swing_rad(&run(Task::Hold, none, conditions).ok()?);
        let errors = [&lifts?, &tracks?, &jumps].map(velocity_rmse_rad_s);
        Some(Self { errors, jump_rad: position_rmse_rad(&jumps), swing_rad })
    }
}

fn meet(case: Case, none: &Arm, joint: &Conditions, same: Option<&Without>) -> Circumstance {
    let Case { name, arm, conditions, over_compensates } = case;
    let refused = Circumstance {
        name,
        over_compensates,
        worse: None,
        jump_position_worse: None,
        swing_rad: 0.0,
        swing_without_rad: 0.0,
        largest_a: 0.0,
        stopped: false,
        told_s: None,
    };
    let courses = || -> Option<[Course; TASKS.len() + 1]> {
        let of = |task| run(task, &arm, &conditions).ok();
        let [lifts, tracks, jumps] = TASKS.map(of);
        Some([lifts?, tracks?, jumps?, of(Task::Hold)?])
    };
    let own;
    let without = if conditions == *joint {
        same
    } else {
        own = Without::meet(none, &conditions);
        own.as_ref()
    };
    let (Some(courses), Some(without)) = (courses(), without) else { return refused };
    let largest =
        |course: &Course| course.current_a.iter().fold(0.0f64, |most, a| most.max(a.abs()));
    let [lifts, tracks, jumps, holds] = &courses;
    let errors = [lifts, tracks, jumps].map(velocity_rmse_rad_s);
    Circumstance {
        worse: Some(std::array::from_fn(|at| errors[at] / without.errors[at])),
        jump_position_worse: Some(position_rmse_rad(jumps) / without.jump_rad),
        swing_rad: hold_swing_rad(holds),
        swing_without_rad: without.swing_rad,
        largest_a: courses.iter().map(largest).fold(0.0, f64::max),
        stopped: courses.iter().any(|course| course.stopped),
        told_s: tracks.out_of_band_s,
        ..refused
    }
}

/// The watch over a campaign in which the seal wears by a percent a day, and over days on which it does not.
///
/// A year is shortened to its days: each is one task of 25 s under conditions of its own (temperature, noise), whatever
/// the joint would slide on that day. What the model gets wrong differs from day to day and is in these 25 s; noise alone is not,
/// and for that the watch is laid out by itself: once in `false_alarm_h` hours of sliding.
#[derive(Clone, Copy, Debug)]
pub struct Wear {
    /// The first day on which the driver said "model out of band", of those looked at; none until the last.
    pub flagged_day: Option<u32>,
    /// The last day that was looked at.
    pub last_day: u32,
    /// Days without wear that were looked at, and on how many of them it said so: false alarms.
    pub sound_days: u64,
    /// See `sound_days`.
    pub false_alarms: usize,
}

/// Lets the seal wear: the velocity task of 25 s on every so many days, and on sound days beside them.
pub fn wear(arm: &Arm, joint: &Conditions, every: u32, sound_days: u64) -> Result<Wear, String> {
    const LAST_DAY: u32 = 60;
    let days: Vec<u32> = (0..=LAST_DAY).step_by(every.max(1) as usize).collect();
    let out = |conditions: &Conditions| {
        run(Task::VelocityTracking, arm, conditions).map(|course| course.out_of_band_s.is_some())
    };
    let worn = days.par_iter().map(|day| {
        let own = super::experiments::day(joint, joint.seed.wrapping_add(u64::from(*day)));
        out(&Conditions { wear: 1.0 + 0.01 * f64::from(*day), ..own })
    });
    let worn: Vec<bool> = worn.collect::<Result<_, String>>()?;
    let sound: Vec<u64> = (0..sound_days).collect();
    let sound = sound
        .par_iter()
        .map(|day| out(&super::experiments::day(joint, joint.seed.wrapping_add(500 + day))));
    let sound: Vec<bool> = sound.collect::<Result<_, String>>()?;
    Ok(Wear {
        flagged_day: days.iter().zip(&worn).find(|(_, out)| **out).map(|(day, _)| *day),
        last_day: LAST_DAY,
        sound_days,
        false_alarms: sound.iter().filter(|out| **out).count(),
    })
}
