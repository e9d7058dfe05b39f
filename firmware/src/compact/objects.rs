//! The objects of a compact node: those of the whole driver that it serves, with the same types and rights.

use super::device::Device;
use crate::driver::counters::Counters;
use crate::driver::device::values::watch_object;
use crate::driver::objects::numbers::entry;
use crate::driver::objects::{is_staged, text};
use crate::node::dictionary::records::{
    CommissioningObject, CommitObject, MeasuredObject, NetworkObject, OperationObject,
    SdoServerObject, StateObject, TraceObject,
};
use crate::node::dictionary::{self, Access, LOAD_SIGNATURE, SAVE_SIGNATURE, index};
use crate::node::sdo::{Abort, Objects, ValueBuffer};
use crate::refusal;
use crate::supervisor::JointState;
use canopen_rs::Address;
use compensator_core::can::{NodeId, SyncFrame, cob_id};
use compensator_core::network::record as network_record;
use compensator_core::record;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// No device profile: the node has no modes of CiA 402.
const DEVICE_TYPE: u32 = 0;
/// Transmit PDOs that are sent at a SYNC.
const FIRST_TRANSMIT: u16 = index::TRANSMIT_ANSWER;
const LAST_TRANSMIT: u16 = index::TRANSMIT_TORQUE;
/// Identifiers of the transmit PDOs, without the node's number.
const TRANSMIT_BASES: [u16; 5] =
    [cob_id::TPDO_1, cob_id::TPDO_2, cob_id::TPDO_3, cob_id::TPDO_4, cob_id::TPDO_5];
/// Sub-index of a PDO's transmission type; the one before is its identifier.
const TRANSMISSION_TYPE: u8 = 2;

/// Returns true if a compact node has this object.
pub const fn is_served(at_index: u16) -> bool {
    matches!(
        at_index,
        index::DEVICE_TYPE
            | index::ERROR_REGISTER
            | index::ERROR_FIELD
            | index::SYNC_IDENTIFIER
            | index::DEVICE_NAME
            | index::HARDWARE_VERSION
            | index::SOFTWARE_VERSION
            | index::STORE
            | index::RESTORE
            | index::EMERGENCY_IDENTIFIER
            | index::AWAITED_HEARTBEAT
            | index::HEARTBEAT
            | index::IDENTITY
            | index::SDO_SERVER
            | index::TRANSMIT_ANSWER
            | index::TRANSMIT_STATUS
            | index::TRANSMIT_TELEMETRY
            | index::TRANSMIT_MOTION
            | index::TRANSMIT_TORQUE
            | index::TRACE
            | index::OPERATION
            | index::STATE
            | index::FRAME_COUNTERS
            | index::INPUTS
            | index::CODE_COUNTERS
            | index::WATCH
            | index::LAST_PANIC
            | index::MEASURED
            | index::COMMISSIONING
            | index::NETWORK
            | index::LIVE_TERMS
            | index::COMMIT
            | index::REFUSAL
    ) || is_staged(at_index)
}

/// Returns the entry at an address.
fn find(at: Address) -> Result<dictionary::Entry, Abort> {
    if !is_served(at.index) {
        return Err(Abort::NoObject);
    }
    dictionary::find(at.index, at.subindex)
}

impl<F: NorFlash> Objects for Device<F> {
    fn check_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        let entry = find(at)?;
        if !matches!(entry.access, Access::ReadWrite | Access::WriteOnly | Access::Input) {
            return Err(Abort::ReadOnly);
        }
        if let (Some(found), Some(expected)) = (length, entry.data.length()) {
            if found > expected {
                return Err(Abort::TooLong);
            }
            if found < expected {
                return Err(Abort::TooShort);
            }
        }
        if !entry.is_written_armed && self.is_bridge_in_use() {
            let why = text!("the joint is armed, and nothing is written then: disarm first");
            return Err(self.staging.refuse(Abort::State, why));
        }
        Ok(())
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        // An expedited write need not state its size: then it is the size of the object.
        let value = match find(at)?.data.length() {
            Some(length) => value.get(..length).ok_or(Abort::TooShort)?,
            None => value,
        };
        let mut word = [0; 4];
        for (place, byte) in word.iter_mut().zip(value) {
            *place = *byte;
        }
        self.write_number(at, u32::from_le_bytes(word), value)
    }

    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
        let entry = find(at)?;
        if entry.access == Access::WriteOnly {
            return Err(Abort::WriteOnly);
        }
        let count = dictionary::value_count(at.index);
        let copied = match (at.index, at.subindex) {
            (index::DEVICE_NAME, _) => return text("friction-compensated joint, compact", value),
            (index::HARDWARE_VERSION, _) => return text(self.identity.hardware, value),
            (index::SOFTWARE_VERSION, _) => return text(env!("CARGO_PKG_VERSION"), value),
            (index::LAST_PANIC, _) => return text(self.history.panic(), value),
            (index::REFUSAL, _) => value.extend_from_slice(&refusal::emit(self.staging.reason())),
            (index::COMMIT, CommitObject::FRICTION_RECORD) => {
                value.extend_from_slice(&record::emit(&self.staging.staged().friction))
            }
            (index::COMMIT, CommitObject::NETWORK_RECORD) => {
                value.extend_from_slice(&network_record::emit(None))
            }
            (index::COMMIT, CommitObject::DRIVE_RECORD) => {
                value.extend_from_slice(&self.staging.staged().emit_drive())
            }
            (index::ERROR_FIELD, 0) => {
                value.extend_from_slice(&self.history.error_count().to_le_bytes()[..1])
            }
            (_, 0) if let Some(count) = count => value.extend_from_slice(&[count]),
            (staged, place) if is_staged(staged) => {
                return self.staging.read(staged, place, value);
            }
            (index, place) => {
                let bytes = self.number(index, place)?.to_le_bytes();
                let length = entry.data.length().unwrap_or(4);
                value.extend_from_slice(bytes.get(..length).unwrap_or(&bytes))
            }
        };
        copied.map_err(|_| Abort::Memory)
    }
}

impl<F: NorFlash> Device<F> {
    fn write_number(&mut self, at: Address, number: u32, value: &[u8]) -> Result<(), Abort> {
        match (at.index, at.subindex) {
            (index::ERROR_FIELD, _) if number == 0 => self.history.clear_errors(),
            (index::ERROR_FIELD, _) => return Err(Abort::Value),
            (index::STORE, _) if number == SAVE_SIGNATURE => return self.save(),
            (index::RESTORE, _) if number == LOAD_SIGNATURE => return self.restore_defaults(),
            (index::STORE | index::RESTORE, _) => {
                let why = text!("save and load need their own word (65766173h, 64616F6Ch)");
                return Err(self.staging.refuse(Abort::Refused, why));
            }
            (index::HEARTBEAT, _) => self.settings.heartbeat_ms = number as u16,
            (index::AWAITED_HEARTBEAT | index::OPERATION, _) => {
                return self.write_setting(at, number);
            }
            (FIRST_TRANSMIT..=LAST_TRANSMIT, place) => {
                return self.write_sync_type(at.index, place, number);
            }
            (index::STATE, StateObject::REQUEST) => return self.request(number as u8),
            (index::STATE, _) => return self.set_position(f32::from_bits(number)),
            (index::TRACE, TraceObject::JOINT_KIND) if number <= 1 => self.joint_kind = number,
            (index::INPUTS, place) => self.input(place, number),
            (index::COMMISSIONING, _) => return self.confirm_wiring(number),
            (index::COMMIT, CommitObject::COMMIT) => return self.commit(number),
            (index::COMMIT, CommitObject::DISCARD) => self.staging.discard(),
            (index::COMMIT, CommitObject::FRICTION_RECORD) => {
                return self.staging.write_record(value);
            }
            (index::COMMIT, CommitObject::NETWORK_RECORD) => {
                return self.staging.write_network(value);
            }
            (index::COMMIT, _) => return self.staging.write_drive(value),
            (staged, place) if is_staged(staged) => {
                return self.staging.write(staged, place, value);
            }
            _ => return Err(Abort::ReadOnly),
        }
        Ok(())
    }

    /// Sets how often a frame of a sample is sent. Its identifier and content are fixed.
    fn write_sync_type(&mut self, at_index: u16, place: u8, number: u32) -> Result<(), Abort> {
        let slot = self.sync_types.get_mut(usize::from(at_index - FIRST_TRANSMIT));
        match slot {
            Some(slot)
                if place == TRANSMISSION_TYPE
                    && (1..=u32::from(SyncFrame::LAST)).contains(&number) =>
            {
                *slot = number as u8;
                Ok(())
            }
            _ => {
                let why =
                    text!("a compact node sends a PDO at every n-th SYNC: sub-index 2 = 1 to 240");
                Err(self.staging.refuse(Abort::Value, why))
            }
        }
    }

    fn write_setting(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        let mut changed = self.settings;
        match (at.index, at.subindex) {
            (index::AWAITED_HEARTBEAT, _) => changed.awaited_heartbeat = number,
            (_, OperationObject::NODE) => {
                let why = text!("node: must be 1 to 127");
                changed.node = NodeId::new(number as u8)
                    .ok_or_else(|| self.staging.refuse(Abort::Value, why))?;
            }
            (_, OperationObject::BIT_RATE) => changed.bit_rate_kbit = number as u16,
            (_, OperationObject::DATA_BIT_RATE) => changed.data_bit_rate_kbit = number as u16,
            (_, OperationObject::TELEMETRY_EVERY) => changed.telemetry_every = number as u8,
            (_, OperationObject::CAMPAIGN_H) => changed.campaign_h = f32::from_bits(number),
            // A tool may write the value that a compact node has: its own sensors, classic frames.
            (_, place)
                if self.operation_object().words().get(usize::from(place) - 1) == Some(&number) => {
            }
            _ => {
                let why = text!("a compact node has no HIL and sends no CAN FD");
                return Err(self.staging.refuse(Abort::Value, why));
            }
        }
        changed.validate().map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.settings = changed;
        Ok(())
    }

    fn operation_object(&self) -> OperationObject {
        let settings = &self.settings;
        OperationObject {
            source: settings.source as u32,
            number: settings.number as u32,
            period_s: settings.period_s.to_bits(),
            campaign_h: settings.campaign_h.to_bits(),
            telemetry_every: settings.telemetry_every.into(),
            node: settings.node.number().into(),
            bit_rate_kbit: settings.bit_rate_kbit.into(),
            data_bit_rate_kbit: settings.data_bit_rate_kbit.into(),
            fd_telemetry: 0,
        }
    }

    fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let own = |base: u16| u32::from(base) + u32::from(self.node().number());
        match at_index {
            index::DEVICE_TYPE => Ok(DEVICE_TYPE),
            index::ERROR_REGISTER => Ok(self.error_register().into()),
            index::ERROR_FIELD => self.history.error(place).ok_or(Abort::NoSubIndex),
            index::SYNC_IDENTIFIER => Ok(cob_id::SYNC.into()),
            index::EMERGENCY_IDENTIFIER => Ok(own(cob_id::EMERGENCY)),
            // Parameters are saved and restored on command, not automatically.
            index::STORE | index::RESTORE => Ok(1),
            index::AWAITED_HEARTBEAT => Ok(self.settings.awaited_heartbeat),
            index::HEARTBEAT => Ok(self.settings.heartbeat_ms.into()),
            index::IDENTITY => entry(&self.identity.object().words(), place),
            index::SDO_SERVER => entry(
                &SdoServerObject {
                    client_to_server: own(cob_id::SDO_REQUEST),
                    server_to_client: own(cob_id::SDO_ANSWER),
                }
                .words(),
                place,
            ),
            FIRST_TRANSMIT..=LAST_TRANSMIT => {
                let slot = usize::from(at_index - FIRST_TRANSMIT);
                Ok(match place {
                    1 => TRANSMIT_BASES.get(slot).map_or(0, |base| own(*base)),
                    TRANSMISSION_TYPE => self.sync_type(slot).into(),
                    _ => 0,
                })
            }
            index::OPERATION => entry(&self.operation_object().words(), place),
            index::STATE => entry(&self.state_object().words(), place),
            index::TRACE => {
                let (sequence, joint_kind) = (self.samples.sequence(), self.joint_kind);
                entry(&TraceObject { run: 0, sequence, joint_kind }.words(), place)
            }
            index::WATCH => entry(&watch_object(self.watch.as_ref()).words(), place),
            // There are neither networks nor terms.
            index::NETWORK => entry(&NetworkObject::default().words(), place),
            index::LIVE_TERMS => Ok(0),
            index::FRAME_COUNTERS => {
                let (sent, not_sent) = (self.outbox.sent(), self.outbox.lost());
                entry(&Counters { sent, not_sent, ..self.counters }.words(), place)
            }
            index::INPUTS => entry(&self.inputs.words(), place),
            index::CODE_COUNTERS => entry(self.supervisor.counts(), place),
            index::MEASURED => {
                let report = self.current_loop.report();
                let measured = MeasuredObject {
                    velocity_rad_s: report.velocity_rad_s.to_bits(),
                    position_rad: report.position_rad.to_bits(),
                    torque_nm: report.motor_torque_nm.to_bits(),
                    load_torque_nm: self.inputs.load_torque_nm,
                };
                entry(&measured.words(), place)
            }
            index::COMMISSIONING => {
                let wiring_crc = self.staging.wiring_crc();
                let commissioning = CommissioningObject {
                    commissioned: self.is_commissioned().into(),
                    wiring_crc,
                    proven: (self.settings.proven == wiring_crc).into(),
                    ..Default::default()
                };
                entry(&commissioning.words(), place)
            }
            index::COMMIT => {
                let (active_crc, staged_crc) = self.staging.crcs();
                entry(&CommitObject { active_crc, staged_crc, ..Default::default() }.words(), place)
            }
            _ => Err(Abort::NoObject),
        }
    }

    fn state_object(&self) -> StateObject {
        let state = match self.supervisor.state() {
            JointState::Safe => 0,
            JointState::Armed => 1,
            JointState::Fault => 2,
        };
        StateObject {
            state,
            faults: self.supervisor.faults().fault_bits(),
            limits: self.supervisor.limits().limit_bits(),
            blocking_codes: self.blocking,
            failed_self_test: self.supervisor.failed_self_test().into(),
            ..Default::default()
        }
    }
}
