//! How a parameter set lies in its slot.
//!
//! Everything is little-endian and comes in double words of 8 bytes.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | magic `JSET` |
//! | 4 | 2 | version of this layout |
//! | 6 | 2 | bytes of payload |
//! | 8 | 4 | sequence number |
//! | 12 | 4 | 0 |
//! | 16 | 4 | the commit, programmed last: CRC-32 (ISO-HDLC) of all the rest |
//! | 20 | 4 | the same, inverted: so a commit is never all ones, which is what erased flash reads as |
//! | 24 | .. | payload, filled up with 0 to a double word; the filling is under the CRC too |
//!
//! A double word is programmed as a whole or torn; the commit is one, so it is there or it is not.
//! CRC-32 finds every error of one to three bits in a slot of this length, and misses one in 4e9 of
//! those that a torn or half-erased page makes.

use crc::{CRC_32_ISO_HDLC, Crc, Digest, NoTable};

/// Version of the layout that is written and read. Slots of version 1 had a page each: where one of them ended, a slot
/// begins now, and the set found there may be the older of two.
pub const VERSION: u16 = 2;

/// Bytes of a double word: what is programmed at a time.
pub const UNIT: usize = 8;

/// A double word as an erase leaves it.
pub const ERASED: [u8; UNIT] = [0xFF; UNIT];

/// Offset of the commit.
pub const COMMIT_AT: u32 = 16;

/// Offset of the payload.
pub const PAYLOAD_AT: u32 = 24;

const MAGIC: [u8; 4] = *b"JSET";

static CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// What stands before the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Head {
    /// Version of the layout.
    pub version: u16,
    /// Bytes of payload.
    pub length: u16,
    /// Sequence number: the newer set has the next one.
    pub sequence: u32,
}

impl Head {
    /// Its two double words.
    pub fn emit(&self) -> [[u8; UNIT]; 2] {
        let [m0, m1, m2, m3] = MAGIC;
        let [v0, v1] = self.version.to_le_bytes();
        let [l0, l1] = self.length.to_le_bytes();
        let [s0, s1, s2, s3] = self.sequence.to_le_bytes();
        [[m0, m1, m2, m3, v0, v1, l0, l1], [s0, s1, s2, s3, 0, 0, 0, 0]]
    }

    /// Reads it; `None` where the magic is not there. Whether the rest is true, the commit says.
    pub fn parse(first: &[u8; UNIT], second: &[u8; UNIT]) -> Option<Self> {
        let [m0, m1, m2, m3, v0, v1, l0, l1] = *first;
        let [s0, s1, s2, s3, ..] = *second;
        ([m0, m1, m2, m3] == MAGIC).then_some(Self {
            version: u16::from_le_bytes([v0, v1]),
            length: u16::from_le_bytes([l0, l1]),
            sequence: u32::from_le_bytes([s0, s1, s2, s3]),
        })
    }
}

/// The commit, made up as the double words of a slot go by, its own left out.
pub struct Commit(Digest<'static, u32, NoTable>);

impl Commit {
    /// Before the first double word.
    pub fn begin() -> Self {
        Self(CRC.digest())
    }

    /// Takes the next double word.
    pub fn take(&mut self, unit: &[u8; UNIT]) {
        self.0.update(unit);
    }

    /// The double word that commits all that was taken.
    pub fn emit(self) -> [u8; UNIT] {
        let crc = self.0.finalize();
        let [a, b, c, d] = crc.to_le_bytes();
        let [e, f, g, h] = (!crc).to_le_bytes();
        [a, b, c, d, e, f, g, h]
    }
}

/// The double words of a slot with their offsets, head and payload, without the commit.
pub fn units<'a>(
    head: &'a [[u8; UNIT]; 2],
    payload: &'a [u8],
) -> impl Iterator<Item = (u32, [u8; UNIT])> + 'a {
    let heads = (0..).step_by(UNIT).zip(head.iter().copied());
    let body = (PAYLOAD_AT..).step_by(UNIT).zip(payload.chunks(UNIT).map(|chunk| {
        let mut unit = [0; UNIT];
        for (place, byte) in unit.iter_mut().zip(chunk) {
            *place = *byte;
        }
        unit
    }));
    heads.chain(body)
}
