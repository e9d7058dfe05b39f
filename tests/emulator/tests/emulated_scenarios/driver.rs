//! The driver of the scenarios: the image.

use crate::common::image;
use emulated_board::BoardDriver;
use joint_rig::{JointRig, PowerUp, RigFaults, stage_at_power_up};
use simulated_machines::joint_plant::JointPlant;

/// Number of random motors in scenario 4: the first ones of the library's.
pub const MOTORS: usize = 3;

/// Returns true if scenario 14 runs with this stiffness of the coupling, Nm/rad (0: rigid), and share of the friction. Each
/// of these takes two minutes of simulated time.
pub fn has_model_error(stiffness: f64, level: f32) -> bool {
    stiffness == 0.0 && level > 0.9
}

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
