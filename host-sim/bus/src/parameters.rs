//! The complete parameter set of a joint driver over the bus, for `params get` and `params set`.
//!
//! A set is applied completely or not at all. Its parts are staged in the driver and committed together with the CRC of the
//! set. An armed driver accepts no set.

use crate::bus::Bus;
use crate::canopen::{Client, SdoError};
use canopen_rs::Address;
use compensator_core::network::record as network_record;
use compensator_core::record::{self, RecordError};
use firmware::node::dictionary::index;
use firmware::parameter_set::{DRIVE_RECORD_BYTES, ParameterSet};

/// Abort code of an armed driver: not possible in this state.
const ABORT_CODE_ARMED: u32 = 0x0800_0022;

/// Error of reading or writing a set; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum ParametersError {
    /// The driver refuses or does not answer.
    #[error(transparent)]
    Sdo(#[from] SdoError),
    /// The friction record is not valid for this core.
    #[error("the driver's record: {0}")]
    Record(RecordError),
    /// The network record is not valid for this core.
    #[error("the driver's network: {0}")]
    Network(network_record::RecordError),
    /// The motor parameters and thresholds have another length.
    #[error(
        "the driver has another version: {found} bytes of motor parameters and thresholds, expected {DRIVE_RECORD_BYTES}"
    )]
    Version { found: usize },
    /// The driver applied another set.
    #[error("the driver uses the set {active:08x}, expected {written:08x}")]
    Other { active: u32, written: u32 },
}

/// Reads the active set. A staged set that was not committed is discarded.
///
/// # Errors
/// See [`ParametersError`].
pub fn read_set<B: Bus>(client: &mut Client<B>) -> Result<ParameterSet, ParametersError> {
    let at = Address::new;
    // An armed driver refuses this, but then nothing is staged either.
    match client.write(at(index::COMMIT, 4), &[1]) {
        Ok(()) | Err(SdoError::Refused { code: ABORT_CODE_ARMED, .. }) => {}
        Err(error) => return Err(error.into()),
    }
    read_staged(client)
}

/// Reads the staged set, or the active one if nothing is staged.
///
/// # Errors
/// See [`ParametersError`].
pub fn read_staged<B: Bus>(client: &mut Client<B>) -> Result<ParameterSet, ParametersError> {
    let at = Address::new;
    let friction = client.read(at(index::COMMIT, 5))?;
    let friction = record::parse(&friction).map_err(ParametersError::Record)?;
    let drive = client.read(at(index::COMMIT, 6))?;
    let drive: &[u8; DRIVE_RECORD_BYTES] =
        drive.as_slice().try_into().map_err(|_| ParametersError::Version { found: drive.len() })?;
    let network = client.read(at(index::COMMIT, 7))?;
    let network = network_record::parse(&network).map_err(ParametersError::Network)?;
    Ok(ParameterSet::with_drive(friction, network, drive))
}

/// Writes and commits a set, which is active until a reset. Returns its CRC.
///
/// # Errors
/// Returns an error if the driver is armed or refuses a value, with the field and the reason. Then the active set is
/// unchanged and nothing stays staged.
pub fn write_set<B: Bus>(
    client: &mut Client<B>,
    set: &ParameterSet,
) -> Result<u32, ParametersError> {
    let at = Address::new;
    let written = set.crc();
    let commit = |client: &mut Client<B>| {
        client.write(at(index::COMMIT, 5), &record::emit(&set.friction))?;
        client.write(at(index::COMMIT, 6), &set.emit_drive())?;
        client.write(at(index::COMMIT, 7), &network_record::emit(set.network.as_ref()))?;
        client.write(at(index::COMMIT, 3), &written.to_le_bytes())
    };
    if let Err(error) = commit(client) {
        // Discards the staged parts, so that no later commit applies them.
        let _ = client.write(at(index::COMMIT, 4), &[1]);
        return Err(error.into());
    }
    let active = client.read_number(at(index::COMMIT, 1))?;
    if active == written { Ok(active) } else { Err(ParametersError::Other { active, written }) }
}
