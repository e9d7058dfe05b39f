//! A line of a CAN log and its frame, and the conversion between a joint's frames and general CAN frames.

use compensator_core::can::{FdTelemetry, Frame};
use std::fmt;

/// Maximum data of a CAN FD frame, in bytes.
pub(crate) const MAX_FD_BYTES: usize = 64;

/// Flag of a CAN FD frame: switched bit rate (BRS).
pub(crate) const SWITCHED_RATE: u8 = 1;

/// Flag of a CAN FD frame: the sender is error-passive (ESI).
pub(crate) const ERROR_PASSIVE: u8 = 2;

/// A parsed line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Line<'a> {
    /// Time stamp, ns, since the epoch or since the start of the log.
    pub time_ns: u64,
    /// Name of the interface, for example `can0`.
    pub interface: &'a [u8],
    /// The frame on the bus.
    pub frame: CanFrame,
    /// Direction of the frame, if the log states it.
    pub direction: Option<Direction>,
}

/// A CAN frame of any kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CanFrame {
    /// Classic data.
    Data {
        /// Identifier of 11 or 29 bits.
        identifier: u32,
        /// True if the identifier has 29 bits.
        extended: bool,
        /// Number of valid bytes.
        length: u8,
        /// Data, padded with 0.
        bytes: [u8; 8],
    },
    /// A remote request.
    Remote {
        /// Identifier of 11 or 29 bits.
        identifier: u32,
        /// True if the identifier has 29 bits.
        extended: bool,
        /// Number of requested bytes.
        length: u8,
    },
    /// CAN FD data.
    Flexible {
        /// Identifier of 11 or 29 bits.
        identifier: u32,
        /// True if the identifier has 29 bits.
        extended: bool,
        /// Four flag bits, among them bit rate switch and error state.
        flags: u8,
        /// Number of valid bytes.
        length: u8,
        /// Data, padded with 0.
        bytes: [u8; MAX_FD_BYTES],
    },
    /// An error reported by the controller.
    Error {
        /// Error classes, one bit each.
        class: u32,
        /// Number of valid bytes.
        length: u8,
        /// Details, padded with 0.
        bytes: [u8; 8],
    },
}

/// Direction of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// Received (`R`).
    Received,
    /// Sent (`T`).
    Sent,
}

/// Number of decimal digits of a time stamp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fraction {
    /// Six digits, the default of candump.
    #[default]
    Microseconds,
    /// Nine digits.
    Nanoseconds,
}

/// The part of a line that is malformed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineError {
    /// The time stamp.
    Time,
    /// The interface.
    Interface,
    /// The identifier.
    Identifier,
    /// The length, in the formats that state it.
    Length,
    /// The data.
    Data,
    /// The text after the frame.
    Direction,
}

impl LineError {
    /// Returns a description of the text that this format expects.
    pub const fn expected(self, format: TextFormat) -> &'static str {
        match (self, format) {
            (Self::Time, TextFormat::Candump) => "a time stamp such as (1436509052.249713)",
            (Self::Time, TextFormat::Asc) => "a time stamp in s",
            (Self::Time, TextFormat::Trc) => "a time stamp in ms",
            (Self::Interface, _) => "an interface such as can0 after the time stamp",
            (Self::Identifier, TextFormat::Candump) => {
                "an identifier of three or eight hexadecimal digits, then # or a length in brackets"
            }
            (Self::Identifier, _) => "an identifier up to 7FF, or up to 1FFFFFFF with 29 bits",
            (Self::Length, _) => {
                "a length up to 8; of CAN FD also 12, 16, 20, 24, 32, 48 or 64 (TRC, column L: its code up to 15)"
            }
            (Self::Data, TextFormat::Candump) => {
                "hexadecimal data after the identifier, two digits a byte"
            }
            (Self::Data, _) => "a word for each byte of the stated length",
            (Self::Direction, _) => "nothing, R or T after the frame",
        }
    }
}

impl fmt::Display for LineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "expected {}", self.expected(TextFormat::Candump))
    }
}

impl std::error::Error for LineError {}

/// A text format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextFormat {
    /// `candump -L`, or candump's default view with stamps.
    #[default]
    Candump,
    /// Vector's ASC.
    Asc,
    /// PEAK's TRC.
    Trc,
}

impl TextFormat {
    /// Returns the file name extension.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Candump => "log",
            Self::Asc => "asc",
            Self::Trc => "trc",
        }
    }
}

impl From<Frame> for CanFrame {
    fn from(frame: Frame) -> Self {
        let data = frame.data();
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
        let (identifier, length) = (u32::from(frame.identifier()), data.len() as u8);
        Self::Data { identifier, extended: false, length, bytes }
    }
}

impl From<FdTelemetry> for CanFrame {
    fn from(telemetry: FdTelemetry) -> Self {
        let bytes = *telemetry.data();
        let (identifier, length) = (u32::from(telemetry.identifier()), bytes.len() as u8);
        Self::Flexible { identifier, extended: false, flags: SWITCHED_RATE, length, bytes }
    }
}

impl CanFrame {
    /// Returns the joint's frames in this frame: itself, or those in a CAN FD frame of telemetry ([`FdTelemetry`]).
    pub fn joint_frames(&self) -> impl Iterator<Item = Frame> + use<> {
        let telemetry = self.to_telemetry().into_iter().flat_map(|telemetry| telemetry.frames());
        self.to_joint().into_iter().chain(telemetry)
    }

    /// Converts to a CAN FD frame of telemetry. Returns `None` for all other frames.
    pub fn to_telemetry(&self) -> Option<FdTelemetry> {
        let Self::Flexible { identifier, extended: false, .. } = self else { return None };
        FdTelemetry::parse(u16::try_from(*identifier).ok()?, self.data())
    }

    /// Converts to a joint frame. Returns `None` unless the frame is classic data with an 11-bit identifier.
    pub fn to_joint(&self) -> Option<Frame> {
        let Self::Data { identifier, extended: false, length, bytes } = self else { return None };
        let identifier = u16::try_from(*identifier).ok()?;
        Frame::new(identifier, bytes.get(..usize::from(*length))?)
    }

    /// Returns the identifier, and true if it has 29 bits. The classes of an error frame take its place.
    pub fn identifier(&self) -> (u32, bool) {
        match self {
            Self::Data { identifier, extended, .. }
            | Self::Remote { identifier, extended, .. }
            | Self::Flexible { identifier, extended, .. } => (*identifier, *extended),
            Self::Error { class, .. } => (*class, true),
        }
    }

    /// Returns the data. A remote request has none; an error frame has its details.
    pub fn data(&self) -> &[u8] {
        let (bytes, length): (&[u8], u8) = match self {
            Self::Data { bytes, length, .. } | Self::Error { bytes, length, .. } => {
                (bytes, *length)
            }
            Self::Flexible { bytes, length, .. } => (bytes, *length),
            Self::Remote { .. } => (&[], 0),
        };
        bytes.get(..usize::from(length)).unwrap_or(bytes)
    }

    /// Returns the data for modification in place.
    pub fn data_mut(&mut self) -> &mut [u8] {
        let (bytes, length): (&mut [u8], u8) = match self {
            Self::Data { bytes, length, .. } | Self::Error { bytes, length, .. } => {
                (bytes, *length)
            }
            Self::Flexible { bytes, length, .. } => (bytes, *length),
            Self::Remote { .. } => (&mut [], 0),
        };
        let length = usize::from(length).min(bytes.len());
        &mut bytes[..length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;

    #[test]
    fn joint_frame_converted_both_ways_is_unchanged() {
        for data in [&[][..], &[1, 2, 3], &[255; 8]] {
            let frame = Frame::new(0x7FF, data).expect("legal");
            let converted = CanFrame::from(frame);
            assert_eq!((converted.to_joint(), converted.data()), (Some(frame), data));
        }
    }

    #[test]
    fn joint_frames_of_fd_telemetry_returns_the_frames_in_it() {
        let mut telemetry = FdTelemetry::new(NodeId::FIRST, 1, 0);
        telemetry.put(0, [1; 8]);
        telemetry.put(4, [5; 8]);
        let frame = CanFrame::from(telemetry);
        assert_eq!((frame.to_telemetry(), frame.to_joint()), (Some(telemetry), None));
        let found: Vec<Frame> = frame.joint_frames().collect();
        assert_eq!(found, telemetry.frames().collect::<Vec<_>>());
        assert_eq!(found.len(), 2);
        // A frame of 48 bytes, and one with 29 bits.
        let CanFrame::Flexible { bytes, flags, identifier, .. } = frame else {
            panic!("{frame:?}")
        };
        for (extended, length) in [(false, 48), (true, 64)] {
            let other = CanFrame::Flexible { identifier, extended, flags, length, bytes };
            assert_eq!(other.joint_frames().count(), 0);
        }
        let classic = Frame::new(0x181, &[1; 8]).expect("legal");
        assert!(CanFrame::from(classic).joint_frames().eq([classic]));
    }

    #[test]
    fn to_joint_with_other_frames_returns_none() {
        let bytes = [0; 8];
        let wide = CanFrame::Data { identifier: 1, extended: true, length: 0, bytes };
        let large = CanFrame::Data { identifier: 0x800, extended: false, length: 0, bytes };
        let long = CanFrame::Data { identifier: 1, extended: false, length: 9, bytes };
        let remote = CanFrame::Remote { identifier: 1, extended: false, length: 0 };
        let error = CanFrame::Error { class: 4, length: 8, bytes };
        for frame in [wide, large, long, remote, error] {
            assert_eq!(frame.to_joint(), None, "{frame:?}");
        }
    }
}
