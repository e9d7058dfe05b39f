//! How long a frame is on the wire.
//!
//! A bit is added after five equal ones, so the length of a frame follows its content, its checksum
//! included: 111 to 135 bits for eight bytes with an 11-bit identifier, the gap of three bits behind it
//! counted. Classic frames are counted bit by bit with their CRC-15; of CAN FD, the stuffing of the
//! checksum is fixed, so its value is not needed, and the bits between BRS and the checksum's end run at
//! the data rate. Acknowledged always, no errors.

use joint_trace::CanFrame;

/// Bits from the checksum's delimiter to the gap's end: CRC delimiter, ACK, its delimiter, 7 EOF, 3 gap.
const TAIL: u64 = 13;
/// An error flag as two nodes superpose it, its delimiter, the gap.
const ERROR_BITS: u64 = 12 + 8 + 3;

/// Bit rates of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitRates {
    /// bit/s of all but the data of CAN FD with switched rate; above 0.
    pub nominal: u32,
    /// bit/s of those; above 0.
    pub data: u32,
}

impl BitRates {
    /// Classic CAN at 1 Mbit/s, CAN FD's data at 5.
    pub const FASTEST: Self = Self { nominal: 1_000_000, data: 5_000_000 };

    /// Time the frame and the gap behind it take, ns, rounded up.
    pub fn duration_ns(self, frame: &CanFrame) -> u64 {
        let (nominal, data) = length(frame);
        let time = |bits: u64, rate: u32| (bits * 1_000_000_000).div_ceil(u64::from(rate.max(1)));
        time(nominal, self.nominal) + time(data, self.data)
    }
}

/// Bits at the nominal rate and at the data rate, the gap included.
fn length(frame: &CanFrame) -> (u64, u64) {
    let mut wire = Wire::default();
    match *frame {
        CanFrame::Data { identifier, extended, length, .. } => {
            wire.classic(identifier, extended, false, length);
            frame.data().iter().for_each(|byte| wire.push(u32::from(*byte), 8));
            wire.push(u32::from(wire.checksum), 15);
            (wire.bits + TAIL, 0)
        }
        CanFrame::Remote { identifier, extended, length } => {
            wire.classic(identifier, extended, true, length);
            wire.push(u32::from(wire.checksum), 15);
            (wire.bits + TAIL, 0)
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
            wire.push(code(data.len()), 4);
            data.iter().for_each(|byte| wire.push(u32::from(*byte), 8));
            (0..padding).for_each(|_| wire.push(0, 8));
            // A bit of fixed stuffing first and after every four: of stuff count, its parity, checksum.
            let checksum = if data.len() + padding > 16 { 4 + 21 } else { 4 + 17 };
            let fast = wire.bits - arbitration + checksum + 1 + checksum / 4;
            if switched { (arbitration + TAIL, fast) } else { (arbitration + fast + TAIL, 0) }
        }
        CanFrame::Error { .. } => (ERROR_BITS, 0),
    }
}

/// Bytes of CAN FD by length code.
const LENGTHS: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];

/// Length code of CAN FD that has room for so many bytes, up to 64.
fn code(bytes: usize) -> u32 {
    LENGTHS.iter().position(|length| bytes <= usize::from(*length)).unwrap_or(15) as u32
}

/// The bytes that CAN FD sends for so many, up to 64: the rest are filled up.
pub(super) fn padded(bytes: u8) -> u8 {
    LENGTHS[code(usize::from(bytes)) as usize]
}

/// Bits put on the wire, with those that stuffing adds.
#[derive(Default)]
struct Wire {
    bits: u64,
    last: bool,
    run: u32,
    checksum: u16,
}

impl Wire {
    /// Start of frame and all up to the control field.
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

    /// The last `count` bits of a number, the highest first.
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
    fn the_checksum_is_crc_15_can() {
        let mut wire = Wire::default();
        b"123456789".iter().for_each(|byte| wire.push(u32::from(*byte), 8));
        assert_eq!(wire.checksum, 0x059E);
    }

    /// A frame whose fields alternate has no stuffing before its checksum; bounds are those of the books.
    #[test]
    fn lengths_are_those_of_the_standard() {
        let mut seen = (u64::MAX, 0);
        let mut state = 1u64;
        for _ in 0..20_000 {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
            // Few different bytes, so that long runs of equal bits come up.
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

    /// Worked out by hand. SOF 0, 0x555, RTR 0, IDE 0, r0 0, DLC 0001, 0x55: no five equal bits before the
    /// checksum; 27 bits, 15 of checksum, 13 behind, and what the checksum stuffs, at most three.
    #[test]
    fn a_frame_by_hand() {
        let (bits, _) = length(&data(0x555, false, &[0x55]));
        assert!((55..=58).contains(&bits), "{bits}");
        // All zero: a checksum of zero too, 34 zero bits, a bit stuffed after five, then every four more
        // with the stuffed bit breaking each run: 34 bits hold 6 whole fives.
        let (bits, _) = length(&data(0, false, &[]));
        assert_eq!(bits, 34 + 6 + TAIL);
        assert_eq!(
            BitRates { nominal: 500_000, data: 1 }.duration_ns(&data(0, false, &[])),
            106_000
        );
    }

    #[test]
    fn can_fd_runs_its_data_faster() {
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
        assert_eq!(nominal, 17 + TAIL);
        assert!((5 + 512 + 32..=5 + 512 + 34).contains(&fast), "{fast}");
        let (_, short) = length(&frame(1, 16));
        assert!((5 + 128 + 27..=5 + 128 + 29).contains(&short), "{short}");
        let rates = BitRates::FASTEST;
        assert!(rates.duration_ns(&frame(1, 64)) * 3 < rates.duration_ns(&frame(0, 64)));
    }
}
