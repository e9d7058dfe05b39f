//! Brings a driver to where its answers can be known: fed by the bus, its period, its parameters, armed.

use crate::bus::Bus;
use crate::canopen::{Client, SdoError};
use canopen_rs::{Address, NmtCommand};
use compensator_core::ParameterError;
use compensator_core::can::Node;
use compensator_core::configuration::Configuration;
use compensator_core::network::JointNetwork;
use compensator_core::network::record as network_record;
use compensator_core::record::{self, RecordError};
use firmware::hil::{HilJoint, HilSetup, Number};
use firmware::node::dictionary::index;
use firmware::node_settings::{PERIOD_RANGE_S, Source};
use firmware::parameter_set::{DRIVE_LENGTH, ParameterSet};

/// What a driver is to be set up for.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The friction model; `None` for the one the driver has.
    pub friction: Option<Configuration>,
    /// The network that supplies it, where one does; of no meaning without a model.
    pub network: Option<JointNetwork>,
    /// The number it computes with; `None` for the one it has.
    pub number: Option<Number>,
    /// Time from SYNC to SYNC, s.
    pub period_s: f32,
}

/// Why a driver cannot be set up; one line.
#[derive(Debug, thiserror::Error)]
pub enum SetupError {
    /// It refuses, or does not answer.
    #[error(transparent)]
    Sdo(#[from] SdoError),
    /// Its parameters are none this core knows.
    #[error("the driver's parameters: {0}")]
    Record(RecordError),
    /// Its network is none this core knows.
    #[error("the driver's network: {0}")]
    Network(network_record::RecordError),
    /// The core cannot be built from them.
    #[error("{0}")]
    Build(ParameterError),
    /// The trace is too slow or too fast for a driver.
    #[error("{found_s} s from SYNC to SYNC, expected {} to {}", PERIOD_RANGE_S.0, PERIOD_RANGE_S.1)]
    Period {
        /// What was asked for.
        found_s: f32,
    },
    /// The motor and thresholds it has are of another length: another version.
    #[error(
        "the driver is of another version: {found} bytes of motor and thresholds, expected {DRIVE_LENGTH}"
    )]
    Version {
        /// Their length.
        found: usize,
    },
}

/// Sets the driver up, arms it, makes it operational, and gives the core it must agree with.
///
/// # Errors
/// See [`SetupError`].
pub fn set_up<B: Bus>(
    client: &mut Client<B>,
    node: Node,
    setup: &Setup,
) -> Result<HilJoint, SetupError> {
    let at = Address::new;
    if !(PERIOD_RANGE_S.0..=PERIOD_RANGE_S.1).contains(&setup.period_s) {
        return Err(SetupError::Period { found_s: setup.period_s });
    }
    client.write(at(index::STATE, 1), &[0])?;
    client.write(at(index::OPERATION, 1), &[Source::Bus as u8])?;
    if let Some(number) = setup.number {
        client.write(at(index::OPERATION, 2), &[number as u8])?;
    }
    client.write(at(index::OPERATION, 3), &setup.period_s.to_le_bytes())?;
    if let Some(friction) = &setup.friction {
        write_friction(client, friction, setup.network.as_ref())?;
    }
    let (friction, network) = match &setup.friction {
        Some(friction) => (friction.clone(), setup.network.clone()),
        None => {
            client.write(at(index::COMMIT, 4), &[1])?;
            let friction = client.read(at(index::COMMIT, 5))?;
            let network = client.read(at(index::COMMIT, 7))?;
            let friction = record::parse(&friction).map_err(SetupError::Record)?;
            (friction, network_record::parse(&network).map_err(SetupError::Network)?)
        }
    };
    let number = match client.read_number(at(index::OPERATION, 2))? {
        0 => Number::Float,
        _ => Number::Fixed,
    };
    let campaign_h = client.read_float(at(index::OPERATION, 4))?;
    let hil_setup = HilSetup { number, period_s: setup.period_s, campaign_h };
    let core =
        HilJoint::build(node, &friction, network.as_ref(), hil_setup).map_err(SetupError::Build)?;
    // A run begins anew for the driver as for the core: nothing heard, nothing counted.
    client.write(at(index::TRACE, 1), &0u32.to_le_bytes())?;
    client.command(NmtCommand::StartRemoteNode).map_err(SdoError::from)?;
    client.write(at(index::STATE, 1), &[1])?;
    Ok(core)
}

/// Writes a friction model and its network to a driver, in two steps: staged, then committed by the CRC of what was meant.
///
/// # Errors
/// The driver refuses, and says which parameter and why.
pub fn write_friction<B: Bus>(
    client: &mut Client<B>,
    friction: &Configuration,
    network: Option<&JointNetwork>,
) -> Result<(), SetupError> {
    let at = Address::new;
    client.write(at(index::COMMIT, 4), &[1])?;
    let drive = client.read(at(index::COMMIT, 6))?;
    let drive: &[u8; DRIVE_LENGTH] =
        drive.as_slice().try_into().map_err(|_| SetupError::Version { found: drive.len() })?;
    let meant = ParameterSet::with_drive(friction.clone(), network.cloned(), drive);
    client.write(at(index::COMMIT, 5), &record::emit(friction))?;
    client.write(at(index::COMMIT, 7), &network_record::emit(network))?;
    client.write(at(index::COMMIT, 3), &meant.crc().to_le_bytes())?;
    Ok(())
}
