//! The level that a write to each object needs.
//!
//! What bounds the harm of open objects is not open itself: motor and wiring, limits, watches, stop reactions, gains,
//! the settings in flash, the node's number, the program. What a master writes at every start is open: process
//! data, communication times, modes, targets, limits below those of the parameters. The friction model is open, too,
//! because the watches and limits of the service level bound it.

use super::index;
use super::records::{AccessObject, CommitObject, OperationObject};
use crate::access::Level;

/// Returns the level that a write to an object needs.
pub const fn level(at_index: u16, sub_index: u8) -> Level {
    match (at_index, sub_index) {
        // A save wears the flash, and makes changes permanent.
        (index::STORE | index::RESTORE, _)
        // Download and start of a program (CiA 302-3).
        | (0x1F50..=0x1F57, _)
        | (
            index::OPERATION,
            OperationObject::SOURCE
            | OperationObject::NODE
            | OperationObject::BIT_RATE
            | OperationObject::DATA_BIT_RATE
            | OperationObject::FD_TELEMETRY,
        )
        // The confirmation of the wiring; a run that moves the motor while its wiring is unknown.
        | (index::COMMISSIONING | index::COMMISSIONING_RUN, _)
        | (index::MOTOR | index::THRESHOLDS | index::WATCH_PARAMETERS | index::SENSORS, _)
        | (index::COMMIT, CommitObject::DRIVE_RECORD)
        | (index::HOLDING_BRAKE, _)
        | (index::ACCESS, AccessObject::NEW_KEY | AccessObject::LOCKED_BY_DEFAULT)
        // Stop reactions, and the ramp of the quick stop.
        | (index::ABORT_CONNECTION | index::QUICK_DECELERATION, _)
        | (index::QUICK_STOP_OPTION..=index::FAULT_OPTION, _)
        | (index::FOLLOWING_WINDOW | index::FOLLOWING_TIME | index::POSITION_LIMITS, _)
        | (index::POSITION_LOOP, _) => Level::Service,
        _ => Level::Open,
    }
}
