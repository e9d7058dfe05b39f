//! The objects that a joint driver and a compact node have in common: the checks of a transfer, and the values of both.

use super::base::JointBase;
use crate::node::dictionary::records::{
    CommitObject, Counters, InputsObject, OperationObject, StateObject, WatchObject,
};
use crate::node::dictionary::{
    Access, Entry, LOAD_SIGNATURE, SAVE_SIGNATURE, index, is_mapping, value_count,
};
use crate::node::sdo::{Abort, ValueBuffer};
use crate::node_settings::NodeSettings;
use crate::refusal;
use crate::watch::ResidualWatch;
use canopen_rs::Address;
use compensator_core::can::{
    CommandFrame, Message, MotionFrame, NodeId, SealFrame, SurroundingsFrame, TorqueFrame, cob_id,
};
use compensator_core::network::record as network_record;
use compensator_core::record;
use compensator_core::text;

impl JointBase {
    /// Checks that an entry may be written now: while the bridge is in use, few may.
    pub(crate) fn check_armed(&mut self, entry: &Entry) -> Result<(), Abort> {
        if !entry.is_written_armed && self.is_bridge_in_use() {
            return Err(self.refuse_armed());
        }
        Ok(())
    }

    /// Reads a value that every joint has and that is no number, or the number of values of an object; `None` for any other.
    pub(crate) fn read(
        &self,
        entry: &Entry,
        at: Address,
        value: &mut ValueBuffer,
    ) -> Option<Result<(), Abort>> {
        if entry.access == Access::WriteOnly {
            return Some(Err(Abort::WriteOnly));
        }
        let staged_set = self.staging.staged();
        let copied = match (at.index, at.subindex) {
            (index::DEVICE_NAME, _) => return Some(put_text(self.name, value)),
            (index::HARDWARE_VERSION, _) => return Some(put_text(self.identity.hardware, value)),
            (index::SOFTWARE_VERSION, _) => {
                return Some(put_text(env!("CARGO_PKG_VERSION"), value));
            }
            (index::LAST_PANIC, _) => return Some(put_text(self.history.panic(), value)),
            (staged, place @ 1..) if is_staged(staged) => {
                return Some(self.staging.read(staged, place, value));
            }
            (index::ERROR_FIELD, 0) => return Some(put(entry, self.history.error_count(), value)),
            (mapping, 0) if is_mapping(mapping) => return None,
            (counted, 0) if let Some(count) = value_count(counted) => {
                return Some(put(entry, count.into(), value));
            }
            (index::REFUSAL, _) => value.extend_from_slice(&refusal::emit(self.staging.reason())),
            (index::COMMIT, CommitObject::FRICTION_RECORD) => {
                value.extend_from_slice(&record::emit(&staged_set.friction))
            }
            (index::COMMIT, CommitObject::DRIVE_RECORD) => {
                value.extend_from_slice(&staged_set.emit_drive())
            }
            (index::COMMIT, CommitObject::NETWORK_RECORD) => {
                value.extend_from_slice(&network_record::emit(staged_set.network.as_ref()))
            }
            _ => return None,
        };
        Some(copied.map_err(|_| Abort::Memory))
    }

    /// Writes an object that every joint has; `None` for any other.
    pub(crate) fn write(
        &mut self,
        at: Address,
        number: u32,
        value: &[u8],
    ) -> Option<Result<(), Abort>> {
        match (at.index, at.subindex) {
            (index::ERROR_FIELD, _) if number == 0 => self.history.clear_errors(),
            (index::ERROR_FIELD, _) => {
                let name = text!("predefined_error_field");
                return Some(Err(self.refuse_setting(name, text!("0, which clears it"))));
            }
            (index::STORE, _) if number == SAVE_SIGNATURE => return None,
            (index::RESTORE, _) if number == LOAD_SIGNATURE => return None,
            (index::STORE | index::RESTORE, _) => {
                let why = text!("save and load need their own word (65766173h, 64616F6Ch)");
                return Some(Err(self.refuse(Abort::Refused, why)));
            }
            // Nothing else depends on the heartbeat, so that an armed joint may have another one.
            (index::HEARTBEAT, _) => self.settings.heartbeat_ms = number as u16,
            (staged, place) if is_staged(staged) => {
                return Some(self.staging.write(staged, place, value));
            }
            (index::COMMIT, CommitObject::COMMIT) => return None,
            (index::COMMIT, CommitObject::DISCARD) => self.staging.discard(),
            (index::COMMIT, CommitObject::FRICTION_RECORD) => {
                return Some(self.staging.write_record(value));
            }
            (index::COMMIT, CommitObject::NETWORK_RECORD) => {
                return Some(self.staging.write_network(value));
            }
            (index::COMMIT, _) => return Some(self.staging.write_drive(value)),
            _ => return None,
        }
        Some(Ok(()))
    }

    /// Keeps an input that was written as an object, and returns the message of its frame.
    pub(crate) fn input_message(&mut self, sub_index: u8, word: u32) -> Option<Message> {
        let words = self.inputs.set(sub_index, word)?;
        let node = self.settings.node;
        Some(match sub_index {
            InputsObject::VELOCITY | InputsObject::POSITION => {
                Message::Motion(node, MotionFrame::from_words(words))
            }
            InputsObject::TORQUE | InputsObject::LOAD_TORQUE => {
                Message::Torque(node, TorqueFrame::from_words(words))
            }
            InputsObject::RADIAL_FORCE | InputsObject::PRESSURE_DIFF => {
                Message::Seal(node, SealFrame::from_words(words))
            }
            InputsObject::TEMPERATURE | InputsObject::AUXILIARY => {
                Message::Surroundings(node, SurroundingsFrame::from_words(words))
            }
            _ => Message::Command(node, CommandFrame::from_words(words)),
        })
    }

    /// Returns the settings with a written one of those that every joint has. They are not checked.
    pub(crate) fn changed_settings(
        &mut self,
        at: Address,
        number: u32,
    ) -> Result<NodeSettings, Abort> {
        let mut changed = self.settings;
        match (at.index, at.subindex) {
            (index::AWAITED_HEARTBEAT, _) => changed.awaited_heartbeat = number,
            (_, OperationObject::CAMPAIGN_H) => changed.campaign_h = f32::from_bits(number),
            (_, OperationObject::TELEMETRY_EVERY) => changed.telemetry_every = number as u8,
            (_, OperationObject::NODE) => {
                changed.node = NodeId::new(number as u8)
                    .ok_or_else(|| self.refuse_setting(text!("node"), text!("1 to 127")))?;
            }
            (_, OperationObject::DATA_BIT_RATE) => changed.data_bit_rate_kbit = number as u16,
            _ => changed.bit_rate_kbit = number as u16,
        }
        Ok(changed)
    }

    /// Checks settings that were changed.
    pub(crate) fn check_settings(&mut self, changed: &NodeSettings) -> Result<(), Abort> {
        changed.validate().map_err(|error| self.refuse(Abort::Value, error))
    }

    /// Returns the counters of the bus side (2003h).
    pub(crate) fn frame_counters(&self) -> Counters {
        Counters { sent: self.outbox.sent(), not_sent: self.outbox.lost(), ..self.counters }
    }

    /// Returns the value of an object that reads as a number; a float as its bits.
    pub(crate) fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let Self { settings, staging, supervisor, .. } = self;
        let of_node = |base: u16| u32::from(base) + u32::from(settings.node.number());
        match at_index {
            index::ERROR_REGISTER => Ok(self.error_register().into()),
            index::ERROR_FIELD => self.history.error(place).ok_or(Abort::NoSubIndex),
            index::SYNC_IDENTIFIER => Ok(cob_id::SYNC.into()),
            index::EMERGENCY_IDENTIFIER => Ok(of_node(cob_id::EMERGENCY)),
            // Parameters are saved and restored on command, not automatically.
            index::STORE | index::RESTORE => Ok(1),
            index::AWAITED_HEARTBEAT => Ok(settings.awaited_heartbeat),
            index::HEARTBEAT => Ok(settings.heartbeat_ms.into()),
            index::IDENTITY => entry(&self.identity.object().words(), place),
            // Client to server, server to client.
            index::SDO_SERVER => {
                entry(&[cob_id::SDO_REQUEST, cob_id::SDO_ANSWER].map(of_node), place)
            }
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
                let state = StateObject {
                    state: self.state() as u32,
                    faults: supervisor.faults().fault_bits(),
                    limits: supervisor.limits().limit_bits(),
                    blocking_codes: self.blocking,
                    failed_self_test: supervisor.failed_self_test().into(),
                    ..Default::default()
                };
                entry(&state.words(), place)
            }
            index::INPUTS => entry(&self.inputs.words(), place),
            index::FRAME_COUNTERS => entry(&self.frame_counters().words(), place),
            index::CODE_COUNTERS => entry(supervisor.counts(), place),
            index::WATCH => entry(&watch_object(self.watch.as_ref()).words(), place),
            index::COMMISSIONING => {
                let wiring_crc = staging.wiring_crc();
                let [commissioned, proven] =
                    [settings.commissioned, settings.proven].map(|crc| (crc == wiring_crc).into());
                entry(&[commissioned, wiring_crc, 0, proven], place)
            }
            index::COMMIT => {
                let (active_crc, staged_crc) = (staging.active_crc(), staging.staged_crc());
                entry(&CommitObject { active_crc, staged_crc, ..Default::default() }.words(), place)
            }
            _ => Err(Abort::NoObject),
        }
    }
}

/// Returns the word at a sub-index, which counts from 1.
#[inline(never)]
pub(crate) fn entry(words: &[u32], sub_index: u8) -> Result<u32, Abort> {
    let place = usize::from(sub_index).wrapping_sub(1);
    words.get(place).copied().ok_or(Abort::NoSubIndex)
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
fn put_text(text: &str, value: &mut ValueBuffer) -> Result<(), Abort> {
    let text = if text.is_empty() { " " } else { text };
    value.extend_from_slice(text.as_bytes()).map_err(|_| Abort::Memory)
}

/// Returns the state of a watch of the model (2007h).
fn watch_object(watch: Option<&ResidualWatch>) -> WatchObject {
    /// It is unknown whether the model is in its band, for example until the means have settled.
    const UNKNOWN: u32 = 2;
    let Some(watch) = watch else {
        return WatchObject { in_band: UNKNOWN, ..Default::default() };
    };
    let counters = watch.counters();
    WatchObject {
        in_band: watch.in_band().map_or(UNKNOWN, u32::from),
        windows: counters.windows,
        windows_out_of_band: counters.windows_out_of_band,
        alarms: counters.alarms,
        largest_in_bands: counters.largest_in_bands.to_bits(),
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
