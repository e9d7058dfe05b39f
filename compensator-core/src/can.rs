//! CAN process frames: a sample takes four frames and a SYNC, its answer takes two more.
//!
//! The frames are classic CAN with the 11-bit identifiers of CANopen's predefined connection set (CiA 301).
//! A driver receives its inputs in receive PDOs, which take effect at the next SYNC. It sends its results in
//! transmit PDOs after that SYNC. A joint sends its own measurements; a joint in HIL receives them in the same
//! frames, so a log of a joint can be replayed to another one. Values are little-endian `f32` without scaling,
//! so a replay on a PC reproduces the driver's results bit for bit. A quantity without a sensor is NaN. A frame
//! may be omitted if none of its quantities is measured. The SYNC counter runs from 1 to 240. At counter 1, an
//! SDO download gives the full sample number, so every lost sample is detected. Another SDO download starts a
//! run.
//!
//! | frame | identifier | length | content, by byte |
//! |---|---|---|---|
//! | [`MotionFrame`], TPDO 4 | 0x480 + node | 8 | 0 velocity rad/s, 4 position rad |
//! | [`TorqueFrame`], TPDO 5 | 0x680 + node | 8 | 0 measured torque Nm, 4 load torque Nm |
//! | [`SealFrame`], RPDO 3 | 0x400 + node | 8 | 0 radial force N, 4 pressure difference Pa |
//! | [`SurroundingsFrame`], RPDO 4 | 0x500 + node | 8 | 0 temperature degC, 4 auxiliary covariate |
//! | [`SyncFrame`] | 0x080 | 1 | 0 counter, 1..=240: ends a sample |
//! | [`AnswerFrame`], TPDO 1 | 0x180 + node | 8 | 0 friction torque Nm, 4 feed-forward current A |
//! | [`StatusFrame`], TPDO 2 | 0x280 + node | 8 | 0 flags, 4 number of the sample in its run |
//! | [`TelemetryFrame`], TPDO 3 | 0x380 + node | 8 | 0 current A, 4 residual torque Nm |
//! | [`CommandFrame`], RPDO 2 | 0x300 + node | 8 | 0 current A, 4 velocity reference 1e-4 rad/s (24 bits), 7 counter |
//! | [`TraceEntry`], SDO download | 0x600 + node | 8 | 0 0x23, 1 0x2000, 3 sub-index, 4 value |
//!
//! A joint may send its transmit PDOs of a sample in one frame of CAN FD instead ([`FdTelemetry`]).
//!
//! For a prismatic joint, read m for rad and N for Nm. `joint.dbc` describes the same frames for CAN tools;
//! `joint-fd.dbc` describes those with [`FdTelemetry`].

pub mod cob_id;
pub mod fd;
mod inbox;
mod message;
pub mod slcan;

pub use crate::joint_kind::JointKind;
pub use fd::FdTelemetry;
pub use inbox::{SampleAssembler, SyncOutcome};
pub use message::{
    AnswerFrame, CommandFrame, Message, MotionFrame, SealFrame, StatusFrame, SurroundingsFrame,
    SyncFrame, TelemetryFrame, TorqueFrame, TraceEntry,
};

use core::fmt;

/// A classic CAN data frame with an 11-bit identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame {
    identifier: u16,
    length: u8,
    bytes: [u8; 8],
}

impl Frame {
    /// Largest 11-bit identifier.
    pub const MAX_IDENTIFIER: u16 = 0x7FF;

    /// A frame without data and with the lowest priority.
    pub const EMPTY: Self = Self { identifier: Self::MAX_IDENTIFIER, length: 0, bytes: [0; 8] };

    /// Creates a frame; `None` if the identifier exceeds 11 bits or `data` exceeds eight bytes.
    pub fn new(identifier: u16, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        let legal = identifier <= Self::MAX_IDENTIFIER;
        legal.then_some(Self { identifier, length: data.len() as u8, bytes })
    }

    /// The 11-bit identifier.
    pub const fn identifier(&self) -> u16 {
        self.identifier
    }

    /// The data bytes, 0 to 8.
    pub fn data(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }
}

/// CANopen node ID of a joint, 1..=127.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(u8);

impl NodeId {
    /// Node ID 1.
    pub const FIRST: Self = Self(1);

    /// Creates a node ID; `None` for 0 (broadcast) and for numbers above 127.
    pub const fn new(number: u8) -> Option<Self> {
        if 1 <= number && number <= 127 { Some(Self(number)) } else { None }
    }

    /// The node ID as a number.
    pub const fn number(self) -> u8 {
        self.0
    }
}

/// Error of parsing a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The identifier belongs to another protocol or device on the bus.
    Foreign(u16),
    /// The length is wrong for this identifier.
    Length {
        /// Identifier of the frame.
        identifier: u16,
        /// Received length, bytes.
        found: u8,
        /// Expected length, bytes.
        expected: u8,
    },
    /// The SYNC counter is outside 1..=240.
    Counter(u8),
    /// The joint kind has an unknown number.
    JointKind(u32),
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign(identifier) => write!(f, "{identifier:03X} is not a joint frame"),
            Self::Length { identifier, found, expected } => {
                write!(f, "{identifier:03X} with {found} bytes, expected {expected}")
            }
            Self::Counter(found) => write!(f, "SYNC counter {found}, expected 1 to 240"),
            Self::JointKind(found) => write!(f, "joint kind {found}, expected 0 or 1"),
        }
    }
}

impl core::error::Error for FrameError {}
