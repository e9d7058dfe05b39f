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
//! | 16 | 4 | anti-rollback counter: `host-sim sign` takes it from the version |
//! | 20 | 4 | length of the image, bytes; a multiple of 8 |
//! | 24 | 4 | CRC-32 (ISO-HDLC) of the image, checked after the transfer and at every start |
//! | 28 | 4 | load address of the image, which is linked for one slot |
//! | 32 | 4 | identity of the board's wiring |
//! | 36 | 64 | SHA-512 of the image, checked with the signature |
//! | 100 | 64 | Ed25519 signature of the bytes 0 to 99 |
//! | 164 | 348 | 0 |
//!
//! The signature covers the hash, so the signature of the header is a signature of the image.

use core::fmt;
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};

/// Length of the header, bytes.
pub const HEADER_BYTES: usize = 512;
/// Bytes of the header that carry information.
pub const USED_BYTES: usize = SIGNED_BYTES + 64;
/// Bytes that the signature covers.
pub const SIGNED_BYTES: usize = HASH_AT + 64;
/// Version of the layout.
pub const LAYOUT: u16 = 2;

/// Offset of the hash in a header, and of the signature behind it.
pub const HASH_AT: usize = 36;

const MAGIC: u32 = u32::from_le_bytes(*b"JIMG");
/// Version of the layout, and length of the header.
const LAYOUT_WORD: u32 = LAYOUT as u32 | (HEADER_BYTES as u32) << 16;
/// Words in front of the hash.
const WORDS: usize = HASH_AT / 4;

/// CRC of headers, marks, and images while they arrive. Without a table, which would take 1 KB of the image.
pub const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

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

/// Header of a package, without its hash and signature.
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
    /// Identity of the wiring of the board.
    pub wiring: u32,
    /// Number that identifies this package: the CRC-32 of its header. [`Header::signed`] does not use it.
    pub identity: u32,
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
        let mut words = [0; WORDS];
        for (word, part) in words.iter_mut().zip(bytes.as_chunks().0) {
            *word = u32::from_le_bytes(*part);
        }
        let [magic, layout, board, version, counter, length, crc, address, wiring] = words;
        if magic != MAGIC || layout != LAYOUT_WORD {
            return Err(HeaderError::Unknown);
        }
        if length == 0 || !length.is_multiple_of(super::UNIT_BYTES) {
            return Err(HeaderError::Length);
        }
        let (version, identity) = (Version(version), CRC.checksum(bytes));
        Ok(Self { board, version, counter, length, crc, address, wiring, identity })
    }

    /// Returns the bytes that the signature covers, with the SHA-512 of the image.
    pub fn signed(&self, hash: &[u8; 64]) -> [u8; SIGNED_BYTES] {
        let words = [
            MAGIC,
            LAYOUT_WORD,
            self.board,
            self.version.0,
            self.counter,
            self.length,
            self.crc,
            self.address,
            self.wiring,
        ];
        let mut bytes = [0; SIGNED_BYTES];
        let content = words.into_iter().flat_map(u32::to_le_bytes).chain(*hash);
        bytes.iter_mut().zip(content).for_each(|(to, from)| *to = from);
        bytes
    }

    /// Returns the length of the whole package, bytes.
    pub const fn package_bytes(&self) -> u32 {
        self.length.saturating_add(HEADER_BYTES as u32)
    }
}

/// Returns the bytes of a header: what the signature covers, the signature, and zeros.
pub fn emit(signed: &[u8; SIGNED_BYTES], signature: &[u8; 64]) -> [u8; HEADER_BYTES] {
    let mut bytes = [0; HEADER_BYTES];
    let content = signed.iter().chain(signature);
    bytes.iter_mut().zip(content).for_each(|(to, from)| *to = *from);
    bytes
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
        wiring: 8,
        identity: 0,
    };

    fn used(header: &Header) -> [u8; USED_BYTES] {
        emit(&header.signed(&[6; 64]), &[9; 64])[..USED_BYTES].try_into().unwrap()
    }

    #[test]
    fn header_emit_then_parse_returns_the_same() {
        let bytes = used(&HEADER);
        let expected = Header { identity: CRC.checksum(&bytes), ..HEADER };
        assert_eq!(Header::parse(&bytes), Ok(expected));
        assert_eq!(HEADER.package_bytes(), 1312);
        assert_eq!((SIGNED_BYTES, USED_BYTES), (100, 164));
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
        let bytes: [u8; 40] = core::array::from_fn(|at| at as u8 ^ 0x5A);
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
