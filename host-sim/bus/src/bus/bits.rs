//! The duration of a frame on the wire.
//!
//! Bit stuffing adds a bit after five equal ones, so the length of a frame depends on its content and its checksum. A
//! frame of eight bytes with an 11-bit identifier has 111 to 135 bits, the gap of three bits included.
//!
//! Classic frames are counted bit by bit with their CRC-15. The checksum of CAN FD has fixed stuffing, so its value is not
//! needed. The bits of CAN FD between BRS and the end of the checksum use the data rate. Every frame is assumed to be
//! acknowledged and free of errors.

use compensator_core::can::fd::LENGTHS;
use joint_trace::CanFrame;

/// Bits after the checksum: CRC delimiter, ACK, its delimiter, 7 EOF, 3 gap.
const TRAILER_BITS: u64 = 13;
/// Bits of an error frame: superposed flags of two nodes, delimiter, gap.
const ERROR_BITS: u64 = 12 + 8 + 3;

/// Bit rates of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRates {
    /// Nominal bit rate, bit/s, above 0.
    pub nominal: u32,
    /// Bit rate of CAN FD data with switched rate, bit/s, above 0.
    pub data: u32,
}

impl BitRates {
    /// Nominal rate of 1 Mbit/s, data rate of 5 Mbit/s.
    pub const FASTEST: Self = Self { nominal: 1_000_000, data: 5_000_000 };

    /// Returns the duration of the frame and the following gap, ns, rounded up.
    pub fn duration_ns(self, frame: &CanFrame) -> u64 {
        let (nominal, data) = length(frame);
        let time = |bits: u64, rate: u32| (bits * 1_000_000_000).div_ceil(u64::from(rate.max(1)));
        time(nominal, self.nominal) + time(data, self.data)
    }
}

/// Returns the number of bits at the nominal rate and at the data rate, the gap included.
fn length(frame: &CanFrame) -> (u64, u64) {
    let mut wire = Wire::default();
    match *frame {
        CanFrame::Data { identifier, extended, length, .. } => {
            wire.classic(identifier, extended, false, length);
            frame.data().iter().for_each(|byte| wire.push(u32::from(*byte), 8));
            wire.push(u32::from(wire.checksum), 15);
            (wire.bits + TRAILER_BITS, 0)
        }
        CanFrame::Remote { identifier, extended, length } => {
            wire.classic(identifier, extended, true, length);
            wire.push(u32::from(wire.checksum), 15);
            (wire.bits + TRAILER_BITS, 0)
        }
        CanFrame::Flexible { identifier, extended, flags, .. } => {
            let (switched, passive) = (flags & 1 != 0, flags >> 1 & 1);
            wire.arbitration(identifier, extended, false);
            // FDF, reserved, BRS; then ESI at the data rate.
            wire.push(0b100 | u32::from(switched), if extended { 3 } else { 4 });
            let arbitration = wire.bits;
            let data = frame.data();
            let padding = usize::from(padded(data.len() as u8)).saturating_sub(data.len());
            wire.push(u32::from(passive), 1);
            wire.push(length_code(data.len()), 4);
            data.iter().for_each(|byte| wire.push(u32::from(*byte), 8));
            (0..padding).for_each(|_| wire.push(0, 8));
            // Fixed stuffing: a bit first and after every four bits of stuff count, parity and checksum.
            let checksum = if data.len() + padding > 16 { 4 + 21 } else { 4 + 17 };
            let fast = wire.bits - arbitration + checksum + 1 + checksum / 4;
            if switched {
                (arbitration + TRAILER_BITS, fast)
            } else {
                (arbitration + fast + TRAILER_BITS, 0)
            }
        }
        CanFrame::Error { .. } => (ERROR_BITS, 0),
    }
}

/// Returns the smallest length code of CAN FD for a number of bytes up to 64.
fn length_code(bytes: usize) -> u32 {
    LENGTHS.iter().position(|length| bytes <= usize::from(*length)).unwrap_or(15) as u32
}

/// Returns the padded data length of CAN FD for a number of bytes up to 64.
pub(super) fn padded(bytes: u8) -> u8 {
    LENGTHS[length_code(usize::from(bytes)) as usize]
}

/// The bits on the wire, stuffing included.
#[derive(Default)]
struct Wire {
    bits: u64,
    last: bool,
    run: u32,
    checksum: u16,
}

impl Wire {
    /// Pushes the start of frame up to the control field.
    fn arbitration(&mut self, identifier: u32, extended: bool, remote: bool) {
        self.push(0, 1);
        if extended {
            self.push(identifier >> 18, 11);
            self.push(0b11, 2);
            self.push(identifier, 18);
        } else {
            self.push(identifier, 11);
        }
        self.push(u32::from(remote), 1);
    }

    fn classic(&mut self, identifier: u32, extended: bool, remote: bool, length: u8) {
        self.arbitration(identifier, extended, remote);
        self.push(0, 2);
        self.push(u32::from(length.min(8)), 4);
    }

    /// Pushes the lowest `count` bits of a number, the highest first.
    fn push(&mut self, number: u32, count: u32) {
        for place in (0..count).rev() {
            let bit = number >> place & 1 == 1;
            let carry = self.checksum >> 14 & 1 == 1;
            self.checksum = self.checksum << 1 & 0x7FFF;
            if carry != bit {
                self.checksum ^= 0x4599;
            }
            self.bits += 1;
            self.run = if bit == self.last { self.run + 1 } else { 1 };
            self.last = bit;
            if self.run == 5 {
                self.bits += 1;
                self.last = !bit;
                self.run = 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(identifier: u32, extended: bool, data: &[u8]) -> CanFrame {
        let mut bytes = [0; 8];
        bytes[..data.len()].copy_from_slice(data);
        CanFrame::Data { identifier, extended, length: data.len() as u8, bytes }
    }

    #[test]
    fn checksum_of_test_vector_equals_crc_15_can() {
        let mut wire = Wire::default();
        b"123456789".iter().for_each(|byte| wire.push(u32::from(*byte), 8));
        assert_eq!(wire.checksum, 0x059E);
    }

    /// The bounds are those of the CAN standard.
    #[test]
    fn length_with_random_frames_stays_within_the_standard() {
        let mut seen = (u64::MAX, 0);
        let mut state = 1u64;
        for _ in 0..20_000 {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
            // Few different bytes give long runs of equal bits.
            let bytes =
                state.to_be_bytes().map(|byte| [0, 0xFF, 0x55, 0x3C][usize::from(byte >> 6)]);
            let (bits, fast) = length(&data((state >> 40) as u32 & 0x7FF, false, &bytes));
            assert!((111..=135).contains(&bits) && fast == 0, "{bits}");
            seen = (seen.0.min(bits), seen.1.max(bits));
            let (wide, _) = length(&data((state >> 30) as u32 & 0x1FFF_FFFF, true, &bytes));
            assert!((131..=160).contains(&wide), "{wide}");
        }
        assert!(seen.0 <= 112 && seen.1 >= 128, "{seen:?}");
    }

    /// Calculated by hand. SOF 0, 0x555, RTR 0, IDE 0, r0 0, DLC 0001, 0x55 have no five equal bits. So the frame has 27
    /// bits, 15 bits of checksum with at most three stuffed bits, and 13 bits of trailer.
    #[test]
    fn length_with_known_frames_equals_hand_calculation() {
        let (bits, _) = length(&data(0x555, false, &[0x55]));
        assert!((55..=58).contains(&bits), "{bits}");
        // All bits are zero, the checksum included. Of 34 zero bits, a bit is stuffed after each run of five.
        let (bits, _) = length(&data(0, false, &[]));
        assert_eq!(bits, 34 + 6 + TRAILER_BITS);
        assert_eq!(
            BitRates { nominal: 500_000, data: 1 }.duration_ns(&data(0, false, &[])),
            106_000
        );
    }

    #[test]
    fn duration_with_switched_rate_is_shorter() {
        let bytes = [0x55; 64];
        let frame = |flags, length| CanFrame::Flexible {
            identifier: 0x555,
            extended: false,
            flags,
            length,
            bytes,
        };
        // SOF, 11, RRS, IDE, FDF, reserved, BRS = 17; ESI, DLC 5, data, 21 or 25 and 6 or 7 fixed.
        let slow = length(&frame(0, 64));
        assert_eq!(slow.1, 0);
        let (nominal, fast) = length(&frame(1, 64));
        assert_eq!(nominal, 17 + TRAILER_BITS);
        assert!((5 + 512 + 32..=5 + 512 + 34).contains(&fast), "{fast}");
        let (_, short) = length(&frame(1, 16));
        assert!((5 + 128 + 27..=5 + 128 + 29).contains(&short), "{short}");
        let rates = BitRates::FASTEST;
        assert!(rates.duration_ns(&frame(1, 64)) * 3 < rates.duration_ns(&frame(0, 64)));
    }
}
