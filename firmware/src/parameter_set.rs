//! The complete parameter set of a joint driver: friction model, network, motor, thresholds, watch, sensors.
//!
//! The parts are validated, committed and stored together and identified by one CRC. A driver therefore
//! never combines a new friction model with the thresholds of another joint. Encoding: the friction record
//! of the core, then the values of motor, thresholds, watch and sensors as little-endian `f32` in field order, then
//! the network's record if there is one.

use crate::control::MotorParameters;
use crate::control::PERIOD_S;
use crate::sensors::SensorParameters;
use crate::supervisor::Thresholds;
use crate::watch::WatchParameters;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::crc32::Crc32;
use compensator_core::network::record as network_record;
use compensator_core::network::{FactorSupplier, JointNetwork};
use compensator_core::parameters::Text;
use compensator_core::parameters::reason::Reason;
use compensator_core::record::{self, RecordError};
use compensator_core::refusal;
use compensator_core::text;
use compensator_core::{Compensator, LawKind, ParameterError, Parameters};
use core::cell::Cell;
use core::ops::{Deref, DerefMut};
use heapless::Vec;

/// Number of values of motor, thresholds, watch and sensors.
pub const DRIVE_VALUE_COUNT: usize = MotorParameters::FIELDS
    + Thresholds::FIELDS
    + WatchParameters::FIELDS
    + SensorParameters::FIELDS;
/// Places of the parts among these values.
const THRESHOLDS_AT: usize = MotorParameters::FIELDS;
const WATCH_AT: usize = THRESHOLDS_AT + Thresholds::FIELDS;
const SENSORS_AT: usize = WATCH_AT + WatchParameters::FIELDS;

/// Numbers of these values, part by part, in the sets of the version before: each part ends at the last parameter that it had.
const FORMER_COUNTS: [usize; 4] = [25, 23, 6, 17];
/// Length of these values, bytes.
const FORMER_DRIVE_BYTES: usize =
    4 * (FORMER_COUNTS[0] + FORMER_COUNTS[1] + FORMER_COUNTS[2] + FORMER_COUNTS[3]);

/// Length of these values, bytes.
pub const DRIVE_RECORD_BYTES: usize = 4 * DRIVE_VALUE_COUNT;
/// Length of a set without a network, bytes.
pub const SET_BYTES: usize = record::LENGTH + DRIVE_RECORD_BYTES;
/// Length of a set with a network, bytes.
pub const MAX_SET_BYTES: usize = SET_BYTES + network_record::LENGTH;

with_defaults! {
    /// The complete parameters of a joint driver.
    #[derive(Debug, PartialEq)]
    pub struct ParameterSet {
        /// Friction model and compensator.
        pub friction: Configuration = Configuration {
            model: Parameters::new(LawKind::Lugre),
            compensator: CompensatorParameters::default(),
        },
        /// Network that supplies the model's friction levels and stiffness, if one is used.
        pub network: Option<JointNetwork>,
        /// Motor and current loop.
        pub motor: MotorParameters,
        /// Thresholds of the supervisor.
        pub thresholds: Thresholds,
        /// Parameters of the model watch.
        pub watch: WatchParameters,
        /// Constants of the sensors.
        pub sensors: SensorParameters,
    }
    /// The set in use if nothing is stored: the plain LuGre law with default values.
    // Not inlined: every call would add 800 bytes of constants to an image.
    #[inline(never)]
}

impl Clone for ParameterSet {
    fn clone(&self) -> Self {
        let mut copy = Self::default();
        copy.clone_from(self);
        copy
    }

    /// Copies part by part: a temporary set would take 3 KB of the driver's stack.
    fn clone_from(&mut self, from: &Self) {
        self.friction.clone_from(&from.friction);
        self.network = from.network.clone();
        self.motor = from.motor;
        self.thresholds = from.thresholds;
        self.watch = from.watch;
        self.sensors = from.sensors;
    }
}

/// Reason why an encoded set was refused.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetError {
    /// Its length, bytes, is not that of a set.
    Length(usize),
    /// The friction record is refused.
    Record(RecordError),
    /// The network's record is refused.
    Network(network_record::RecordError),
    /// A value of motor, thresholds, watch or sensors is refused.
    Drive(ParameterError),
}

impl From<SetError> for Reason {
    fn from(error: SetError) -> Self {
        match error {
            SetError::Length(found) => refusal!(
                "parameter set of {u32} bytes, expected {u32}, or {u32} with a network",
                found,
                SET_BYTES,
                MAX_SET_BYTES
            ),
            SetError::Record(error) => error.into(),
            SetError::Network(error) => error.into(),
            SetError::Drive(error) => error.into(),
        }
    }
}

impl ParameterSet {
    /// Names of the parameters that commissioning determines, of [`MotorParameters::NAMES`]: the wiring of
    /// motor, encoder and gear.
    pub const WIRING_PARAMETERS: [&str; 10] = [
        "pole_pairs",
        "gear_ratio",
        "joint_direction",
        "resistance_ohm",
        "inductance_d_h",
        "inductance_q_h",
        "torque_constant_nm_per_a",
        "encoder_offset_rad",
        "encoder_direction",
        "encoder_delay_s",
    ];

    /// Checks all parts, the network against its law, and the motor against the compensator.
    ///
    /// # Errors
    /// Returns the first refused parameter.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.friction.validate()?;
        if let Some(network) = &self.network {
            network.validate()?;
            JointNetwork::validate_with(&self.friction.model)?;
        }
        self.motor.validate()?;
        self.motor.validate_with(&self.friction.compensator)?;
        self.thresholds.validate()?;
        self.watch.validate()?;
        self.sensors.validate()
    }

    /// Checks motor, thresholds, watch and sensors, each separately.
    ///
    /// # Errors
    /// Returns the first refused parameter.
    pub fn validate_drive(&self) -> Result<(), ParameterError> {
        self.motor.validate()?;
        self.thresholds.validate()?;
        self.watch.validate()?;
        self.sensors.validate()
    }

    /// Checks that a current loop can be built from the set.
    ///
    /// # Errors
    /// Returns the parameter that prevents it.
    pub fn check_buildable(&self) -> Result<(), ParameterError> {
        Compensator::<f32>::build(&self.friction, PERIOD_S)?;
        if let Some(network) = &self.network {
            FactorSupplier::<f32>::build(network, self.friction.compensator.hold_s)?;
        }
        self.motor.build(PERIOD_S).map(|_| ())
    }

    /// Returns the CRC of the values of [`Self::WIRING_PARAMETERS`], of the sign of the shunts, and of the encoder if it is
    /// not an AS5047P; never 0. A joint stays commissioned if other parameters change.
    pub fn wiring_crc(&self) -> u32 {
        const WIRING: [Text; 10] = Text::all(ParameterSet::WIRING_PARAMETERS);
        let mut digest = Crc32::new();
        for (name, number) in MotorParameters::TEXTS.iter().zip(self.motor.to_array()) {
            if WIRING.contains(name) {
                digest.update(&number.to_le_bytes());
            }
        }
        let sensors = &self.sensors;
        digest.update(&sensors.shunt_sign.to_le_bytes());
        // The electrical zero belongs to an encoder. The CRC of a joint with that of the board does not depend on it.
        if sensors.encoder_kind != 0.0 {
            for value in [
                sensors.encoder_kind,
                sensors.abz_lines,
                sensors.hall_order,
                sensors.hall_offset_rad,
                sensors.biss_bits,
            ] {
                digest.update(&value.to_le_bytes());
            }
        }
        digest.value().max(1)
    }

    /// Returns the encoded set.
    pub fn emit(&self) -> Vec<u8, MAX_SET_BYTES> {
        let mut bytes = Vec::new();
        // The capacity is the sum of the parts.
        let _ = bytes.extend_from_slice(&record::emit(&self.friction));
        let _ = bytes.extend_from_slice(&self.emit_drive());
        if self.network.is_some() {
            let _ = bytes.extend_from_slice(&network_record::emit(self.network.as_ref()));
        }
        bytes
    }

    /// Returns the encoded values of motor, thresholds, watch and sensors.
    pub fn emit_drive(&self) -> [u8; DRIVE_RECORD_BYTES] {
        let mut bytes = [0; DRIVE_RECORD_BYTES];
        put_numbers(&mut bytes, 0, &self.motor.to_array());
        put_numbers(&mut bytes, THRESHOLDS_AT, &self.thresholds.to_array());
        put_numbers(&mut bytes, WATCH_AT, &self.watch.to_array());
        put_numbers(&mut bytes, SENSORS_AT, &self.sensors.to_array());
        bytes
    }

    /// Parses a set and validates it.
    ///
    /// # Errors
    /// Returns what is wrong with the encoding, or the refused parameter and the reason.
    pub fn parse(bytes: &[u8]) -> Result<Self, SetError> {
        let mut set = Self::default();
        set.read(bytes).map(|()| set)
    }

    /// Replaces all parts by those of an encoded set, and validates them.
    ///
    /// # Errors
    /// As [`Self::parse`]. Some parts may have been replaced then.
    #[inline(never)]
    pub fn read(&mut self, bytes: &[u8]) -> Result<(), SetError> {
        let wrong_length = SetError::Length(bytes.len());
        let split = bytes.split_last_chunk::<{ network_record::LENGTH }>();
        let values = match split.filter(|(_, last)| network_record::claims(*last)) {
            Some((values, network)) => {
                self.network = network_record::parse(network).map_err(SetError::Network)?;
                values
            }
            None => {
                self.network = None;
                bytes
            }
        };
        if let Some((friction, former)) = values
            .split_last_chunk::<FORMER_DRIVE_BYTES>()
            .filter(|(friction, _)| friction.len() == record::LENGTH)
        {
            self.friction = record::parse(friction).map_err(SetError::Record)?;
            self.set_former_drive(former);
        } else {
            let (friction, drive) =
                values.split_last_chunk::<DRIVE_RECORD_BYTES>().ok_or(wrong_length)?;
            self.friction = record::parse(friction).map_err(SetError::Record)?;
            self.set_drive(drive);
        }
        self.validate().map_err(SetError::Drive)
    }

    /// Builds a set from a friction model, a network and the encoded other values. Nothing is checked.
    pub fn with_drive(
        friction: Configuration,
        network: Option<JointNetwork>,
        drive: &[u8; DRIVE_RECORD_BYTES],
    ) -> Self {
        let mut set = Self { friction, network, ..Self::default() };
        set.set_drive(drive);
        set
    }

    /// Replaces motor, thresholds, watch and sensors by their encoded values. Nothing is checked.
    pub fn set_drive(&mut self, drive: &[u8; DRIVE_RECORD_BYTES]) {
        let mut motor = [0.0; MotorParameters::FIELDS];
        let mut thresholds = [0.0; Thresholds::FIELDS];
        let mut watch = [0.0; WatchParameters::FIELDS];
        let mut sensors = [0.0; SensorParameters::FIELDS];
        read_numbers(drive, 0, &mut motor);
        read_numbers(drive, THRESHOLDS_AT, &mut thresholds);
        read_numbers(drive, WATCH_AT, &mut watch);
        read_numbers(drive, SENSORS_AT, &mut sensors);
        self.motor = MotorParameters::from_array(motor);
        self.thresholds = Thresholds::from_array(thresholds);
        self.watch = WatchParameters::from_array(watch);
        self.sensors = SensorParameters::from_array(sensors);
    }

    /// Replaces motor, thresholds, watch and sensors by the values of a set of the version before, and by the defaults of the
    /// parameters that it did not have.
    #[inline(never)]
    fn set_former_drive(&mut self, former: &[u8; FORMER_DRIVE_BYTES]) {
        self.motor = MotorParameters::default();
        self.thresholds = Thresholds::default();
        self.watch = WatchParameters::default();
        self.sensors = SensorParameters::default();
        let mut drive = self.emit_drive();
        let mut words = former.as_chunks::<4>().0.iter();
        for (at, count) in [0, THRESHOLDS_AT, WATCH_AT, SENSORS_AT].into_iter().zip(FORMER_COUNTS) {
            let places = drive.as_chunks_mut::<4>().0.iter_mut().skip(at).take(count);
            for (place, word) in places.zip(&mut words) {
                *place = *word;
            }
        }
        self.set_drive(&drive);
    }

    /// Returns the first quantity with which this set may compensate more friction than another one, or that its network sets.
    pub fn larger_quantity(&self, other: &Self) -> Option<Text> {
        if self.network.is_some() && self.network != other.network {
            return Some(text!("network"));
        }
        self.friction.larger_quantity(&other.friction)
    }

    /// Returns the CRC-32 that identifies the set. The CRCs of the contained records are left out: a CRC
    /// over data and its own CRC is a constant, so a record would not contribute.
    #[inline(never)]
    pub fn crc(&self) -> u32 {
        let record = record::emit(&self.friction);
        let mut digest = Crc32::new();
        digest.update(record.split_last_chunk::<4>().map_or(&record[..], |(guarded, _)| guarded));
        digest.update(&self.emit_drive());
        if self.network.is_some() {
            let record = network_record::emit(self.network.as_ref());
            digest.update(record.split_last_chunk::<4>().map_or(&record, |(guarded, _)| guarded));
        }
        digest.value()
    }
}

/// A set with its CRC, which is computed once after a change: it takes as long as several periods of the current loop.
#[derive(Clone, Debug, Default)]
pub struct IdentifiedSet {
    set: ParameterSet,
    crc: Cell<Option<u32>>,
}

impl IdentifiedSet {
    /// Returns [`ParameterSet::crc`].
    pub fn crc(&self) -> u32 {
        let crc = self.crc.get().unwrap_or_else(|| self.set.crc());
        self.crc.set(Some(crc));
        crc
    }

    /// Copies another set, with its CRC if that is known.
    #[inline(never)]
    pub fn copy_from(&mut self, from: &Self) {
        self.set.clone_from(&from.set);
        self.crc.clone_from(&from.crc);
    }
}

impl Deref for IdentifiedSet {
    type Target = ParameterSet;

    fn deref(&self) -> &ParameterSet {
        &self.set
    }
}

impl DerefMut for IdentifiedSet {
    /// Returns the set, whose CRC is then unknown.
    fn deref_mut(&mut self) -> &mut ParameterSet {
        self.crc.set(None);
        &mut self.set
    }
}

/// Writes numbers as little-endian words, from this place on.
#[inline(never)]
fn put_numbers(bytes: &mut [u8; DRIVE_RECORD_BYTES], at: usize, numbers: &[f32]) {
    for (place, number) in bytes.as_chunks_mut::<4>().0.iter_mut().skip(at).zip(numbers) {
        *place = number.to_le_bytes();
    }
}

/// Reads numbers that [`put_numbers`] wrote.
#[inline(never)]
fn read_numbers(bytes: &[u8; DRIVE_RECORD_BYTES], at: usize, numbers: &mut [f32]) {
    for (number, word) in numbers.iter_mut().zip(bytes.as_chunks::<4>().0.iter().skip(at)) {
        *number = f32::from_le_bytes(*word);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::ParameterId;

    #[test]
    fn crc_of_identified_set_follows_every_change() {
        let mut set = IdentifiedSet::default();
        assert_eq!((set.crc(), set.crc()), (ParameterSet::default().crc(), set.set.crc()));
        set.motor.pole_pairs += 1.0;
        let changed = set.crc();
        assert_eq!(changed, set.set.crc());
        let mut copy = IdentifiedSet::default();
        copy.copy_from(&set);
        assert_eq!((copy.crc.get(), copy.set.crc()), (Some(changed), changed));
    }
    use crate::reference_network as reference;

    #[test]
    fn parse_of_set_of_the_version_before_keeps_its_values_and_adds_defaults() {
        let mut set = ParameterSet::default();
        set.friction.model.set(ParameterId::ViscousFriction, 0.25);
        set.motor.inertia_kg_m2 = 0.5;
        set.motor.brake_at_stop = 1.0;
        set.thresholds.overspeed_rad_s = 9.0;
        set.watch.band_nm = 0.3;
        set.sensors.strain_zero = 0.4;
        let bytes = set.emit();
        let (friction, drive) = bytes.split_at(record::LENGTH);
        let places = [0, THRESHOLDS_AT, WATCH_AT, SENSORS_AT].into_iter().zip(FORMER_COUNTS);
        let values = places.flat_map(|(at, count)| drive[4 * at..][..4 * count].to_vec());
        let former: std::vec::Vec<u8> = friction.iter().copied().chain(values).collect();
        assert_eq!(former.len(), record::LENGTH + FORMER_DRIVE_BYTES);
        assert_eq!(ParameterSet::parse(&former), Ok(set));
    }

    #[test]
    fn parse_of_emitted_set_returns_the_same_set() {
        let mut set = ParameterSet::default();
        set.friction.model.set(ParameterId::ViscousFriction, 0.25);
        set.motor.inertia_kg_m2 = 0.5;
        set.thresholds.overspeed_rad_s = 9.0;
        assert_eq!(ParameterSet::parse(&set.emit()), Ok(set.clone()));
        let changes: [fn(&mut ParameterSet); 6] = [
            |set| set.friction.model.set(ParameterId::ViscousFriction, 0.5),
            |set| set.friction.compensator.scale = 0.5,
            |set| set.motor.inertia_kg_m2 = 0.25,
            |set| set.thresholds.overspeed_rad_s = 8.0,
            |set| set.watch.band_nm = 0.2,
            |set| set.sensors.strain_zero = 0.4,
        ];
        for change in changes {
            let mut other = set.clone();
            change(&mut other);
            assert_ne!(set.crc(), other.crc());
        }
        let mut supplied = set.clone();
        supplied.friction.model = reference::parameters();
        supplied.network = Some(reference::joint());
        let bytes = supplied.emit();
        assert_eq!(bytes.len(), MAX_SET_BYTES);
        assert_eq!(ParameterSet::parse(&bytes), Ok(supplied.clone()));
        let mut other = supplied.clone();
        other.network.as_mut().unwrap().network.readout.bias[1] += 0.125;
        assert_ne!(other.crc(), supplied.crc());
        // A network with a damaged header is not ignored.
        for at in [SET_BYTES, SET_BYTES + 900] {
            let mut damaged = bytes.clone();
            damaged[at] ^= 4;
            assert!(ParameterSet::parse(&damaged).is_err(), "{at}");
        }
        supplied.friction.model = set.friction.model.clone();
        match ParameterSet::parse(&supplied.emit()) {
            Err(SetError::Drive(error)) => assert_eq!(error.field, "network_inputs"),
            other => panic!("{other:?}"),
        }
        assert_eq!(ParameterSet::parse(&[0; 9]), Err(SetError::Length(9)));
        set.motor.pole_pairs = 0.0;
        match ParameterSet::parse(&set.emit()) {
            Err(SetError::Drive(error)) => assert_eq!(error.field, "pole_pairs"),
            other => panic!("{other:?}"),
        }
    }
}
