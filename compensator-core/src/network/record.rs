//! The network's record: weights as they lie in flash and travel over CAN.
//!
//! A block of bytes of fixed layout beside the parameter record ([`crate::record`]), little-endian, guarded by a CRC.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | magic `FNET` |
//! | 4 | 2 | version of this layout |
//! | 6 | 2 | length of the whole record |
//! | 8 | 1 | number of inputs; 0 for no network, and then the CRC follows at 12 |
//! | 9 | 1 | number of cells, 8 |
//! | 10 | 1 | bit 0: strokes are watched |
//! | 11 | 1 | 0 |
//! | 12 | 4 | what the inputs are fed with, unused ones 0xFF |
//! | 16 | 4 | time from one evaluation to the next, s |
//! | 20 | 8 | slew, fade |
//! | 28 | 12 | strokes: least, most, reversal |
//! | 40 | 24 | bounds of the factors on `F_C`, `F_S`, `sigma0`: least, most |
//! | 64 | 32 | ranges of the inputs: middle, one over half the width |
//! | 96 | 4 each | weights, in the order of [`Network::for_each_weight`] |
//! | end - 4 | 4 | CRC-32 (ISO-HDLC) of all before |
//!
//! A joint without a network says so in a record too: SDO has no word for nothing.

use super::joint::{CELLS, Feed, JointNetwork, MOST_INPUTS};
use super::{FACTORS, FactorBounds, InputRange, Lstm, Network, Readout, StrokeRange};
use crate::refusal::ParameterError;
use core::fmt;
use heapless::Vec;

/// Version of the layout that is written and read.
pub const VERSION: u16 = 1;

const MAGIC: [u8; 4] = *b"FNET";
const NO_FEED: u8 = 0xFF;
const NUMBERS_AT: usize = 16;
/// Period, slew, fade, strokes, bounds, ranges.
const NUMBERS: usize = 3 + 3 + 2 * FACTORS + 2 * MOST_INPUTS;
const WEIGHTS: usize = Network::<f32, MOST_INPUTS, CELLS>::WEIGHTS;

/// Length in bytes of the record of a network.
pub const LENGTH: usize = NUMBERS_AT + 4 * (NUMBERS + WEIGHTS) + 4;

/// Length in bytes of a record that says there is none.
pub const LENGTH_OF_NONE: usize = 16;

const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// A record.
pub type Record = Vec<u8, LENGTH>;

/// Why a record was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordError {
    /// It has this many bytes: not what it says itself, or none a record can have.
    Length(usize),
    /// It does not begin with the magic.
    Magic,
    /// It has this version, and not [`VERSION`].
    Version(u16),
    /// The CRC does not match: damaged, or half-written.
    Crc,
    /// So many inputs, or cells, no driver's network has.
    Size(u8),
    /// An input is fed with something of this number, which is not known.
    UnknownFeed(u8),
    /// Well-formed, but refused.
    Refused(ParameterError),
}

impl fmt::Display for RecordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length(found) => write!(
                f,
                "network's record of {found} bytes, expected what it says, {LENGTH} or {LENGTH_OF_NONE}"
            ),
            Self::Magic => f.write_str("not a network's record"),
            Self::Version(found) => {
                write!(f, "network's record of version {found}, expected {VERSION}")
            }
            Self::Crc => f.write_str("network's record is damaged (CRC)"),
            Self::Size(found) => write!(
                f,
                "network of {found} inputs or cells, at most {MOST_INPUTS} inputs and {CELLS} cells"
            ),
            Self::UnknownFeed(number) => {
                write!(f, "network's input is fed with number {number}, which is unknown")
            }
            Self::Refused(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for RecordError {}

impl From<ParameterError> for RecordError {
    fn from(error: ParameterError) -> Self {
        Self::Refused(error)
    }
}

/// Whether these bytes claim to be a network's record.
pub fn claims(bytes: &[u8]) -> bool {
    bytes.starts_with(&MAGIC)
}

/// Writes a network, or that there is none, as a record. It is not validated: [`parse`] does that.
pub fn emit(network: Option<&JointNetwork>) -> Record {
    let mut record = Record::new();
    let mut put = |bytes: &[u8]| {
        // The layout's constants keep it within the record.
        let _ = record.extend_from_slice(bytes);
    };
    let length = network.map_or(LENGTH_OF_NONE, |_| LENGTH) as u16;
    put(&MAGIC);
    put(&VERSION.to_le_bytes());
    put(&length.to_le_bytes());
    let Some(JointNetwork { feeds, period_s, strokes, network }) = network else {
        put(&[0; 4]);
        return sealed(record);
    };
    put(&[feeds.len() as u8, CELLS as u8, strokes.is_some().into(), 0]);
    let mut codes = [NO_FEED; MOST_INPUTS];
    for (code, feed) in codes.iter_mut().zip(feeds) {
        *code = feed.number().unwrap_or(NO_FEED);
    }
    put(&codes);
    let strokes = strokes.map_or([0.0; 3], |range| [range.least, range.most, range.reversal]);
    let mut number = |value: f32| put(&value.to_le_bytes());
    [*period_s, network.slew, network.fade].into_iter().chain(strokes).for_each(&mut number);
    network.bounds.iter().flat_map(|b| [b.least, b.most]).for_each(&mut number);
    network.inputs.iter().flat_map(|r| [r.middle, r.per_unit]).for_each(&mut number);
    network.for_each_weight(number);
    sealed(record)
}

/// With its CRC behind it.
fn sealed(mut record: Record) -> Record {
    let crc = CRC.checksum(&record);
    let _ = record.extend_from_slice(&crc.to_le_bytes());
    record
}

/// Reads a record and validates what is in it; `None` of one that says there is no network.
///
/// # Errors
/// Says what is wrong with the record, or what of the network is refused and why. Never panics, whatever the bytes.
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
    let [inputs, cells, choices, _] = [head[8], head[9], head[10], head[11]];
    let expected = if inputs == 0 { LENGTH_OF_NONE } else { LENGTH };
    let said = usize::from(u16::from_le_bytes([head[6], head[7]]));
    if said != record.len() || said != expected {
        return Err(wrong_length);
    }
    let Some((guarded, crc)) = record.split_last_chunk::<4>() else { return Err(wrong_length) };
    if CRC.checksum(guarded).to_le_bytes() != *crc {
        return Err(RecordError::Crc);
    }
    if inputs == 0 {
        return Ok(None);
    }
    for (found, most) in [(inputs, MOST_INPUTS), (cells, CELLS)] {
        if usize::from(found) > most {
            return Err(RecordError::Size(found));
        }
    }
    if usize::from(cells) != CELLS {
        return Err(RecordError::Size(cells));
    }
    let mut feeds = Vec::new();
    for code in guarded.iter().skip(12).take(usize::from(inputs)) {
        let feed = Feed::from_number(*code).ok_or(RecordError::UnknownFeed(*code))?;
        let _ = feeds.push(feed);
    }
    let words = guarded.get(NUMBERS_AT..).unwrap_or_default().as_chunks::<4>().0;
    let mut numbers = words.iter().map(|word| f32::from_le_bytes(*word));
    let mut next = || numbers.next().unwrap_or_default();
    let period_s = next();
    let (slew, fade) = (next(), next());
    let (least, most, reversal) = (next(), next(), next());
    let strokes = (choices & 1 != 0).then_some(StrokeRange { least, most, reversal, period_s });
    let bounds = [(); FACTORS].map(|()| {
        let (least, most) = (next(), next());
        FactorBounds { least, most }
    });
    let inputs = [(); MOST_INPUTS].map(|()| {
        let (middle, per_unit) = (next(), next());
        InputRange { middle, per_unit }
    });
    let mut network =
        Network { inputs, lstm: Lstm::zero(), readout: Readout::zero(), bounds, slew, fade };
    network.set_weights(numbers);
    let network = JointNetwork { feeds, period_s, strokes, network };
    network.validate()?;
    Ok(Some(network))
}

#[cfg(test)]
#[path = "record_tests.rs"]
mod tests;
