//! Maps the effect of wrong models and failing sensors, relative to no compensation under the same circumstances.
//!
//! Each circumstance is tested in the three pool tests (does tracking get worse?) and while holding 2 kg (does the joint
//! swing?). The requirements are no sustained limit cycle, a current within its limit, and tracking at most 5 % worse than
//! without compensation. The map also states when the driver's own watch reports a model that compensates too much. The
//! watch compares torque and model while the joint slides.

use super::arms::{COMPENSATED_SHARE, DriverArm, PERFECT};
use super::measures::{hold_swing_rad, position_rmse_rad, velocity_rmse_rad_s};
use super::tasks::{Conditions, Course, Task, run};
use crate::PaperError;
use compensator_core::ParameterId as Id;
use joint_rig::{RigError, RigFaults, SealSensorFault};
use paper_machines::bench::BRAKE_NM;
use rayon::prelude::*;

/// Pool tests of the map, in the order of its columns.
pub const TASKS: [Task; 3] = [Task::LowSpeed, Task::VelocityTracking, Task::Impact];

/// Maximum ratio of the tracking error to that without compensation.
pub const MAX_TRACKING_RATIO: f64 = 1.05;

/// Maximum swing of a held joint in the last second, rad from end to end: half a degree. A larger swing is a limit cycle. The
/// resolution of the plant's encoder is 7.5e-6 rad.
pub const MAX_SWING_RAD: f64 = 0.0087;

/// The joint's current limit with one count of the converter's noise, A.
const MAX_CURRENT_A: f64 = 26.0 + 0.5;

/// Relative change of each model parameter in the map.
const PARAMETER_CHANGE: f32 = 0.3;

/// Common factors of both friction levels: too little compensation and, above 1, too much.
const LEVEL_FACTORS: [f32; 4] = [1.0 - PARAMETER_CHANGE, 1.1, 1.2, 1.0 + PARAMETER_CHANGE];

/// Name of the map's first row, the unchanged model.
pub const AS_IDENTIFIED: &str = "as identified";

/// A circumstance with its results.
#[derive(Clone, Debug)]
pub struct Circumstance {
    /// Name, for a reader.
    pub name: String,
    /// The model's friction exceeds the seal's at every speed.
    pub over_compensates: bool,
    /// Velocity error over that without compensation in each of [`TASKS`]; `None` if the driver rejected the parameters or did
    /// not arm.
    pub tracking_ratio: Option<[f64; TASKS.len()]>,
    /// Position error of the jump over that without compensation. The current limit keeps the joint from following the commanded
    /// velocity, and catching up counts as a velocity error; the position error does not have this effect.
    pub jump_position_ratio: Option<f64>,
    /// Swing while holding, rad from end to end.
    pub swing_rad: f64,
    /// Swing without compensation, rad.
    pub swing_without_rad: f64,
    /// Largest current, A.
    pub largest_a: f64,
    /// The driver stopped the joint.
    pub stopped: bool,
    /// Time from the start of the sine until the driver reported "model out of band", s.
    pub reported_s: Option<f64>,
}

impl Circumstance {
    /// Returns true if all requirements hold. Swinging is allowed if the joint also swings without compensation.
    pub fn is_harmless(&self) -> bool {
        let swings = self.swing_rad > MAX_SWING_RAD
            && self.swing_rad > MAX_TRACKING_RATIO * self.swing_without_rad;
        self.tracks_within_limit() && !swings && self.largest_a <= MAX_CURRENT_A
    }

    /// Returns true if tracking in every task is within the limit.
    pub fn tracks_within_limit(&self) -> bool {
        self.tracking_ratio.is_none_or(|tracking_ratio| {
            tracking_ratio.iter().all(|tracking_ratio| *tracking_ratio <= MAX_TRACKING_RATIO)
        })
    }
}

/// An arm and its circumstances.
struct HarmCase {
    name: String,
    arm: DriverArm,
    conditions: Conditions,
    over_compensates: bool,
}

impl HarmCase {
    /// Returns a case whose model does not have more friction than the seal.
    fn new(name: impl Into<String>, arm: DriverArm, conditions: Conditions) -> Self {
        Self { name: name.into(), arm, conditions, over_compensates: false }
    }
}

/// Maps an arm. The second row is the perfect model: if that is worse, too, the cause is the lower friction, otherwise the
/// wrong model.
///
/// # Errors
/// Returns an error if the joint does not run without compensation, or a driver that is armed fails.
pub fn harm_map(
    arm: &DriverArm,
    none: &DriverArm,
    perfect: &DriverArm,
    joint: &Conditions,
) -> Result<Vec<Circumstance>, PaperError> {
    let mut cases = vec![
        HarmCase::new(AS_IDENTIFIED, arm.clone(), *joint),
        HarmCase::new(PERFECT, perfect.clone(), *joint),
    ];
    cases.extend(changed_models(arm, joint));
    cases.extend(changed_conditions(arm, joint));
    cases.extend(changed_levels(arm, joint));
    // Most circumstances change the model alone, and the joint without compensation is then the same.
    let same = Uncompensated::measure(none, joint)?;
    cases.into_par_iter().map(|case| evaluate_case(case, none, joint, same)).collect()
}

/// Returns the cases of an arm whose model is changed in one parameter, in its envelope or in its share.
fn changed_models(arm: &DriverArm, joint: &Conditions) -> Vec<HarmCase> {
    let mut cases = Vec::new();
    for id in arm.set.friction.model.active() {
        let value = arm.set.friction.model.get(id);
        if value == 0.0 || matches!(id, Id::TemperatureReference | Id::RippleOrder) {
            continue;
        }
        for factor in [1.0 - PARAMETER_CHANGE, 1.0 + PARAMETER_CHANGE] {
            let mut changed = arm.clone();
            changed.set.friction.model.set(id, value * factor);
            let sign = if factor > 1.0 { '+' } else { '−' };
            cases.push(HarmCase::new(format!("{} {sign}30 %", id.name()), changed, *joint));
        }
    }
    // Limits the load torque in the model to the brake of the bench.
    let mut narrow = arm.clone();
    narrow.set.friction.model.envelope.load_torque_max_nm = BRAKE_NM as f32;
    let name = format!("load torque believed to the bench's {BRAKE_NM} Nm");
    cases.push(HarmCase::new(name, narrow, *joint));
    let mut full = arm.clone();
    full.set.friction.compensator.scale = 1.0;
    cases.push(HarmCase::new(format!("share 1 in place of {COMPENSATED_SHARE}"), full, *joint));
    cases
}

/// Returns the cases of an arm in other conditions: faults of the sensors and of the bus, noise, and another stiffness.
fn changed_conditions(arm: &DriverArm, joint: &Conditions) -> Vec<HarmCase> {
    let mut cases = Vec::new();
    let mut add = |name: String, conditions: Conditions| {
        cases.push(HarmCase::new(name, arm.clone(), conditions));
    };
    for (name, seal) in [
        ("side load and pressure stale", SealSensorFault::Stale),
        ("side load and pressure stuck", SealSensorFault::Stuck),
        ("side load and pressure: half the frames lost", SealSensorFault::Dropped),
        ("side load and pressure absent", SealSensorFault::Absent),
    ] {
        let faults = RigFaults::seal_sensor(seal);
        add(name.to_owned(), Conditions { faults, ..*joint });
    }
    for delay_ms in 1..=3 {
        let faults = RigFaults { delay_ms, ..RigFaults::default() };
        add(format!("frames {delay_ms} ms late"), Conditions { faults, ..*joint });
    }
    let faults = RigFaults { encoder_lost: 0.05, ..RigFaults::default() };
    add("5 % of encoder readings lost".into(), Conditions { faults, ..*joint });
    let mut noisy = *joint;
    noisy.parameters.current_noise_a *= 4.0;
    noisy.parameters.force_noise_n *= 4.0;
    noisy.parameters.pressure_noise_pa *= 4.0;
    add("noise x4".into(), noisy);
    for factor in [0.3, 0.5, 2.0, 3.0] {
        let mut other = *joint;
        other.parameters.presliding_stiffness_nm_per_rad *= factor;
        other.parameters.gear_stiffness_nm_per_rad *= factor;
        add(format!("plant's stiffness x{factor}"), other);
    }
    cases
}

/// Returns the cases of an arm whose levels are all too low or too high.
fn changed_levels(arm: &DriverArm, joint: &Conditions) -> Vec<HarmCase> {
    let case = |factor: f32| {
        let mut changed = arm.clone();
        let model = &mut changed.set.friction.model;
        for id in [Id::CoulombTorque, Id::StaticTorque] {
            model.set(id, model.get(id) * factor);
        }
        let sign = if factor > 1.0 { '+' } else { '−' };
        let percent = (100.0 * (factor - 1.0).abs()).round();
        let name = format!("both levels {sign}{percent} %");
        let over_compensates = factor > 1.0;
        HarmCase { over_compensates, ..HarmCase::new(name, changed, *joint) }
    };
    LEVEL_FACTORS.into_iter().map(case).collect()
}

/// Errors of the joint without compensation.
#[derive(Clone, Copy)]
struct Uncompensated {
    errors: [f64; TASKS.len()],
    jump_rad: f64,
    swing_rad: f64,
}

impl Uncompensated {
    fn measure(none: &DriverArm, conditions: &Conditions) -> Result<Self, PaperError> {
        let [lift, tracks, jumps, holds] = run_all(none, conditions)?;
        Ok(Self {
            errors: [&lift, &tracks, &jumps].map(velocity_rmse_rad_s),
            jump_rad: position_rmse_rad(&jumps),
            swing_rad: hold_swing_rad(&holds),
        })
    }
}

/// Runs the tasks of the map, then holds 2 kg.
fn run_all(
    arm: &DriverArm,
    conditions: &Conditions,
) -> Result<[Course; TASKS.len() + 1], PaperError> {
    let [lift, tracks, jumps] = TASKS.map(|task| run(task, arm, conditions));
    Ok([lift?, tracks?, jumps?, run(Task::Hold, arm, conditions)?])
}

fn evaluate_case(
    case: HarmCase,
    none: &DriverArm,
    joint: &Conditions,
    same: Uncompensated,
) -> Result<Circumstance, PaperError> {
    let HarmCase { name, arm, conditions, over_compensates } = case;
    let refused = Circumstance {
        name,
        over_compensates,
        tracking_ratio: None,
        jump_position_ratio: None,
        swing_rad: 0.0,
        swing_without_rad: 0.0,
        largest_a: 0.0,
        stopped: false,
        reported_s: None,
    };
    let courses = match run_all(&arm, &conditions) {
        Err(PaperError::Rig(RigError::Set(_) | RigError::NotArmed(_))) => return Ok(refused),
        courses => courses?,
    };
    let uncompensated =
        if conditions == *joint { same } else { Uncompensated::measure(none, &conditions)? };
    let largest =
        |course: &Course| course.current_a.iter().fold(0.0f64, |most, a| most.max(a.abs()));
    let [lift, tracks, jumps, holds] = &courses;
    let errors = [lift, tracks, jumps].map(velocity_rmse_rad_s);
    Ok(Circumstance {
        tracking_ratio: Some(std::array::from_fn(|at| errors[at] / uncompensated.errors[at])),
        jump_position_ratio: Some(position_rmse_rad(jumps) / uncompensated.jump_rad),
        swing_rad: hold_swing_rad(holds),
        swing_without_rad: uncompensated.swing_rad,
        largest_a: courses.iter().map(largest).fold(0.0, f64::max),
        stopped: courses.iter().any(|course| course.stopped),
        reported_s: tracks.out_of_band_s,
        ..refused
    })
}

/// Reports of the watch in a campaign with 1 % of wear a day, and on days without wear.
///
/// Each day is one task of 25 s with a temperature and noise of its own. These 25 s show how the model's errors differ from
/// day to day. Long-term noise is not included; the watch is designed for it by `false_alarm_h` hours of sliding.
#[derive(Clone, Copy, Debug)]
pub struct WearCampaign {
    /// First of the checked days on which the driver reported "model out of band".
    pub flagged_day: Option<u32>,
    /// Last checked day.
    pub last_day: u32,
    /// Number of days without wear.
    pub sound_days: u64,
    /// Number of days without wear with a report.
    pub false_alarms: usize,
}

/// Simulates the velocity task of 25 s on every `every`-th day of wear, and on days without wear.
pub fn simulate_wear(
    arm: &DriverArm,
    joint: &Conditions,
    every: u32,
    sound_days: u64,
) -> Result<WearCampaign, PaperError> {
    const LAST_DAY: u32 = 60;
    let days: Vec<u32> = (0..=LAST_DAY).step_by(every.max(1) as usize).collect();
    let out = |conditions: &Conditions| {
        run(Task::VelocityTracking, arm, conditions).map(|course| course.out_of_band_s.is_some())
    };
    let worn = days.par_iter().map(|day| {
        let of_day =
            super::experiments::conditions_of_day(joint, joint.seed.wrapping_add(u64::from(*day)));
        out(&Conditions { wear: 1.0 + 0.01 * f64::from(*day), ..of_day })
    });
    let worn: Vec<bool> = worn.collect::<Result<_, PaperError>>()?;
    let sound: Vec<u64> = (0..sound_days).collect();
    let sound = sound.par_iter().map(|day| {
        out(&super::experiments::conditions_of_day(joint, joint.seed.wrapping_add(500 + day)))
    });
    let sound: Vec<bool> = sound.collect::<Result<_, PaperError>>()?;
    Ok(WearCampaign {
        flagged_day: days.iter().zip(&worn).find(|(_, out)| **out).map(|(day, _)| *day),
        last_day: LAST_DAY,
        sound_days,
        false_alarms: sound.iter().filter(|out| **out).count(),
    })
}
