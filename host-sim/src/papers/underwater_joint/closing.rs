//! The loop closed once more: what was diagnosed goes into the joint that is running, over its bus.
//!
//! A joint runs on the model the paper's procedure gives it, and is disarmed. Then the whole set with the diagnosed model is
//! written by the code behind `params set`: staged and committed in object transfers, frame by frame. It is armed again and does the
//! same task once more: the same driver without a restart, the same seal as warm as it has become. In between a stand
//! puts the output back to where the task begins. An armed driver takes no parameters, and that is tried, too.

use super::arms::Arm;
use super::experiments::{day, measures};
use super::measures::{Spread, velocity_error_rpm};
use super::tasks::{Conditions, Course, Task, joint, master, run};
use crate::joint_rig::{JointRig, RigBus, SETTLE_MS, with_joint};
use compensator_core::can::Node;
use joint_bus::bus::Bus;
use joint_bus::canopen::Client;
use joint_bus::parameters::{read_set, write_set};
use rayon::prelude::*;

/// The tasks it is shown in.
pub const TASKS: [Task; 2] = [Task::VelocityTracking, Task::LowSpeed];

/// What became of a task.
#[derive(Clone, Debug)]
pub struct Closed {
    /// The task.
    pub task: Task,
    /// Its first measure before, and after.
    pub before: Spread,
    /// See `before`.
    pub after: Spread,
    /// Both of the first seed.
    pub courses: [Course; 2],
    /// Time the set took on the bus, s.
    pub written_s: f64,
    /// Frames to the driver and back.
    pub frames: u64,
}

/// One joint's two runs.
struct Run {
    courses: [Course; 2],
    written_s: f64,
    frames: u64,
}

/// Closes it in every task, on so many days.
///
/// # Errors
/// The first run that could not be made; one line.
pub fn closed(
    before: &Arm,
    after: &Arm,
    conditions: &Conditions,
    seeds: u64,
) -> Result<Vec<Closed>, String> {
    TASKS.into_iter().map(|task| in_task(task, before, after, conditions, seeds)).collect()
}

fn in_task(
    task: Task,
    before: &Arm,
    after: &Arm,
    conditions: &Conditions,
    seeds: u64,
) -> Result<Closed, String> {
    let days: Vec<u64> = (0..seeds).collect();
    let runs = days.into_par_iter().map(|seed| {
        let own = day(conditions, conditions.seed.wrapping_add(seed));
        let plant = joint(task, &own);
        with_joint(&before.set, plant, own.faults, |rig| twice(rig, task, after, own.most_s))?
    });
    let runs: Vec<Run> = runs.collect::<Result<_, String>>()?;
    let measure = measures(task)[0].of;
    let of = |at: usize| {
        let values: Vec<f64> = runs.iter().map(|run| measure(&run.courses[at])).collect();
        Spread::of(&values)
    };
    let (before, after) = (of(0), of(1));
    let first = runs.into_iter().next().ok_or("no seeds")?;
    let Run { courses, written_s, frames } = first;
    Ok(Closed { task, before, after, courses, written_s, frames })
}

fn twice(rig: &mut JointRig, task: Task, after: &Arm, most_s: f64) -> Result<Run, String> {
    let start_rad = rig.plant().position_rad();
    let first = master(rig, task, most_s);
    let (written_s, frames) = replace(rig, after, start_rad)?;
    rig.arm(start_rad)?;
    Ok(Run { courses: [first, master(rig, task, most_s)], written_s, frames })
}

/// Puts an arm's set in place of the one the driver runs on, and the output back. Gives the time the set took, s, and its
/// frames.
fn replace(rig: &mut JointRig, arm: &Arm, start_rad: f64) -> Result<(f64, u64), String> {
    let words = |error: joint_bus::parameters::ParametersError| error.to_string();
    let mut client = Client::new(RigBus::new(rig), Node::FIRST);
    if write_set(&mut client, &arm.set).is_ok() {
        return Err("an armed driver took parameters".into());
    }
    drop(client);
    rig.request(0);
    rig.plant_mut().hold(true);
    rig.plant_mut().place(start_rad);
    // The observer sees the output turned back faster than any joint turns, and has to come to rest again.
    (0..SETTLE_MS).for_each(|_| rig.pass());
    let mut client = Client::new(RigBus::new(rig), Node::FIRST);
    let begin_ns = client.bus().now_ns();
    let active = write_set(&mut client, &arm.set).map_err(words)?;
    let written_s = 1e-9 * (client.bus().now_ns() - begin_ns) as f64;
    let counted = client.bus().counters();
    let holds = read_set(&mut client).map_err(words)?;
    if holds.crc() != active || holds.emit() != arm.set.emit() {
        return Err("the driver reads back another set".into());
    }
    Ok((written_s, counted.sent + counted.received))
}

/// Mean velocity errors on the sine, rpm, of one day: what a friction that follows the shaft's angle is worth.
#[derive(Clone, Copy, Debug)]
pub struct Round {
    /// Of the diagnosed and the perfect model, on the joint as it is.
    pub as_is: [f64; 2],
    /// The same on a seal that is round and centred.
    pub round: [f64; 2],
}

/// Follows the sine on the joint as it is, and on one whose seal is round and centred.
///
/// # Errors
/// A run that could not be made; one line.
pub fn round(ours: &Arm, perfect: &Arm, joint: &Conditions) -> Result<Round, String> {
    let mut parameters = joint.parameters;
    (parameters.eccentricity, parameters.out_of_round) = (0.0, 0.0);
    let even = Conditions { parameters, ..*joint };
    let error = |arm: &Arm, conditions: &Conditions| {
        run(Task::VelocityTracking, arm, conditions).map(|course| velocity_error_rpm(&course))
    };
    Ok(Round {
        as_is: [error(ours, joint)?, error(perfect, joint)?],
        round: [error(ours, &even)?, error(perfect, &even)?],
    })
}
