//! Layout of a parameter set in its slot.
//!
//! All values are little-endian; everything is programmed in double words of 8 bytes.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | magic `JSET` |
//! | 4 | 2 | version of this layout |
//! | 6 | 2 | bytes of payload |
//! | 8 | 4 | sequence number |
//! | 12 | 4 | 0 |
//! | 16 | 4 | the commit, programmed last: CRC-32 (ISO-HDLC) of everything else |
//! | 20 | 4 | the same, inverted: a commit is never all ones, which is what erased flash reads as |
//! | 24 | .. | payload, padded with 0 to a double word; the CRC covers the padding |
//! | .. | .. | trend of the learnt levels (`trend.rs`), or erased |
//! | .. | 480 | records of the home (`home_record.rs`), or erased; none in a slot of one page |
//! | .. | 48 | at the end of the slot: a copy of the identity (`identity.rs`) |
//!
//! A double word is either programmed completely or torn. The commit is one double word, so it is either
//! valid or not. CRC-32 detects every error of one to three bits in a slot of this length. Of other errors,
//! such as torn or half-erased pages, it misses one in 4e9.

use crc::{CRC_32_ISO_HDLC, Crc, Digest, NoTable};

/// Version of the layout. In version 1 a slot had one page, so the second slot began at another offset.
pub const VERSION: u16 = 2;

/// Length of a double word, the unit of programming, bytes.
pub const UNIT_BYTES: usize = 8;

/// A double word as an erase leaves it.
pub const ERASED: [u8; UNIT_BYTES] = [0xFF; UNIT_BYTES];

/// Offset of the commit.
pub const COMMIT_AT: u32 = 16;

/// Offset of the payload.
pub const PAYLOAD_AT: u32 = 24;

const MAGIC: [u8; 4] = *b"JSET";

static CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Header of a slot, before the payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SlotHeader {
    /// Version of the layout.
    pub version: u16,
    /// Bytes of payload.
    pub length: u16,
    /// Sequence number; each save increments it.
    pub sequence: u32,
}

impl SlotHeader {
    /// Returns the header as two double words.
    pub fn emit(&self) -> [[u8; UNIT_BYTES]; 2] {
        let [m0, m1, m2, m3] = MAGIC;
        let [v0, v1] = self.version.to_le_bytes();
        let [l0, l1] = self.length.to_le_bytes();
        let [s0, s1, s2, s3] = self.sequence.to_le_bytes();
        [[m0, m1, m2, m3, v0, v1, l0, l1], [s0, s1, s2, s3, 0, 0, 0, 0]]
    }

    /// Parses a header; `None` without the magic. The commit verifies the other fields.
    pub fn parse(first: &[u8; UNIT_BYTES], second: &[u8; UNIT_BYTES]) -> Option<Self> {
        let [m0, m1, m2, m3, v0, v1, l0, l1] = *first;
        let [s0, s1, s2, s3, ..] = *second;
        ([m0, m1, m2, m3] == MAGIC).then_some(Self {
            version: u16::from_le_bytes([v0, v1]),
            length: u16::from_le_bytes([l0, l1]),
            sequence: u32::from_le_bytes([s0, s1, s2, s3]),
        })
    }
}

/// Computes the commit from the double words of a slot, without the commit itself.
pub struct Commit(Digest<'static, u32, NoTable>);

impl Commit {
    /// Starts a new computation.
    pub fn begin() -> Self {
        Self(CRC.digest())
    }

    /// Adds the next double word.
    pub fn update(&mut self, unit: &[u8; UNIT_BYTES]) {
        self.0.update(unit);
    }

    /// Returns the double word that commits everything added so far.
    pub fn emit(self) -> [u8; UNIT_BYTES] {
        let crc = self.0.finalize();
        let [a, b, c, d] = crc.to_le_bytes();
        let [e, f, g, h] = (!crc).to_le_bytes();
        [a, b, c, d, e, f, g, h]
    }
}

/// Returns the CRC-32 of some bytes.
pub(super) fn crc(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}

/// Returns the double words of header and payload with their offsets, without the commit.
pub fn units<'a>(
    head: &'a [[u8; UNIT_BYTES]; 2],
    payload: &'a [u8],
) -> impl Iterator<Item = (u32, [u8; UNIT_BYTES])> + 'a {
    let heads = (0..).step_by(UNIT_BYTES).zip(head.iter().copied());
    let body = (PAYLOAD_AT..).step_by(UNIT_BYTES).zip(payload.chunks(UNIT_BYTES).map(|chunk| {
        let mut unit = [0; UNIT_BYTES];
        for (place, byte) in unit.iter_mut().zip(chunk) {
            *place = *byte;
        }
        unit
    }));
    heads.chain(body)
}
