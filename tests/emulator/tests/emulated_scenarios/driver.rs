//! The driver of the scenarios: the image.

use crate::common::image;
use emulated_board::BoardDriver;
use joint_rig::{JointRig, PowerUp, RigFaults, stage_at_power_up};
use simulated_machines::joint_plant::JointPlant;

/// Starts the image from power-up with an open bridge, and calls `work` as its master.
pub fn power_up<R>(
    start: &PowerUp,
    plant: JointPlant,
    faults: RigFaults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, String> {
    let stage = stage_at_power_up(start, plant, &faults);
    let driver = BoardDriver::start(image(), start, stage)?;
    Ok(work(&mut JointRig::new(Box::new(driver), faults)))
}
