//! The objects that a joint driver and a compact node have in common: the checks of a transfer, and the values of both.

use super::numbers::entry;
use crate::driver::Identity;
use crate::driver::device::history::History;
use crate::driver::staging::Staging;
use crate::node::dictionary::records::{
    CommitObject, InputsObject, OperationObject, StateObject, WatchObject,
};
use crate::node::dictionary::{Access, Entry, index, value_count};
use crate::node::sdo::{Abort, ValueBuffer};
use crate::node_settings::NodeSettings;
use crate::refusal;
use crate::supervisor::{JointState, Supervisor};
use crate::watch::ResidualWatch;
use canopen_rs::Address;
use compensator_core::can::cob_id;
use compensator_core::record;

/// The parts of a node that these objects report.
pub(crate) struct CommonObjects<'a> {
    /// 1008h.
    pub name: &'static str,
    pub identity: &'a Identity,
    pub settings: &'a NodeSettings,
    pub history: &'a History,
    pub staging: &'a Staging,
    pub supervisor: &'a Supervisor,
    pub watch: Option<&'a ResidualWatch>,
    pub inputs: &'a InputsObject,
    /// Codes that refused the last request.
    pub blocking: u32,
    pub is_armed: bool,
}

impl CommonObjects<'_> {
    /// Returns sub-index 0 of an object with several values.
    pub fn count(&self, at_index: u16) -> Option<u32> {
        match at_index {
            index::ERROR_FIELD => Some(self.history.error_count()),
            _ => value_count(at_index).map(u32::from),
        }
    }

    /// Reads a value that is no number; `None` for any other.
    pub fn read(&self, at: Address, value: &mut ValueBuffer) -> Option<Result<(), Abort>> {
        let copied = match (at.index, at.subindex) {
            (index::DEVICE_NAME, _) => return Some(text(self.name, value)),
            (index::HARDWARE_VERSION, _) => return Some(text(self.identity.hardware, value)),
            (index::SOFTWARE_VERSION, _) => return Some(text(env!("CARGO_PKG_VERSION"), value)),
            (index::LAST_PANIC, _) => return Some(text(self.history.panic(), value)),
            (staged, place @ 1..) if is_staged(staged) => {
                return Some(self.staging.read(staged, place, value));
            }
            (index::REFUSAL, _) => value.extend_from_slice(&refusal::emit(self.staging.reason())),
            (index::COMMIT, CommitObject::FRICTION_RECORD) => {
                value.extend_from_slice(&record::emit(&self.staging.staged().friction))
            }
            (index::COMMIT, CommitObject::DRIVE_RECORD) => {
                value.extend_from_slice(&self.staging.staged().emit_drive())
            }
            _ => return None,
        };
        Some(copied.map_err(|_| Abort::Memory))
    }

    /// Returns the value of an object that reads as a number; a float as its bits.
    // Inlined into its only caller, so that no image builds `Self`.
    #[inline(always)]
    pub fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let Self { settings, staging, supervisor, .. } = self;
        let own = |base: u16| u32::from(base) + u32::from(settings.node.number());
        match at_index {
            index::ERROR_REGISTER => Ok((supervisor.faults().error_register()
                | supervisor.limits().error_register())
            .into()),
            index::ERROR_FIELD => self.history.error(place).ok_or(Abort::NoSubIndex),
            index::SYNC_IDENTIFIER => Ok(cob_id::SYNC.into()),
            index::EMERGENCY_IDENTIFIER => Ok(own(cob_id::EMERGENCY)),
            // Parameters are saved and restored on command, not automatically.
            index::STORE | index::RESTORE => Ok(1),
            index::AWAITED_HEARTBEAT => Ok(settings.awaited_heartbeat),
            index::HEARTBEAT => Ok(settings.heartbeat_ms.into()),
            index::IDENTITY => entry(&self.identity.object().words(), place),
            // Client to server, server to client.
            index::SDO_SERVER => entry(&[cob_id::SDO_REQUEST, cob_id::SDO_ANSWER].map(own), place),
            index::OPERATION => {
                let operation = OperationObject {
                    source: settings.source as u32,
                    number: settings.number as u32,
                    period_s: settings.period_s.to_bits(),
                    campaign_h: settings.campaign_h.to_bits(),
                    telemetry_every: settings.telemetry_every.into(),
                    node: settings.node.number().into(),
                    bit_rate_kbit: settings.bit_rate_kbit.into(),
                    data_bit_rate_kbit: settings.data_bit_rate_kbit.into(),
                    fd_telemetry: settings.fd_telemetry.into(),
                };
                entry(&operation.words(), place)
            }
            index::STATE => {
                let is_faulty = supervisor.state() == JointState::Fault;
                let state = StateObject {
                    state: if is_faulty { 2 } else { self.is_armed.into() },
                    faults: supervisor.faults().fault_bits(),
                    limits: supervisor.limits().limit_bits(),
                    blocking_codes: self.blocking,
                    failed_self_test: supervisor.failed_self_test().into(),
                    ..Default::default()
                };
                entry(&state.words(), place)
            }
            index::INPUTS => entry(&self.inputs.words(), place),
            index::CODE_COUNTERS => entry(supervisor.counts(), place),
            index::WATCH => entry(&watch_object(self.watch).words(), place),
            index::COMMISSIONING => {
                let wiring_crc = staging.wiring_crc();
                let [commissioned, proven] =
                    [settings.commissioned, settings.proven].map(|crc| (crc == wiring_crc).into());
                entry(&[commissioned, wiring_crc, 0, proven], place)
            }
            index::COMMIT => {
                let (active_crc, staged_crc) = staging.crcs();
                entry(&CommitObject { active_crc, staged_crc, ..Default::default() }.words(), place)
            }
            _ => Err(Abort::NoObject),
        }
    }
}

/// Returns true if an object is part of the parameter set, which is staged.
pub(crate) const fn is_staged(at_index: u16) -> bool {
    matches!(
        at_index,
        index::MODEL
            | index::ENVELOPE
            | index::COMPENSATOR
            | index::PARAMETERS
            | index::MOTOR
            | index::THRESHOLDS
            | index::WATCH_PARAMETERS
            | index::SENSORS
    )
}

/// Appends a text; an empty one reads as a blank, because SDO cannot transfer an empty value.
#[inline(never)]
fn text(text: &str, value: &mut ValueBuffer) -> Result<(), Abort> {
    let text = if text.is_empty() { " " } else { text };
    value.extend_from_slice(text.as_bytes()).map_err(|_| Abort::Memory)
}

/// Returns the state of a watch of the model (2007h).
fn watch_object(watch: Option<&ResidualWatch>) -> WatchObject {
    /// Before the first window is complete, it is unknown whether the model is in its band.
    const UNKNOWN: u32 = 2;
    let Some(watch) = watch else {
        return WatchObject { in_band: UNKNOWN, ..Default::default() };
    };
    WatchObject {
        in_band: watch.in_band().map_or(UNKNOWN, u32::from),
        windows: watch.windows(),
        windows_out_of_band: watch.windows_out_of_band(),
        alarms: watch.alarms(),
        largest_in_bands: watch.largest_in_bands().to_bits(),
    }
}

/// Checks that an entry can be written with this length, if that is known.
pub(crate) fn check_entry(entry: &Entry, length: Option<usize>) -> Result<(), Abort> {
    if !matches!(entry.access, Access::ReadWrite | Access::WriteOnly | Access::Input) {
        return Err(Abort::ReadOnly);
    }
    match (length, entry.data.length()) {
        (Some(found), Some(expected)) if found > expected => Err(Abort::TooLong),
        (Some(found), Some(expected)) if found < expected => Err(Abort::TooShort),
        _ => Ok(()),
    }
}

/// Returns what is written to an entry, and its first four bytes as a number. An expedited write need not state its size:
/// then it is the size of the entry.
pub(crate) fn written<'a>(entry: &Entry, value: &'a [u8]) -> Result<(&'a [u8], u32), Abort> {
    let value = match entry.data.length() {
        Some(length) => value.get(..length).ok_or(Abort::TooShort)?,
        None => value,
    };
    let mut word = [0; 4];
    word.iter_mut().zip(value).for_each(|(place, byte)| *place = *byte);
    Ok((value, u32::from_le_bytes(word)))
}

/// Appends a number in the length of its entry.
pub(crate) fn put(entry: &Entry, number: u32, value: &mut ValueBuffer) -> Result<(), Abort> {
    let bytes = number.to_le_bytes();
    let length = entry.data.length().unwrap_or(4);
    value.extend_from_slice(bytes.get(..length).unwrap_or(&bytes)).map_err(|_| Abort::Memory)
}
