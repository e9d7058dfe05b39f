//! Identifiers of CANopen's predefined connection set (CiA 301), without the node's number.
//!
//! The node's number is added to all but SYNC. A joint sends on none of the identifiers the set gives its master
//! (RPDO 1 to 4): two senders on one identifier with other data is an error neither of them can resolve, and ends
//! in bus-off. The set has four transmit PDOs; a fifth goes where CiA 301 leaves identifiers free, 680h to 6DFh,
//! which is up to node 95. Beyond, it lies in 6E0h to 6FFh, which CiA 301 keeps for itself.

/// SYNC, everyone's.
pub const SYNC: u16 = 0x080;
/// Emergencies.
pub const EMERGENCY: u16 = 0x080;
/// Transmit PDO 1, an [`Answer`](super::Answer).
pub const TPDO_1: u16 = 0x180;
/// Receive PDO 1, which a standard master sends: controlword and target torque of CiA 402.
pub const RPDO_1: u16 = 0x200;
/// Transmit PDO 2, a [`Status`](super::Status).
pub const TPDO_2: u16 = 0x280;
/// Receive PDO 2, a [`Command`](super::Command).
pub const RPDO_2: u16 = 0x300;
/// Transmit PDO 3, a [`Telemetry`](super::Telemetry).
pub const TPDO_3: u16 = 0x380;
/// Receive PDO 3, a [`Seal`](super::Seal).
pub const RPDO_3: u16 = 0x400;
/// Transmit PDO 4, a [`Motion`](super::Motion).
pub const TPDO_4: u16 = 0x480;
/// Receive PDO 4, [`Surroundings`](super::Surroundings).
pub const RPDO_4: u16 = 0x500;
/// Transmit PDO 5, a [`Torque`](super::Torque).
pub const TPDO_5: u16 = 0x680;
/// What an SDO server answers.
pub const SDO_ANSWER: u16 = 0x580;
/// What an SDO client asks, an [`Entry`](super::Entry) among it.
pub const SDO_REQUEST: u16 = 0x600;
/// The bits of an identifier that are the node's number.
pub const NODE: u16 = 0x07F;
