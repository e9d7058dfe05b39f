//! The driver of the scenarios: the image.

use crate::common::{compact_image, image};
use emulated_board::{BoardDriver, EmulatorError};
use joint_rig::{JointRig, PowerUp, RigFaults, stage_at_power_up};
use simulated_machines::joint_plant::JointPlant;

/// Number of random motors in scenario 4: the first ones of the library's.
pub const MOTORS: usize = 3;

/// Faults of encoders: those that differ on the board.
pub const ALL_ENCODER_FAULTS: bool = false;

/// Number of sensors that are reported as stuck if side load and pressure on the bus are: the board's own strain gauge
/// replaces the side load.
pub const STUCK_SENSORS: f64 = 1.0;

/// Starts the image of the compact node on its board from power-up with an open bridge, and calls `work` as its master.
pub fn compact_power_up<R>(
    start: &PowerUp,
    plant: JointPlant,
    faults: RigFaults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, EmulatorError> {
    let stage = stage_at_power_up(start, plant, &faults);
    let driver = BoardDriver::start_compact(compact_image(), start, stage)?;
    Ok(work(&mut JointRig::new(Box::new(driver), faults)))
}

/// Starts the image from power-up with an open bridge, and calls `work` as its master.
pub fn power_up<R>(
    start: &PowerUp,
    plant: JointPlant,
    faults: RigFaults,
    work: impl FnOnce(&mut JointRig) -> R,
) -> Result<R, EmulatorError> {
    let stage = stage_at_power_up(start, plant, &faults);
    let driver = BoardDriver::start(image(), start, stage)?;
    Ok(work(&mut JointRig::new(Box::new(driver), faults)))
}
