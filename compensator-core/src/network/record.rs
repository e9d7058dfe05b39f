//! The network record: the format of a network in flash and over CAN.
//!
//! The record is a block of bytes with a fixed layout, little-endian, protected by a CRC. It is separate from the
//! parameter record ([`crate::record`]).
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | magic `FNET` |
//! | 4 | 2 | version of this layout |
//! | 6 | 2 | length of the complete record |
//! | 8 | 1 | number of inputs; 0 if there is no network: the CRC then follows at 12 |
//! | 9 | 1 | number of cells, 8 |
//! | 10 | 1 | bit 0: the record has a stroke range |
//! | 11 | 1 | 0 |
//! | 12 | 4 | sources of the inputs; 0xFF if unused |
//! | 16 | 4 | evaluation period, s |
//! | 20 | 8 | slew, fade |
//! | 28 | 12 | strokes: minimum, maximum, reversal |
//! | 40 | 24 | bounds of the factors on `F_C`, `F_S`, `sigma0`: minimum, maximum |
//! | 64 | 32 | ranges of the inputs: middle, reciprocal of half the width |
//! | 96 | 4 each | weights, in the order of `Network::for_each_weight` |
//! | end - 4 | 4 | CRC-32 (ISO-HDLC) of all bytes before it |
//!
//! A joint without a network has an empty record, because SDO cannot transfer an absent value.

use super::{CELLS, FACTOR_COUNT, JointNetwork, MAX_INPUTS};
use crate::crc32::crc32;
use crate::refusal;
use crate::refusal::ParameterError;
use crate::refusal::reason::Reason;
use core::fmt;
use fields::{put_network, read_network};
use heapless::Vec;

#[cfg(feature = "network")]
#[path = "lstm_network/record_fields.rs"]
mod fields;

#[cfg(not(feature = "network"))]
mod fields {
    use super::{Head, JointNetwork, RecordError};

    pub fn put_network(network: &JointNetwork, _: &mut impl FnMut(&[u8])) {
        match *network {}
    }

    pub fn read_network(_: &[u8], _: Head) -> Result<Option<JointNetwork>, RecordError> {
        Err(RecordError::Unsupported)
    }
}

/// Version of the layout.
pub const VERSION: u16 = 1;

const MAGIC: [u8; 4] = *b"FNET";
/// Offset of the numbers.
pub(super) const NUMBERS_AT: usize = 16;
/// Period, slew, fade, strokes, bounds, ranges.
const NUMBERS: usize = 3 + 3 + 2 * FACTOR_COUNT + 2 * MAX_INPUTS;
/// Those of four gates for each cell, and of the readout.
pub(super) const WEIGHTS: usize = CELLS * 4 * (1 + MAX_INPUTS + CELLS) + FACTOR_COUNT * (1 + CELLS);

/// Length of a record with a network, bytes.
pub const LENGTH: usize = NUMBERS_AT + 4 * (NUMBERS + WEIGHTS) + 4;

/// Length of a record without a network, bytes.
pub const EMPTY_LENGTH: usize = 16;

/// The bytes of a record that say what follows.
#[cfg_attr(not(feature = "network"), allow(dead_code))]
pub(super) struct Head {
    pub inputs: u8,
    pub cells: u8,
    pub choices: u8,
}

/// The bytes of a record.
pub type Record = Vec<u8, LENGTH>;

/// Reason why a record is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordError {
    /// The length, in bytes, differs from the header or is impossible.
    Length(usize),
    /// The record does not start with the magic.
    Magic,
    /// The version is not [`VERSION`].
    Version(u16),
    /// The CRC does not match: the record is damaged or incomplete.
    Crc,
    /// The number of inputs or cells is not supported.
    Size(u8),
    /// A bit of the choices is unknown.
    UnknownChoices(u8),
    /// The source of an input has an unknown number.
    UnknownFeed(u8),
    /// The record has a network, and this program was built without the feature `network`.
    Unsupported,
    /// The record is well-formed, but the network is invalid.
    Refused(ParameterError),
}

impl From<RecordError> for Reason {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Length(found) => refusal!(
                "network's record of {u32} bytes, expected {u32} or {u32}, as in its header",
                found,
                LENGTH,
                EMPTY_LENGTH
            ),
            RecordError::Magic => refusal!("not a network's record"),
            RecordError::Version(found) => {
                refusal!("network's record of version {u32}, expected {u32}", found, VERSION)
            }
            RecordError::Crc => refusal!("network's record is damaged (CRC)"),
            RecordError::Size(found) => refusal!(
                "network of {u32} inputs or cells, at most {u32} inputs and {u32} cells",
                found,
                MAX_INPUTS,
                CELLS
            ),
            RecordError::UnknownChoices(bits) => {
                refusal!("network with unknown choices {hex}", bits)
            }
            RecordError::UnknownFeed(number) => {
                refusal!("network's input has the unknown source number {u32}", number)
            }
            RecordError::Unsupported => {
                refusal!("this program has no networks: build it with the feature `network`")
            }
            RecordError::Refused(error) => error.into(),
        }
    }
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(error) => error.fmt(f),
            other => Reason::from(*other).fmt(f),
        }
    }
}

impl core::error::Error for RecordError {}

impl From<ParameterError> for RecordError {
    fn from(error: ParameterError) -> Self {
        Self::Refused(error)
    }
}

/// Returns true if the bytes start with the magic of a network record.
pub fn claims(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// Writes a network, or an empty record for `None`. Does not validate the network: [`parse`] does.
pub fn emit(network: Option<&JointNetwork>) -> Record {
    let mut record = Record::new();
    let mut put = |bytes: &[u8]| {
        // The constants of the layout guarantee that the bytes fit.
        let _ = record.extend_from_slice(bytes);
    };
    let length = network.map_or(EMPTY_LENGTH, |_| LENGTH) as u16;
    put(&MAGIC);
    put(&VERSION.to_le_bytes());
    put(&length.to_le_bytes());
    match network {
        Some(network) => put_network(network, &mut put),
        None => put(&[0; 4]),
    }
    sealed(record)
}

/// Appends the CRC.
fn sealed(mut record: Record) -> Record {
    let crc = crc32(&record);
    let _ = record.extend_from_slice(&crc.to_le_bytes());
    record
}

/// Reads a record and validates the network. Returns `None` for an empty record.
///
/// # Errors
/// Returns the defect of the record, or the refused field and the reason. Never panics, for any bytes.
pub fn parse(record: &[u8]) -> Result<Option<JointNetwork>, RecordError> {
    let wrong_length = RecordError::Length(record.len());
    let Some((head, _)) = record.split_first_chunk::<12>() else { return Err(wrong_length) };
    if !claims(head) {
        return Err(RecordError::Magic);
    }
    let version = u16::from_le_bytes([head[4], head[5]]);
    if version != VERSION {
        return Err(RecordError::Version(version));
    }
    let (inputs, cells, choices) = (head[8], head[9], head[10]);
    let expected = if inputs == 0 { EMPTY_LENGTH } else { LENGTH };
    let said = usize::from(u16::from_le_bytes([head[6], head[7]]));
    if said != record.len() || said != expected {
        return Err(wrong_length);
    }
    let Some((guarded, crc)) = record.split_last_chunk::<4>() else { return Err(wrong_length) };
    if crc32(guarded).to_le_bytes() != *crc {
        return Err(RecordError::Crc);
    }
    if inputs == 0 {
        return Ok(None);
    }
    read_network(guarded, Head { inputs, cells, choices })
}

#[cfg(all(test, feature = "network"))]
#[path = "record_tests.rs"]
mod tests;
