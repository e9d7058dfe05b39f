//! Transfers the diagnosed parameters into the running joint, over its bus.
//!
//! A joint runs with the model of the paper's procedure and is disarmed. The code behind `params set` then writes the set
//! with the diagnosed model, staged and committed by object transfers. The joint is armed and repeats the task. Driver and
//! seal continue without a restart, so that the seal stays warm. In between, a stand returns the output to the start of the
//! task. The experiment also checks that an armed driver rejects parameters.

use super::arms::DriverArm;
use super::experiments::{conditions_of_day, measures};
use super::measures::{Spread, velocity_error_rpm};
use super::tasks::{Conditions, Course, Task, joint, master, run};
use crate::PaperError;
use compensator_core::can::NodeId;
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;
use joint_bus::parameters::{read_set, write_set};
use joint_rig::{JointRig, OBSERVER_SETTLING_MS, RigBus, run_armed};
use rayon::prelude::*;

/// Tasks of the experiment.
pub const TASKS: [Task; 2] = [Task::VelocityTracking, Task::LowSpeed];

/// Result of the transfer in a task.
#[derive(Clone, Debug)]
pub struct TransferResult {
    /// The task.
    pub task: Task,
    /// First measure of the task before the transfer.
    pub before: Spread,
    /// First measure of the task after the transfer.
    pub after: Spread,
    /// Courses before and after, of the first seed.
    pub courses: [Course; 2],
    /// Duration of the transfer on the bus, s.
    pub written_s: f64,
    /// Number of frames to the driver and back.
    pub frames: u64,
}

/// Both runs of one joint.
struct Run {
    courses: [Course; 2],
    written_s: f64,
    frames: u64,
}

/// Runs the experiment in every task, once per seed.
///
/// # Errors
/// Returns one line for the first run that fails.
pub fn transfer_in_all_tasks(
    before: &DriverArm,
    after: &DriverArm,
    conditions: &Conditions,
    seeds: u64,
) -> Result<Vec<TransferResult>, PaperError> {
    TASKS.into_iter().map(|task| transfer_in_task(task, before, after, conditions, seeds)).collect()
}

fn transfer_in_task(
    task: Task,
    before: &DriverArm,
    after: &DriverArm,
    conditions: &Conditions,
    seeds: u64,
) -> Result<TransferResult, PaperError> {
    let days: Vec<u64> = (0..seeds).collect();
    let runs = days.into_par_iter().map(|seed| {
        let of_day = conditions_of_day(conditions, conditions.seed.wrapping_add(seed));
        let plant = joint(task, &of_day);
        let run =
            |rig: &mut JointRig| run_before_and_after(rig, task, after, of_day.max_duration_s);
        run_armed(&before.set, plant, of_day.faults, run)?
    });
    let runs: Vec<Run> = runs.collect::<Result<_, PaperError>>()?;
    let measure = measures(task)[0].of;
    let of = |at: usize| {
        let values: Vec<f64> = runs.iter().map(|run| measure(&run.courses[at])).collect();
        Spread::of(&values)
    };
    let (before, after) = (of(0), of(1));
    let first = runs.into_iter().next().ok_or(PaperError::NoSeeds)?;
    let Run { courses, written_s, frames } = first;
    Ok(TransferResult { task, before, after, courses, written_s, frames })
}

fn run_before_and_after(
    rig: &mut JointRig,
    task: Task,
    after: &DriverArm,
    max_duration_s: f64,
) -> Result<Run, PaperError> {
    let start_rad = rig.plant().position_rad();
    let first = master(rig, task, max_duration_s);
    let (written_s, frames) = replace_parameters(rig, after, start_rad)?;
    rig.arm(start_rad)?;
    Ok(Run { courses: [first, master(rig, task, max_duration_s)], written_s, frames })
}

/// Replaces the driver's set by an arm's, and returns the output to `start_rad`. Returns the duration, s, and the number of
/// frames.
fn replace_parameters(
    rig: &mut JointRig,
    arm: &DriverArm,
    start_rad: f64,
) -> Result<(f64, u64), PaperError> {
    let mut client = Client::new(RigBus::new(rig), NodeId::FIRST);
    if write_set(&mut client, &arm.set).is_ok() {
        return Err(PaperError::TookParameters);
    }
    drop(client);
    rig.request_state(0);
    rig.plant_mut().hold(true);
    rig.plant_mut().place(start_rad);
    // The output returns faster than any joint turns, so that the observer must settle again.
    (0..OBSERVER_SETTLING_MS).for_each(|_| rig.step_idle());
    let mut client = Client::new(RigBus::new(rig), NodeId::FIRST);
    let begin_ns = client.bus().now_ns();
    let active = write_set(&mut client, &arm.set).map_err(PaperError::source)?;
    let written_s = 1e-9 * (client.bus().now_ns() - begin_ns) as f64;
    let counted = client.bus().counters();
    let holds = read_set(&mut client).map_err(PaperError::source)?;
    if holds.crc() != active || holds.emit() != arm.set.emit() {
        return Err(PaperError::ReadsBack);
    }
    Ok((written_s, counted.sent + counted.received))
}

/// Mean velocity errors on the sine, rpm, for the effect of friction that follows the shaft's angle.
#[derive(Clone, Copy, Debug)]
pub struct RoundSealErrors {
    /// Error of the diagnosed and of the perfect model, on the joint as it is.
    pub as_is: [f64; 2],
    /// Error on a seal that is round and centred.
    pub round: [f64; 2],
}

/// Follows the sine on the joint as it is, and on one with a round and centred seal.
///
/// # Errors
/// Returns one line for the first run that fails.
pub fn measure_round_seal(
    ours: &DriverArm,
    perfect: &DriverArm,
    joint: &Conditions,
) -> Result<RoundSealErrors, PaperError> {
    let mut parameters = joint.parameters;
    (parameters.eccentricity, parameters.out_of_round) = (0.0, 0.0);
    let even = Conditions { parameters, ..*joint };
    let error = |arm: &DriverArm, conditions: &Conditions| {
        run(Task::VelocityTracking, arm, conditions).map(|course| velocity_error_rpm(&course))
    };
    Ok(RoundSealErrors {
        as_is: [error(ours, joint)?, error(perfect, joint)?],
        round: [error(ours, &even)?, error(perfect, &even)?],
    })
}
