//! The whole parameter set of a joint driver: friction, its network, motor, thresholds, watch.
//!
//! They are validated together, named by one CRC, committed and stored as one, so that a driver never
//! runs on a new friction model with the thresholds of another joint. In bytes: the friction record of
//! the core, then the numbers of motor, thresholds and watch as `f32`, little-endian, each in the order of
//! its fields; then the network's record, where there is a network.

use crate::control::MotorParameters;
use crate::control::PERIOD_S;
use crate::supervisor::Thresholds;
use crate::watch::WatchParameters;
use compensator_core::compensator::CompensatorParameters;
use compensator_core::configuration::Configuration;
use compensator_core::network::record as network_record;
use compensator_core::network::{JointNetwork, Supplier};
use compensator_core::record::{self, RecordError};
use compensator_core::{Compensator, LawKind, ParameterError, Parameters};
use core::fmt;
use heapless::Vec;

/// Numbers of motor, thresholds and watch.
pub const DRIVE_NUMBERS: usize =
    MotorParameters::FIELDS + Thresholds::FIELDS + WatchParameters::FIELDS;
/// Bytes of them.
pub const DRIVE_LENGTH: usize = 4 * DRIVE_NUMBERS;
/// Bytes of a set without a network.
pub const SET_LENGTH: usize = record::LENGTH + DRIVE_LENGTH;
/// Bytes of a set with one.
pub const LONGEST_SET: usize = SET_LENGTH + network_record::LENGTH;

const CRC: crc::Crc<u32, crc::NoTable> = crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// What a joint driver runs on.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterSet {
    /// The friction model and how it is used.
    pub friction: Configuration,
    /// What supplies the model's levels and stiffness, where a network does.
    pub network: Option<JointNetwork>,
    /// The motor and its current loop.
    pub motor: MotorParameters,
    /// What the supervisor stops at.
    pub thresholds: Thresholds,
    /// What the model promises.
    pub watch: WatchParameters,
}

impl Default for ParameterSet {
    /// What a driver runs on where nothing is stored: the plain LuGre law at its defaults.
    fn default() -> Self {
        Self {
            friction: Configuration {
                model: Parameters::new(LawKind::Lugre),
                compensator: CompensatorParameters::default(),
            },
            network: None,
            motor: MotorParameters::default(),
            thresholds: Thresholds::default(),
            watch: WatchParameters::default(),
        }
    }
}

/// Why a set in bytes was not taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SetError {
    /// It has so many bytes, which no set has.
    Length(usize),
    /// The friction record is refused.
    Record(RecordError),
    /// The network's record is.
    Network(network_record::RecordError),
    /// A number of motor, thresholds or watch is.
    Drive(ParameterError),
}

impl fmt::Display for SetError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Length(found) => {
                write!(
                    f,
                    "parameter set of {found} bytes, expected {SET_LENGTH}, or {LONGEST_SET} with a network"
                )
            }
            Self::Record(error) => error.fmt(f),
            Self::Network(error) => error.fmt(f),
            Self::Drive(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for SetError {}

impl ParameterSet {
    /// What commissioning finds out about a joint, of [`MotorParameters::NAMES`]: how motor, encoder and gear are wired.
    pub const WIRING: [&str; 10] = [
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
    /// The first refusal.
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.friction.validate()?;
        if let Some(network) = &self.network {
            network.validate()?;
            JointNetwork::validate_with(&self.friction.model)?;
        }
        self.motor.validate()?;
        self.motor.validate_with(&self.friction.compensator)?;
        self.thresholds.validate()?;
        self.watch.validate()
    }

    /// Checks what is not friction, each part by itself.
    ///
    /// # Errors
    /// The first refusal.
    pub fn validate_drive(&self) -> Result<(), ParameterError> {
        self.motor.validate()?;
        self.thresholds.validate()?;
        self.watch.validate()
    }

    /// Whether a current loop can be built of it.
    ///
    /// # Errors
    /// What stands against it.
    pub fn builds(&self) -> Result<(), ParameterError> {
        Compensator::<f32>::build(&self.friction, PERIOD_S)?;
        if let Some(network) = &self.network {
            Supplier::<f32>::build(network, self.friction.compensator.hold_s)?;
        }
        self.motor.build(PERIOD_S).map(|_| ())
    }

    /// CRC of the numbers of [`Self::WIRING`]: any other may change and the joint stays commissioned. It is never 0.
    pub fn wiring_crc(&self) -> u32 {
        let mut digest = CRC.digest();
        for (name, number) in MotorParameters::NAMES.iter().zip(self.motor.to_array()) {
            if Self::WIRING.contains(name) {
                digest.update(&number.to_le_bytes());
            }
        }
        digest.finalize().max(1)
    }

    /// The set in bytes.
    pub fn emit(&self) -> Vec<u8, LONGEST_SET> {
        let mut bytes = Vec::new();
        // Its length is the sum of theirs.
        let _ = bytes.extend_from_slice(&record::emit(&self.friction));
        let _ = bytes.extend_from_slice(&self.emit_drive());
        if self.network.is_some() {
            let _ = bytes.extend_from_slice(&network_record::emit(self.network.as_ref()));
        }
        bytes
    }

    /// Motor, thresholds and watch in bytes.
    pub fn emit_drive(&self) -> [u8; DRIVE_LENGTH] {
        let mut bytes = [0; DRIVE_LENGTH];
        let numbers = self.motor.to_array().into_iter().chain(self.thresholds.to_array());
        let numbers = numbers.chain(self.watch.to_array());
        for (place, number) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(numbers) {
            *place = number.to_le_bytes();
        }
        bytes
    }

    /// Reads a set and validates it.
    ///
    /// # Errors
    /// Says what is wrong with it, or which parameter is refused and why.
    pub fn parse(bytes: &[u8]) -> Result<Self, SetError> {
        let wrong_length = SetError::Length(bytes.len());
        let split = bytes.split_last_chunk::<{ network_record::LENGTH }>();
        let (own, network) = match split.filter(|(_, last)| network_record::claims(*last)) {
            Some((own, network)) => {
                (own, network_record::parse(network).map_err(SetError::Network)?)
            }
            None => (bytes, None),
        };
        let (friction, drive) = own.split_last_chunk::<DRIVE_LENGTH>().ok_or(wrong_length)?;
        let friction = record::parse(friction).map_err(SetError::Record)?;
        let set = Self::with_drive(friction, network, drive);
        set.validate().map_err(SetError::Drive)?;
        Ok(set)
    }

    /// A set of this friction model, this network and these bytes of the rest; nothing is checked.
    pub fn with_drive(
        friction: Configuration,
        network: Option<JointNetwork>,
        drive: &[u8; DRIVE_LENGTH],
    ) -> Self {
        let mut motor = [0.0; MotorParameters::FIELDS];
        let mut thresholds = [0.0; Thresholds::FIELDS];
        let mut watch = [0.0; WatchParameters::FIELDS];
        let words = drive.as_chunks::<4>().0.iter();
        let places = motor.iter_mut().chain(&mut thresholds).chain(&mut watch);
        for (place, word) in places.zip(words) {
            *place = f32::from_le_bytes(*word);
        }
        Self {
            friction,
            network,
            motor: MotorParameters::from_array(motor),
            thresholds: Thresholds::from_array(thresholds),
            watch: WatchParameters::from_array(watch),
        }
    }

    /// What names the set: the CRC-32 of its bytes, without those of the records' own CRCs. With them it
    /// would say nothing of a record: a CRC over anything and its CRC is a constant.
    pub fn crc(&self) -> u32 {
        let record = record::emit(&self.friction);
        let mut digest = CRC.digest();
        digest.update(record.split_last_chunk::<4>().map_or(&record[..], |(guarded, _)| guarded));
        digest.update(&self.emit_drive());
        if self.network.is_some() {
            let record = network_record::emit(self.network.as_ref());
            digest.update(record.split_last_chunk::<4>().map_or(&record, |(guarded, _)| guarded));
        }
        digest.finalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::ParameterId;
    use compensator_core::network::reference;

    #[test]
    fn a_set_is_read_as_it_was_written() {
        let mut set = ParameterSet::default();
        set.friction.model.set(ParameterId::ViscousFriction, 0.25);
        set.motor.inertia_kg_m2 = 0.5;
        set.thresholds.overspeed_rad_s = 9.0;
        assert_eq!(ParameterSet::parse(&set.emit()), Ok(set.clone()));
        let changes: [fn(&mut ParameterSet); 5] = [
            |set| set.friction.model.set(ParameterId::ViscousFriction, 0.5),
            |set| set.friction.compensator.scale = 0.5,
            |set| set.motor.inertia_kg_m2 = 0.25,
            |set| set.thresholds.overspeed_rad_s = 8.0,
            |set| set.watch.band_nm = 0.2,
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
        assert_eq!(bytes.len(), LONGEST_SET);
        assert_eq!(ParameterSet::parse(&bytes), Ok(supplied.clone()));
        let mut other = supplied.clone();
        other.network.as_mut().unwrap().network.readout.bias[1] += 0.125;
        assert_ne!(other.crc(), supplied.crc());
        // A network whose head has rotted is not passed over.
        for at in [SET_LENGTH, SET_LENGTH + 900] {
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
