//! The parameter record: the format of a configuration in flash and over CAN.
//!
//! A record holds a configuration (model and compensator) as a block of bytes, little-endian, protected by a CRC.
//! All values are `f32`. Therefore a model built from a record gives the same bits on the driver and on the host.
//!
//! | offset | size | content |
//! |---|---|---|
//! | 0 | 4 | magic `FRIC` |
//! | 4 | 2 | version of this layout |
//! | 6 | 2 | length of the complete record |
//! | 8 | 1 | law number |
//! | 9 | 1 | choices: bit 0 damping fades, 1 printed extended, 2 allow active |
//! | 10 | 1 | number of terms |
//! | 11 | 8 | term numbers; 0xFF if unused |
//! | 19 | 1 | 0 |
//! | 20 | 28 | envelope, in the order of its fields |
//! | 48 | 32 | compensator, in the order of its fields |
//! | 80 | 4 each | values, in the order of [`ParameterId::ALL`] |
//! | end - 4 | 4 | CRC-32 (ISO-HDLC) of all bytes before it |
//!
//! New parameters are appended to the list. A core reads every record with at most as many parameters as the core
//! has; missing parameters keep their defaults. Version 1 has exactly 41 values. In version 2 the number of values
//! follows from the length.

use crate::configuration::{CompensatorParameters, Configuration};
use crate::crc32::crc32;
use crate::parameters::reason::Reason;
use crate::parameters::table::COUNT;
use crate::parameters::{Choices, Envelope, LawKind, ParameterError, ParameterId, Parameters};
use crate::refusal;
use crate::term::{MAX_TERMS, TermKind};
use core::fmt;

/// Version of the layout that is written. This version and all earlier versions are read.
pub const VERSION: u16 = 2;

/// Number of values in a record of version 1.
const VALUES_OF_VERSION_1: usize = 41;

const MAGIC: [u8; 4] = *b"FRIC";
const CHOICE_BITS: u8 = 0b111;
const TERMS_AT: usize = 11;
const ENVELOPE_AT: usize = 20;
const COMPENSATOR_AT: usize = ENVELOPE_AT + 4 * Envelope::FIELDS;
const VALUES_AT: usize = COMPENSATOR_AT + 4 * CompensatorParameters::FIELDS;
const CRC_AT: usize = VALUES_AT + 4 * COUNT;

/// Length of a written record, bytes. A record of an older core may be shorter.
pub const LENGTH: usize = CRC_AT + 4;

/// Length of a record without values, bytes.
const LEAST_LENGTH: usize = VALUES_AT + 4;

/// Reason why a record is refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordError {
    /// The length, in bytes, differs from the header or is impossible for the version.
    Length(usize),
    /// The record does not start with the magic.
    Magic,
    /// The version is 0 or greater than [`VERSION`].
    Version(u16),
    /// The CRC does not match: the record is damaged or incomplete.
    Crc,
    /// The law number is unknown.
    UnknownLaw(u8),
    /// A bit of the choices is unknown.
    UnknownChoices(u8),
    /// The term number is unknown.
    UnknownTerm(u8),
    /// The term with this number is listed twice, or the law has it.
    RepeatedTerm(u8),
    /// The number of terms exceeds the maximum of a model.
    TooManyTerms(u8),
    /// The record is well-formed, but the parameters are invalid.
    Refused(ParameterError),
}

impl From<RecordError> for Reason {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Length(found) => refusal!(
                "record of {u32} bytes, expected the length in its header, at most {u32}",
                found,
                LENGTH
            ),
            RecordError::Magic => refusal!("not a parameter record"),
            RecordError::Version(found) => {
                refusal!("record version {u32}, expected 1 to {u32}", found, VERSION)
            }
            RecordError::Crc => refusal!("record is damaged (CRC)"),
            RecordError::UnknownLaw(number) => refusal!("unknown law number {u32}", number),
            RecordError::UnknownChoices(bits) => refusal!("unknown choices {hex}", bits),
            RecordError::UnknownTerm(number) => refusal!("unknown term number {u32}", number),
            RecordError::RepeatedTerm(number) => {
                refusal!("term number {u32} is listed twice, or part of the law", number)
            }
            RecordError::TooManyTerms(number) => {
                refusal!("{u32} terms, at most {u32}", number, MAX_TERMS)
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

/// Converts the error of building a model, so that callers need one error type for reading and building.
impl From<ParameterError> for RecordError {
    fn from(error: ParameterError) -> Self {
        Self::Refused(error)
    }
}

/// Writes `source` at `at`. The constants of the layout guarantee that it fits.
fn put(bytes: &mut [u8; LENGTH], at: usize, source: &[u8]) {
    if let Some(place) = bytes.get_mut(at..at + source.len()) {
        place.copy_from_slice(source);
    }
}

fn put_all(bytes: &mut [u8; LENGTH], at: usize, numbers: impl Iterator<Item = f32>) {
    for (index, number) in numbers.enumerate() {
        put(bytes, at + 4 * index, &number.to_le_bytes());
    }
}

fn number(bytes: &[u8], at: usize) -> f32 {
    let mut word = [0; 4];
    if let Some(place) = bytes.get(at..at + 4) {
        word.copy_from_slice(place);
    }
    f32::from_le_bytes(word)
}

/// Writes a configuration as a record. Does not validate it: [`parse`] does.
pub fn emit(configuration: &Configuration) -> [u8; LENGTH] {
    let Configuration { model, compensator } = configuration;
    let mut bytes = [0; LENGTH];
    put(&mut bytes, 0, &MAGIC);
    put(&mut bytes, 4, &VERSION.to_le_bytes());
    put(&mut bytes, 6, &(LENGTH as u16).to_le_bytes());
    let choices = model.choices;
    let bits = u8::from(choices.damping_fades)
        | u8::from(choices.printed_extended) << 1
        | u8::from(choices.allow_active) << 2;
    put(&mut bytes, 8, &[model.law as u8, bits, model.terms.len() as u8]);
    put(&mut bytes, TERMS_AT, &[0xFF; MAX_TERMS]);
    for (index, term) in model.terms.iter().enumerate() {
        put(&mut bytes, TERMS_AT + index, &[*term as u8]);
    }
    put_all(&mut bytes, ENVELOPE_AT, model.envelope.to_array().into_iter());
    put_all(&mut bytes, COMPENSATOR_AT, compensator.to_array().into_iter());
    put_all(&mut bytes, VALUES_AT, ParameterId::ALL.iter().map(|id| model.get(*id)));
    let crc = crc32(&bytes[..CRC_AT]);
    put(&mut bytes, CRC_AT, &crc.to_le_bytes());
    bytes
}

/// Reads a record and validates the configuration.
///
/// # Errors
/// Returns the defect of the record, or the refused parameter and the reason. Never panics, for any bytes.
pub fn parse(record: &[u8]) -> Result<Configuration, RecordError> {
    let wrong_length = RecordError::Length(record.len());
    let Some((head, _)) = record.split_first_chunk::<VALUES_AT>() else {
        return Err(wrong_length);
    };
    if head[..4] != MAGIC {
        return Err(RecordError::Magic);
    }
    let version = u16::from_le_bytes([head[4], head[5]]);
    if !(1..=VERSION).contains(&version) {
        return Err(RecordError::Version(version));
    }
    let length = usize::from(u16::from_le_bytes([head[6], head[7]]));
    let values = length.saturating_sub(LEAST_LENGTH) / 4;
    let legal = (LEAST_LENGTH..=LENGTH).contains(&length)
        && length % 4 == 0
        && (version != 1 || values == VALUES_OF_VERSION_1);
    if length != record.len() || !legal {
        return Err(wrong_length);
    }
    let Some((guarded, crc)) = record.split_last_chunk::<4>() else {
        return Err(wrong_length);
    };
    if crc32(guarded).to_le_bytes() != *crc {
        return Err(RecordError::Crc);
    }
    let bytes = head;
    let law = LawKind::from_number(bytes[8]).ok_or(RecordError::UnknownLaw(bytes[8]))?;
    let mut model = Parameters::new(law);
    if bytes[9] & !CHOICE_BITS != 0 {
        return Err(RecordError::UnknownChoices(bytes[9]));
    }
    model.choices = Choices {
        damping_fades: bytes[9] & 1 != 0,
        printed_extended: bytes[9] & 2 != 0,
        allow_active: bytes[9] & 4 != 0,
    };
    let terms = bytes[10];
    if usize::from(terms) > MAX_TERMS {
        return Err(RecordError::TooManyTerms(terms));
    }
    for code in &bytes[TERMS_AT..TERMS_AT + usize::from(terms)] {
        let kind = TermKind::from_number(*code).ok_or(RecordError::UnknownTerm(*code))?;
        if law.includes(kind) || model.terms.contains(&kind) {
            return Err(RecordError::RepeatedTerm(*code));
        }
        model.add_term(kind);
    }
    let mut envelope = [0.0; Envelope::FIELDS];
    for (index, field) in envelope.iter_mut().enumerate() {
        *field = number(bytes, ENVELOPE_AT + 4 * index);
    }
    model.envelope = Envelope::from_array(envelope);
    let mut compensator = [0.0; CompensatorParameters::FIELDS];
    for (index, field) in compensator.iter_mut().enumerate() {
        *field = number(bytes, COMPENSATOR_AT + 4 * index);
    }
    for (index, id) in ParameterId::ALL.iter().take(values).enumerate() {
        model.set(*id, number(guarded, VALUES_AT + 4 * index));
    }
    let configuration =
        Configuration { model, compensator: CompensatorParameters::from_array(compensator) };
    configuration.validate().map_err(RecordError::Refused)?;
    Ok(configuration)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn configuration() -> Configuration {
        let mut model = Parameters::<f32>::new(LawKind::ImprovedLugre)
            .with(ParameterId::CoulombTorque, 1.5)
            .with(ParameterId::StaticTorque, 2.2)
            .with(ParameterId::PressureCoulomb, 2.4e-6);
        model.add_term(TermKind::TemperatureViscous);
        model.add_term(TermKind::PositionRipple);
        model.choices.damping_fades = true;
        Configuration { model, compensator: CompensatorParameters::default() }
    }

    #[test]
    fn emit_writes_documented_layout() {
        let bytes = emit(&configuration());
        assert_eq!(&bytes[..4], b"FRIC");
        assert_eq!(COMPENSATOR_AT, 48);
        assert_eq!(VALUES_AT, 80);
        assert_eq!(LENGTH, 80 + 4 * COUNT + 4);
        let coulomb = f32::from_le_bytes(bytes[80..84].try_into().unwrap());
        assert_eq!(coulomb, 1.5);
    }

    #[test]
    fn parse_of_emitted_record_returns_same_configuration() {
        let bytes = emit(&configuration());
        assert_eq!(parse(&bytes), Ok(configuration()));
    }

    /// Returns the record of the same configuration from an older core.
    fn shortened(version: u16, values: usize) -> std::vec::Vec<u8> {
        let length = LEAST_LENGTH + 4 * values;
        let mut bytes = emit(&configuration())[..length].to_vec();
        bytes[4..6].copy_from_slice(&version.to_le_bytes());
        bytes[6..8].copy_from_slice(&(length as u16).to_le_bytes());
        let crc = crc32(&bytes[..length - 4]);
        bytes[length - 4..].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    #[test]
    fn parse_with_record_of_older_core_uses_defaults() {
        for (version, values) in [(1, VALUES_OF_VERSION_1), (2, VALUES_OF_VERSION_1), (2, COUNT)] {
            assert_eq!(parse(&shortened(version, values)), Ok(configuration()));
        }
        // Missing values keep their defaults: no effect of side load or pressure.
        let few = parse(&shortened(2, 6)).unwrap();
        assert_eq!(few.model.get(ParameterId::CoulombTorque), 1.5);
        assert_eq!(few.model.get(ParameterId::PressureCoulomb), 0.0);
        // Version 1 has one length, and the length must match the header.
        for wrong in [shortened(1, COUNT), shortened(2, 41)[..240].to_vec()] {
            assert_eq!(parse(&wrong), Err(RecordError::Length(wrong.len())));
        }
        for unknown in [0, VERSION + 1, u16::MAX] {
            assert_eq!(parse(&shortened(unknown, COUNT)), Err(RecordError::Version(unknown)));
        }
    }

    /// Returns the error of a record with this byte, sealed again.
    fn error_with(at: usize, byte: u8) -> RecordError {
        let mut bytes = emit(&configuration());
        bytes[at] = byte;
        let crc = crc32(&bytes[..CRC_AT]);
        bytes[CRC_AT..].copy_from_slice(&crc.to_le_bytes());
        parse(&bytes).unwrap_err()
    }

    #[test]
    fn parse_with_unknown_or_repeated_entry_names_it() {
        let ripple = TermKind::PositionRipple as u8;
        let included = TermKind::ALL.iter().find(|kind| LawKind::ImprovedLugre.includes(**kind));
        let included = *included.unwrap() as u8;
        for (at, byte, error) in [
            (8, 0xFE, RecordError::UnknownLaw(0xFE)),
            (9, 0b1001, RecordError::UnknownChoices(0b1001)),
            (10, 9, RecordError::TooManyTerms(9)),
            (TERMS_AT, 0xFE, RecordError::UnknownTerm(0xFE)),
            (TERMS_AT, ripple, RecordError::RepeatedTerm(ripple)),
            (TERMS_AT, included, RecordError::RepeatedTerm(included)),
        ] {
            assert_eq!(error_with(at, byte), error);
        }
    }

    #[test]
    fn parse_with_any_single_bit_error_returns_error() {
        let bytes = emit(&configuration());
        // Under Miri a bit takes 50 ms, so only every 97th is tested there.
        for bit in (0..LENGTH * 8).step_by(if cfg!(miri) { 97 } else { 1 }) {
            let mut damaged = bytes;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(parse(&damaged).is_err(), "bit {bit}");
        }
    }

    #[test]
    fn parse_with_invalid_parameter_names_the_field() {
        let mut wrong = configuration();
        wrong.model.set(ParameterId::StaticTorque, 1.0);
        match parse(&emit(&wrong)) {
            Err(RecordError::Refused(error)) => assert_eq!(error.field, "static_torque"),
            other => panic!("{other:?}"),
        }
    }

    proptest! {
        #[test]
        fn parse_of_random_bytes_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..LENGTH + 8)) {
            prop_assert!(parse(&bytes).is_err());
        }

        #[test]
        fn parse_of_random_bytes_with_valid_crc_never_panics(mut bytes in proptest::collection::vec(any::<u8>(), LENGTH)) {
            bytes[..4].copy_from_slice(&MAGIC);
            bytes[4..6].copy_from_slice(&VERSION.to_le_bytes());
            bytes[6..8].copy_from_slice(&(LENGTH as u16).to_le_bytes());
            let crc = crc32(&bytes[..CRC_AT]);
            bytes[CRC_AT..].copy_from_slice(&crc.to_le_bytes());
            if let Ok(configuration) = parse(&bytes) {
                prop_assert!(configuration.validate().is_ok());
            }
        }
    }
}
