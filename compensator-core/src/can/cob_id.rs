//! Identifiers of CANopen's predefined connection set (CiA 301), without the node's number.
//!
//! The node's number is added to all but SYNC. A fifth receive PDO is not in the set: it has the identifier of
//! the fourth transmit PDO, which no joint driver sends.

/// SYNC, everyone's.
pub const SYNC: u16 = 0x080;
/// Emergencies.
pub const EMERGENCY: u16 = 0x080;
/// Transmit PDO 1, an [`Answer`](super::Answer).
pub const TPDO_1: u16 = 0x180;
/// Receive PDO 1, a [`Motion`](super::Motion).
pub const RPDO_1: u16 = 0x200;
/// Transmit PDO 2, a [`Status`](super::Status).
pub const TPDO_2: u16 = 0x280;
/// Receive PDO 2, a [`Torque`](super::Torque).
pub const RPDO_2: u16 = 0x300;
/// Transmit PDO 3, a [`Telemetry`](super::Telemetry).
pub const TPDO_3: u16 = 0x380;
/// Receive PDO 3, a [`Seal`](super::Seal).
pub const RPDO_3: u16 = 0x400;
/// Receive PDO 5, a [`Command`](super::Command).
pub const RPDO_5: u16 = 0x480;
/// Receive PDO 4, [`Surroundings`](super::Surroundings).
pub const RPDO_4: u16 = 0x500;
/// What an SDO server answers.
pub const SDO_ANSWER: u16 = 0x580;
/// What an SDO client asks, an [`Entry`](super::Entry) among it.
pub const SDO_REQUEST: u16 = 0x600;
/// The bits of an identifier that are the node's number.
pub const NODE: u16 = 0x07F;
