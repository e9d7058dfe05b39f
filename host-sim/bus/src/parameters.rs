//! A joint driver's whole parameter set over the bus, as `params get` and `params set` have it.
//!
//! Nothing is changed half: the parts of a set are staged in the driver, and committed together by the CRC of what was
//! meant. A driver takes no set while it is armed.

use crate::bus::Bus;
use crate::canopen::{Client, SdoError};
use canopen_rs::Address;
use compensator_core::network::record as network_record;
use compensator_core::record::{self, RecordError};
use firmware::node::dictionary::index;
use firmware::parameter_set::{DRIVE_LENGTH, ParameterSet};

/// Not in this state: the driver is armed.
const ARMED: u32 = 0x0800_0022;

/// Why a set could not be read or written; one line.
#[derive(Debug, thiserror::Error)]
pub enum ParametersError {
    /// The driver refuses, or does not answer.
    #[error(transparent)]
    Sdo(#[from] SdoError),
    /// Its friction model is none this core knows.
    #[error("the driver's record: {0}")]
    Record(RecordError),
    /// Its network is none this core knows.
    #[error("the driver's network: {0}")]
    Network(network_record::RecordError),
    /// The motor and thresholds it has are of another length.
    #[error(
        "the driver is of another version: {found} bytes of motor and thresholds, expected {DRIVE_LENGTH}"
    )]
    Version {
        /// Their length.
        found: usize,
    },
    /// It took something else than what was meant.
    #[error("the driver runs on {active:08x}, meant was {meant:08x}")]
    Other {
        /// CRC of the set it runs on.
        active: u32,
        /// CRC of the one that was written.
        meant: u32,
    },
}

/// The active set; what was staged and not committed is dropped.
///
/// # Errors
/// See [`ParametersError`].
pub fn read_set<B: Bus>(client: &mut Client<B>) -> Result<ParameterSet, ParametersError> {
    let at = Address::new;
    // Refused while armed, and then there is nothing staged either.
    match client.write(at(index::COMMIT, 4), &[1]) {
        Ok(()) | Err(SdoError::Refused { code: ARMED, .. }) => {}
        Err(error) => return Err(error.into()),
    }
    read_staged(client)
}

/// The staged set: the active one, where nothing else is.
///
/// # Errors
/// See [`ParametersError`].
pub fn read_staged<B: Bus>(client: &mut Client<B>) -> Result<ParameterSet, ParametersError> {
    let at = Address::new;
    let friction = client.read(at(index::COMMIT, 5))?;
    let friction = record::parse(&friction).map_err(ParametersError::Record)?;
    let drive = client.read(at(index::COMMIT, 6))?;
    let drive: &[u8; DRIVE_LENGTH] =
        drive.as_slice().try_into().map_err(|_| ParametersError::Version { found: drive.len() })?;
    let network = client.read(at(index::COMMIT, 7))?;
    let network = network_record::parse(&network).map_err(ParametersError::Network)?;
    Ok(ParameterSet::with_drive(friction, network, drive))
}

/// Makes the driver run on this set, until a reset; gives its CRC.
///
/// # Errors
/// The driver is armed, or refuses a value and says which and why; nothing is changed then, and nothing stays staged.
pub fn write_set<B: Bus>(
    client: &mut Client<B>,
    set: &ParameterSet,
) -> Result<u32, ParametersError> {
    let at = Address::new;
    let meant = set.crc();
    let commit = |client: &mut Client<B>| {
        client.write(at(index::COMMIT, 5), &record::emit(&set.friction))?;
        client.write(at(index::COMMIT, 6), &set.emit_drive())?;
        client.write(at(index::COMMIT, 7), &network_record::emit(set.network.as_ref()))?;
        client.write(at(index::COMMIT, 3), &meant.to_le_bytes())
    };
    if let Err(error) = commit(client) {
        // Nothing of it may be left for somebody else's commit.
        let _ = client.write(at(index::COMMIT, 4), &[1]);
        return Err(error.into());
    }
    let active = client.read_number(at(index::COMMIT, 1))?;
    if active == meant { Ok(active) } else { Err(ParametersError::Other { active, meant }) }
}
