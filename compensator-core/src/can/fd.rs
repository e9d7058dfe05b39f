//! The frames that a joint sends at a SYNC, in one CAN FD frame.
//!
//! Five classic frames per sample fill a bus of 1 Mbit/s with one joint at 1 kHz. Their contents fit one frame of
//! CAN FD, whose data travel at a higher bit rate. The option is off by default (object 2001h:9).
//!
//! | byte | content |
//! |---|---|
//! | 0 | [`FORMAT`] |
//! | 1 | bit n: the frame has the data of transmit PDO n + 1 |
//! | 2 | counter of the SYNC, 1 to 240 |
//! | 3 | 0 |
//! | 4 to 7 | time of the SYNC on the joint's clock, us, modulo 2^32 |
//! | 8 to 47 | Answer, Status, Telemetry, Motion, Torque: the data of transmit PDO 1 to 5, each as in its own frame |
//! | 48 to 55 | statusword, actual torque, actual position, as in transmit PDO 6 |
//! | 56 to 63 | 0 |
//!
//! The identifier is that of Telemetry, 380h + node. [`FdTelemetry::frames`] returns the classic frames, so that whatever
//! reads those reads this frame as well.

use super::{Frame, NodeId, cob_id};

/// Number of the layout, in byte 0.
pub const FORMAT: u8 = 1;

/// Length of the frame, bytes.
pub const LENGTH: usize = 64;

/// Data lengths of CAN FD by length code (DLC), bytes (ISO 11898-1:2015).
pub const LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// Identifiers of transmit PDO 1 to 5.
const IDENTIFIERS: [u16; 5] =
    [cob_id::TPDO_1, cob_id::TPDO_2, cob_id::TPDO_3, cob_id::TPDO_4, cob_id::TPDO_5];

/// Order of these frames at a SYNC: what was measured, then what was computed.
const SYNC_ORDER: [usize; 5] = [3, 4, 0, 1, 2];

/// First byte of the data of transmit PDO 1.
const DATA: usize = 8;

/// A CAN FD frame with the data of a joint's transmit PDOs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FdTelemetry {
    node: NodeId,
    bytes: [u8; LENGTH],
}

impl FdTelemetry {
    /// Creates a frame without data. `time_us` is the time of the SYNC with this counter.
    pub fn new(node: NodeId, counter: u8, time_us: u32) -> Self {
        let mut bytes = [0; LENGTH];
        let [a, b, c, d] = time_us.to_le_bytes();
        for (place, byte) in bytes.iter_mut().zip([FORMAT, 0, counter, 0, a, b, c, d]) {
            *place = byte;
        }
        Self { node, bytes }
    }

    /// Parses a received CAN FD frame; `None` for an identifier, a length or a layout of others.
    pub fn parse(identifier: u16, data: &[u8]) -> Option<Self> {
        let bytes = *<&[u8; LENGTH]>::try_from(data).ok()?;
        let node = NodeId::new(u8::try_from(identifier.checked_sub(cob_id::TPDO_3)?).ok()?)?;
        (bytes[0] == FORMAT).then_some(Self { node, bytes })
    }

    /// Adds the data of a transmit PDO, counted from 0 to 5.
    pub fn put(&mut self, pdo: usize, data: [u8; 8]) {
        if let Some(place) = self.bytes.get_mut(DATA + 8 * pdo..DATA + 8 * pdo + 8) {
            place.copy_from_slice(&data);
            self.bytes[1] |= 1 << pdo;
        }
    }

    /// Returns the data of a transmit PDO, counted from 0 to 5; `None` if the frame does not have them.
    pub fn get(&self, pdo: usize) -> Option<[u8; 8]> {
        let is_contained = pdo <= 5 && self.bytes[1] >> pdo & 1 == 1;
        let data = self.bytes.get(DATA + 8 * pdo..DATA + 8 * pdo + 8)?;
        is_contained.then_some(data.try_into().ok()?)
    }

    /// Returns the classic frames, in the order in which a joint sends them.
    pub fn frames(&self) -> impl Iterator<Item = Frame> + use<> {
        let telemetry = *self;
        SYNC_ORDER.into_iter().filter_map(move |pdo| {
            let identifier = IDENTIFIERS.get(pdo)? + u16::from(telemetry.node.number());
            Frame::new(identifier, &telemetry.get(pdo)?)
        })
    }

    /// The 11-bit identifier.
    pub fn identifier(&self) -> u16 {
        cob_id::TPDO_3 + u16::from(self.node.number())
    }

    /// The data.
    pub const fn data(&self) -> &[u8; LENGTH] {
        &self.bytes
    }

    /// Counter of the SYNC.
    pub const fn counter(&self) -> u8 {
        self.bytes[2]
    }

    /// Time of the SYNC on the joint's clock, us, modulo 2^32.
    pub fn time_us(&self) -> u32 {
        let [_, _, _, _, a, b, c, d, ..] = self.bytes;
        u32::from_le_bytes([a, b, c, d])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parsed_frame_returns_the_frames_that_were_put_into_it() {
        let node = NodeId::new(95).unwrap();
        let mut sent = FdTelemetry::new(node, 240, 0x1234_5678);
        for pdo in [0, 2, 3, 5, 6] {
            sent.put(pdo, [pdo as u8 + 1; 8]);
        }
        let found = FdTelemetry::parse(0x3DF, sent.data()).unwrap();
        assert_eq!((found, found.identifier()), (sent, 0x3DF));
        assert_eq!((found.counter(), found.time_us()), (240, 0x1234_5678));
        let expected = [(0x4DF, 4), (0x1DF, 1), (0x3DF, 3)];
        let expected = expected.map(|(at, byte)| Frame::new(at, &[byte; 8]).unwrap());
        assert!(found.frames().eq(expected), "{found:?}");
        assert_eq!((found.get(1), found.get(5), found.get(6)), (None, Some([6; 8]), None));
    }

    #[test]
    fn parse_of_other_frames_returns_none() {
        let sent = FdTelemetry::new(NodeId::FIRST, 1, 0);
        assert!(FdTelemetry::parse(0x381, sent.data()).is_some());
        for identifier in [0x380, 0x301, 0x400, 0x7FF] {
            assert_eq!(FdTelemetry::parse(identifier, sent.data()), None, "{identifier:03X}");
        }
        assert_eq!(FdTelemetry::parse(0x381, &sent.data()[..48]), None);
        let mut other = *sent.data();
        other[0] = 2;
        assert_eq!(FdTelemetry::parse(0x381, &other), None);
    }
}
