//! Conversion between a joint's frames and general CAN frames.

use crate::candump::CanFrame;
use compensator_core::can::{FdTelemetry, Frame};

/// Flag of a CAN FD frame: switched bit rate (BRS).
pub(crate) const SWITCHED_RATE: u8 = 1;

/// Flag of a CAN FD frame: the sender is error-passive (ESI).
pub(crate) const ERROR_PASSIVE: u8 = 2;

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
