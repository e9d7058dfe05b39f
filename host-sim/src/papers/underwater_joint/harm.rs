//! What a wrong model or a failing sensor does: a map, against no compensation under the same circumstances.
//!
//! Each circumstance is met lifting 2 kg (does tracking get worse?) and holding it (does the joint swing?). Demanded: no
//! sustained limit cycle, current within its limit, tracking never more than 5 % worse than without compensation.

use super::arms::{Arm, SHARE};
use super::measures::{hold_swing_rad, velocity_rmse_rad_s};
use super::tasks::{Conditions, Course, Task, run};
use crate::joint_rig::{Faults, SealSensor};
use compensator_core::ParameterId as Id;
use rayon::prelude::*;

/// Tracking may be worse by this share.
pub const WORSE: f64 = 1.05;

/// A joint that is held and swings by more, rad from end to end in the last second, is in a limit cycle: half a degree. The
/// plant's encoder resolves 7.5e-6 rad.
pub const SWINGS_RAD: f64 = 0.0087;

/// The joint's current limit, A, with a count of the converter's noise.
const MOST_A: f64 = 26.0 + 0.5;

/// What is changed in a model for the map, up and down.
const CHANGED: f32 = 0.3;

/// One circumstance.
#[derive(Clone, Debug)]
pub struct Circumstance {
    /// In words.
    pub name: String,
    /// The compensated joint's error over the uncompensated one's, same circumstances; none where the driver refused
    /// the parameters.
    pub worse: Option<f64>,
    /// Swing while holding, rad from end to end.
    pub swing_rad: f64,
    /// The same without compensation.
    pub swing_without_rad: f64,
    /// Largest current, A.
    pub largest_a: f64,
    /// The driver stopped by itself.
    pub stopped: bool,
}

impl Circumstance {
    /// Whether what is demanded holds. A joint that swings without compensation, too, is not made to by it.
    pub fn harmless(&self) -> bool {
        let swings = self.swing_rad > SWINGS_RAD && self.swing_rad > WORSE * self.swing_without_rad;
        self.worse.is_none_or(|worse| worse <= WORSE) && !swings && self.largest_a <= MOST_A
    }
}

/// The map of an arm.
pub fn map(arm: &Arm, none: &Arm, joint: &Conditions) -> Vec<Circumstance> {
    let mut cases = vec![("as identified".to_owned(), arm.clone(), *joint)];
    for id in arm.set.friction.model.active() {
        let value = arm.set.friction.model.get(id);
        if value == 0.0 || matches!(id, Id::TemperatureReference | Id::RippleOrder) {
            continue;
        }
        for factor in [1.0 - CHANGED, 1.0 + CHANGED] {
            let mut changed = arm.clone();
            changed.set.friction.model.set(id, value * factor);
            let sign = if factor > 1.0 { '+' } else { '−' };
            cases.push((format!("{} {sign}30 %", id.info().name), changed, *joint));
        }
    }
    // Both levels: too much friction given back, and too little.
    for factor in [1.0 - CHANGED, 1.0 + CHANGED] {
        let mut changed = arm.clone();
        let model = &mut changed.set.friction.model;
        for id in [Id::CoulombTorque, Id::StaticTorque] {
            model.set(id, model.get(id) * factor);
        }
        let sign = if factor > 1.0 { '+' } else { '−' };
        cases.push((format!("both levels {sign}30 %"), changed, *joint));
    }
    let mut full = arm.clone();
    full.set.friction.compensator.scale = 1.0;
    cases.push((format!("share 1 in place of {SHARE}"), full, *joint));
    for (name, seal) in [
        ("side load and pressure stale", SealSensor::Stale),
        ("side load and pressure stuck", SealSensor::Stuck),
        ("side load and pressure: half the frames lost", SealSensor::Dropped),
        ("side load and pressure absent", SealSensor::Absent),
    ] {
        let faults = Faults::seal_sensor(seal);
        cases.push((name.to_owned(), arm.clone(), Conditions { faults, ..*joint }));
    }
    for delay_ms in 1..=3 {
        let faults = Faults { delay_ms, ..Faults::default() };
        cases.push((
            format!("frames {delay_ms} ms late"),
            arm.clone(),
            Conditions { faults, ..*joint },
        ));
    }
    let faults = Faults { encoder_lost: 0.05, ..Faults::default() };
    cases.push((
        "5 % of encoder readings lost".into(),
        arm.clone(),
        Conditions { faults, ..*joint },
    ));
    let mut noisy = *joint;
    noisy.parameters.current_noise_a *= 4.0;
    noisy.parameters.force_noise_n *= 4.0;
    noisy.parameters.pressure_noise_pa *= 4.0;
    cases.push(("noise x4".into(), arm.clone(), noisy));
    for factor in [0.3, 0.5, 2.0, 3.0] {
        let mut other = *joint;
        other.parameters.presliding_stiffness_nm_per_rad *= factor;
        other.parameters.gear_stiffness_nm_per_rad *= factor;
        cases.push((format!("plant's stiffness x{factor}"), arm.clone(), other));
    }
    cases
        .into_par_iter()
        .map(|(name, arm, conditions)| meet(name, &arm, none, &conditions))
        .collect()
}

fn meet(name: String, arm: &Arm, none: &Arm, conditions: &Conditions) -> Circumstance {
    let both = |task| Some((run(task, arm, conditions).ok()?, run(task, none, conditions).ok()?));
    let refused = Circumstance {
        name,
        worse: None,
        swing_rad: 0.0,
        swing_without_rad: 0.0,
        largest_a: 0.0,
        stopped: false,
    };
    let (Some((lifts, without)), Some((holds, holds_without))) =
        (both(Task::LowSpeed), both(Task::Hold))
    else {
        return refused;
    };
    let largest =
        |course: &Course| course.current_a.iter().fold(0.0f64, |most, a| most.max(a.abs()));
    Circumstance {
        worse: Some(velocity_rmse_rad_s(&lifts) / velocity_rmse_rad_s(&without)),
        swing_rad: hold_swing_rad(&holds),
        swing_without_rad: hold_swing_rad(&holds_without),
        largest_a: largest(&lifts).max(largest(&holds)),
        stopped: lifts.stopped || holds.stopped,
        ..refused
    }
}

/// The watch over a campaign in which the seal wears by a percent a day.
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
        run(Task::VelocityTracking, arm, conditions).map(|course| course.out_of_band)
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
