//! CAN process frames: a joint's sample in four frames and a SYNC, its answer in two more.
//!
//! Classic CAN with 11-bit identifiers, those of CANopen's predefined connection set (CiA 301). What a
//! driver is told comes as receive PDOs, which count from the next SYNC on; what it says leaves as
//! transmit PDOs after that SYNC. What a joint measures of itself it says, and a joint in HIL is told it in
//! the very frames, so that a log of a joint can be played to one. Numbers are `f32` as they are,
//! little-endian, so that a log replayed on a PC gives the very bits the driver gave. A quantity nobody
//! measures is NaN; a frame none of whose quantities is measured need not be sent. The SYNC counts 1 to 240;
//! where it says 1, an SDO download says the number of the sample in full, so that no loss goes unseen.
//! Another one begins a run.
//!
//! | frame | identifier | length | content, by byte |
//! |---|---|---|---|
//! | [`Motion`], TPDO 4 | 0x480 + node | 8 | 0 velocity rad/s, 4 position rad |
//! | [`Torque`], TPDO 5 | 0x680 + node | 8 | 0 measured torque Nm, 4 load torque Nm |
//! | [`Seal`], RPDO 3 | 0x400 + node | 8 | 0 radial force N, 4 pressure difference Pa |
//! | [`Surroundings`], RPDO 4 | 0x500 + node | 8 | 0 temperature degC, 4 auxiliary covariate |
//! | [`Sync`] | 0x080 | 1 | 0 counter, 1..=240: ends a sample |
//! | [`Answer`], TPDO 1 | 0x180 + node | 8 | 0 friction torque Nm, 4 feed-forward current A |
//! | [`Status`], TPDO 2 | 0x280 + node | 8 | 0 flags, 4 number of the sample in its run |
//! | [`Telemetry`], TPDO 3 | 0x380 + node | 8 | 0 current A, 4 residual torque Nm |
//! | [`Command`], RPDO 2 | 0x300 + node | 8 | 0 current A, 4 velocity reference 1e-4 rad/s (24 bits), 7 counter |
//! | [`Entry`], SDO download | 0x600 + node | 8 | 0 0x23, 1 0x2000, 3 sub-index, 4 value |
//!
//! Of a prismatic joint read m for rad and N for Nm. The same in the words of CAN tools: `joint.dbc`.

pub mod cob_id;
mod inbox;
mod message;
pub mod slcan;

pub use crate::joint_kind::JointKind;
pub use inbox::{Inbox, SyncOutcome};
pub use message::{
    Answer, Command, Entry, Message, Motion, Seal, Status, Surroundings, Sync, Telemetry, Torque,
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
    pub const LAST_IDENTIFIER: u16 = 0x7FF;

    /// A frame without data, of the lowest priority there is.
    pub const EMPTY: Self = Self { identifier: Self::LAST_IDENTIFIER, length: 0, bytes: [0; 8] };

    /// A frame of these bytes; `None` for a longer identifier or more than eight bytes.
    pub fn new(identifier: u16, data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        let legal = identifier <= Self::LAST_IDENTIFIER;
        legal.then_some(Self { identifier, length: data.len() as u8, bytes })
    }

    /// The 11-bit identifier.
    pub const fn identifier(&self) -> u16 {
        self.identifier
    }

    /// The bytes there are.
    pub fn data(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }
}

/// The number of a joint on its bus, 1..=127.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Node(u8);

impl Node {
    /// The first.
    pub const FIRST: Self = Self(1);

    /// The node of this number; `None` for 0, which is everyone, and beyond 127.
    pub const fn new(number: u8) -> Option<Self> {
        if 1 <= number && number <= 127 { Some(Self(number)) } else { None }
    }

    /// Its number.
    pub const fn number(self) -> u8 {
        self.0
    }
}

/// Why a frame says nothing here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// It belongs to something else on the bus.
    Foreign(u16),
    /// A frame of this identifier has another length.
    Length {
        /// Its identifier.
        identifier: u16,
        /// The bytes it has.
        found: u8,
        /// The bytes it should have.
        expected: u8,
    },
    /// A SYNC counts from 1 to 240.
    Counter(u8),
    /// There is no kind of joint with this number.
    JointKind(u32),
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign(identifier) => write!(f, "{identifier:03X} is no frame of a joint"),
            Self::Length { identifier, found, expected } => {
                write!(f, "{identifier:03X} with {found} bytes, expected {expected}")
            }
            Self::Counter(found) => write!(f, "SYNC counter {found}, expected 1 to 240"),
            Self::JointKind(found) => write!(f, "joint kind {found}, expected 0 or 1"),
        }
    }
}

impl core::error::Error for FrameError {}
