//! Identifiers of CANopen's predefined connection set (CiA 301), without the node's number.
//!
//! The node ID is added to every identifier except SYNC. A joint does not send on the identifiers of its master
//! (RPDO 1 to 4): two senders with different data on one identifier cause errors that end in bus-off. The set has
//! four transmit PDOs. The fifth uses 680h to 6DFh, which CiA 301 leaves free, for node IDs up to 95. For higher
//! node IDs it falls into 6E0h to 6FFh, which CiA 301 reserves.

/// SYNC, a broadcast.
pub const SYNC: u16 = 0x080;
/// Emergencies.
pub const EMERGENCY: u16 = 0x080;
/// Transmit PDO 1, an [`AnswerFrame`](super::AnswerFrame).
pub const TPDO_1: u16 = 0x180;
/// Receive PDO 1, which a standard master sends: controlword and target torque of CiA 402.
pub const RPDO_1: u16 = 0x200;
/// Transmit PDO 2, a [`StatusFrame`](super::StatusFrame).
pub const TPDO_2: u16 = 0x280;
/// Receive PDO 2, a [`CommandFrame`](super::CommandFrame).
pub const RPDO_2: u16 = 0x300;
/// Transmit PDO 3, a [`TelemetryFrame`](super::TelemetryFrame).
pub const TPDO_3: u16 = 0x380;
/// Receive PDO 3, a [`SealFrame`](super::SealFrame).
pub const RPDO_3: u16 = 0x400;
/// Transmit PDO 4, a [`MotionFrame`](super::MotionFrame).
pub const TPDO_4: u16 = 0x480;
/// Receive PDO 4, [`SurroundingsFrame`](super::SurroundingsFrame).
pub const RPDO_4: u16 = 0x500;
/// Transmit PDO 5, a [`TorqueFrame`](super::TorqueFrame).
pub const TPDO_5: u16 = 0x680;
/// SDO server to client.
pub const SDO_ANSWER: u16 = 0x580;
/// SDO client to server; [`TraceEntry`](super::TraceEntry) is one of its requests.
pub const SDO_REQUEST: u16 = 0x600;
/// Mask of the node ID in an identifier.
pub const NODE: u16 = 0x07F;
