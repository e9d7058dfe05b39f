//! A package: a signed header, and the image.
//!
//! All values are little-endian. The image begins at offset 512, so that a vector table at its start is aligned.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | magic `JIMG` |
//! | 4 | 2 | version of this layout |
//! | 6 | 2 | length of the header, 512 |
//! | 8 | 4 | number of the board type |
//! | 12 | 4 | version of the image: major (8 bits), minor (8 bits), patch (16 bits), major in the highest bits |
//! | 16 | 4 | anti-rollback counter |
//! | 20 | 4 | length of the image, bytes; a multiple of 8 |
//! | 24 | 4 | CRC-32 (ISO-HDLC) of the image, checked after the transfer and at every start |
//! | 28 | 4 | load address of the image, which is linked for one slot |
//! | 32 | 64 | SHA-512 of the image, checked with the signature |
//! | 96 | 64 | Ed25519 signature of the bytes 0 to 95 |
//! | 160 | 352 | 0 |
//!
//! The signature covers the hash, so the signature of the header is a signature of the image.

use core::fmt;
use crc::{CRC_32_ISO_HDLC, Crc, Table};

/// Length of the header, bytes.
pub const HEADER_BYTES: usize = 512;
/// Bytes of the header that carry information.
pub const USED_BYTES: usize = 160;
/// Bytes that the signature covers.
pub const SIGNED_BYTES: usize = 96;
/// Version of the layout.
pub const LAYOUT: u16 = 1;

const MAGIC: [u8; 4] = *b"JIMG";

/// CRC of images and marks.
pub static CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Returns the CRC of bytes that follow others with this CRC; that of no bytes is 0.
pub fn continue_crc(crc: u32, bytes: &[u8]) -> u32 {
    // The digest begins with its state, before the last inversion and in the other order of bits.
    let mut digest = CRC.digest_with_initial((!crc).reverse_bits());
    digest.update(bytes);
    digest.finalize()
}

/// Version of an image: major.minor.patch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version(pub u32);

impl Version {
    /// Parses `major.minor.patch`; `None` if it is malformed or a part is too large.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split('.');
        let mut next = |limit: u32| parts.next()?.parse().ok().filter(|part: &u32| *part <= limit);
        let version = Self(next(0xFF)? << 24 | next(0xFF)? << 16 | next(0xFFFF)?);
        parts.next().is_none().then_some(version)
    }
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.0 >> 24, self.0 >> 16 & 0xFF, self.0 & 0xFFFF)
    }
}

/// Header of a package.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Number of the board type.
    pub board: u32,
    /// Version of the image.
    pub version: Version,
    /// Anti-rollback counter: a device refuses a package with a smaller one than its image's.
    pub counter: u32,
    /// Length of the image, bytes.
    pub length: u32,
    /// CRC-32 of the image.
    pub crc: u32,
    /// Load address of the image.
    pub address: u32,
    /// SHA-512 of the image.
    pub hash: [u8; 64],
    /// Ed25519 signature of the first [`SIGNED_BYTES`].
    pub signature: [u8; 64],
}

/// Reason why bytes are no header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HeaderError {
    /// No magic, or an unknown layout.
    Unknown,
    /// The length of the image is 0 or no multiple of a double word.
    Length,
}

impl Header {
    /// Parses the first [`USED_BYTES`] of a package. It checks the layout, not the signature.
    ///
    /// # Errors
    /// The magic, the layout or the length is wrong.
    pub fn parse(bytes: &[u8; USED_BYTES]) -> Result<Self, HeaderError> {
        let word = |at: usize| {
            let mut word = [0; 4];
            word.iter_mut().zip(bytes.iter().skip(at)).for_each(|(to, from)| *to = *from);
            u32::from_le_bytes(word)
        };
        let long = |at: usize| {
            let mut long = [0; 64];
            long.iter_mut().zip(bytes.iter().skip(at)).for_each(|(to, from)| *to = *from);
            long
        };
        let layout = u32::from(LAYOUT) | (HEADER_BYTES as u32) << 16;
        if word(0) != u32::from_le_bytes(MAGIC) || word(4) != layout {
            return Err(HeaderError::Unknown);
        }
        let length = word(20);
        if length == 0 || !length.is_multiple_of(super::UNIT_BYTES) {
            return Err(HeaderError::Length);
        }
        Ok(Self {
            board: word(8),
            version: Version(word(12)),
            counter: word(16),
            length,
            crc: word(24),
            address: word(28),
            hash: long(32),
            signature: long(96),
        })
    }

    /// Returns the bytes of the header.
    pub fn emit(&self) -> [u8; HEADER_BYTES] {
        let mut bytes = [0; HEADER_BYTES];
        let layout = u32::from(LAYOUT) | (HEADER_BYTES as u32) << 16;
        let words = [
            u32::from_le_bytes(MAGIC),
            layout,
            self.board,
            self.version.0,
            self.counter,
            self.length,
            self.crc,
            self.address,
        ];
        let words = words.into_iter().flat_map(u32::to_le_bytes);
        let content = words.chain(self.hash).chain(self.signature);
        bytes.iter_mut().zip(content).for_each(|(to, from)| *to = from);
        bytes
    }

    /// Returns the bytes that the signature covers.
    pub fn signed(&self) -> [u8; SIGNED_BYTES] {
        let mut signed = [0; SIGNED_BYTES];
        signed.iter_mut().zip(self.emit()).for_each(|(to, from)| *to = from);
        signed
    }

    /// Returns the number that identifies this package: the CRC-32 of its header.
    pub fn identity(&self) -> u32 {
        CRC.checksum(self.emit().get(..USED_BYTES).unwrap_or_default())
    }

    /// Returns the length of the whole package, bytes.
    pub const fn package_bytes(&self) -> u32 {
        self.length.saturating_add(HEADER_BYTES as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: Header = Header {
        board: 7,
        version: Version(0x0102_0003),
        counter: 4,
        length: 800,
        crc: 5,
        address: 0x0800_0200,
        hash: [6; 64],
        signature: [9; 64],
    };

    fn used(header: &Header) -> [u8; USED_BYTES] {
        header.emit()[..USED_BYTES].try_into().unwrap()
    }

    #[test]
    fn header_emit_then_parse_returns_the_same() {
        assert_eq!(Header::parse(&used(&HEADER)), Ok(HEADER));
        assert_eq!(HEADER.package_bytes(), 1312);
    }

    #[test]
    fn header_parse_with_wrong_magic_layout_or_length_is_refused() {
        for (at, error) in [
            (0, HeaderError::Unknown),
            (4, HeaderError::Unknown),
            (6, HeaderError::Unknown),
            (20, HeaderError::Length),
        ] {
            let mut bytes = used(&HEADER);
            bytes[at] ^= 1;
            assert_eq!(Header::parse(&bytes), Err(error), "{at}");
        }
    }

    #[test]
    fn crc_continued_over_parts_is_that_of_the_whole() {
        let bytes: [u8; 40] = core::array::from_fn(|at| at as u8 * 7);
        let parts = continue_crc(continue_crc(0, &bytes[..13]), &bytes[13..]);
        assert_eq!(parts, CRC.checksum(&bytes));
    }

    #[test]
    fn version_text_round_trips_and_orders() {
        let version = Version::parse("1.2.3").unwrap();
        assert_eq!(version, Version(0x0102_0003));
        assert_eq!(format!("{version}"), "1.2.3");
        assert!(Version::parse("1.10.0") > Version::parse("1.9.9"));
        for wrong in ["", "1", "1.2", "1.2.3.4", "256.0.0", "1.a.0", "-1.0.0"] {
            assert_eq!(Version::parse(wrong), None, "{wrong}");
        }
    }
}
