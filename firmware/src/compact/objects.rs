//! The objects of a compact node: those of the whole driver that it serves, with the same types and rights.

use super::device::Device;
use crate::driver::counters::Counters;
use crate::driver::objects::common::{CommonObjects, check_entry, is_staged, put, written};
use crate::driver::objects::numbers::entry;
use crate::node::dictionary::records::{
    CommitObject, MeasuredObject, NetworkObject, OperationObject, StateObject, TraceObject,
};
use crate::node::dictionary::{self, Access, LOAD_SIGNATURE, SAVE_SIGNATURE, index};
use crate::node::sdo::{Abort, Objects, ValueBuffer};
use canopen_rs::Address;
use compensator_core::can::{NodeId, SyncFrame, cob_id};
use compensator_core::network::record as network_record;
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

/// Returns the entry at an address.
fn find(at: Address) -> Result<dictionary::Entry, Abort> {
    if !dictionary::is_compact(at.index) {
        return Err(Abort::NoObject);
    }
    dictionary::find(at.index, at.subindex)
}

impl<F: NorFlash> Objects for Device<F> {
    fn check_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        let entry = find(at)?;
        check_entry(&entry, length)?;
        if !entry.is_written_armed && self.is_bridge_in_use() {
            let why = text!("the joint is armed, and nothing is written then: disarm first");
            return Err(self.staging.refuse(Abort::State, why));
        }
        Ok(())
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        let (value, number) = written(&find(at)?, value)?;
        self.write_number(at, number, value)
    }

    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
        let entry = find(at)?;
        if entry.access == Access::WriteOnly {
            return Err(Abort::WriteOnly);
        }
        if let Some(read) = self.common().read(at, value) {
            return read;
        }
        let number = match (at.index, at.subindex) {
            (_, 0) if let Some(count) = self.common().count(at.index) => count,
            (index::COMMIT, CommitObject::NETWORK_RECORD) => {
                let record = network_record::emit(None);
                return value.extend_from_slice(&record).map_err(|_| Abort::Memory);
            }
            (index, place) => self.number(index, place)?,
        };
        put(&entry, number, value)
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
            (_, place) if self.number(index::OPERATION, place) == Ok(number) => {}
            _ => {
                let why = text!("a compact node has no HIL and sends no CAN FD");
                return Err(self.staging.refuse(Abort::Value, why));
            }
        }
        changed.validate().map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.settings = changed;
        Ok(())
    }

    fn common(&self) -> CommonObjects<'_> {
        CommonObjects {
            name: "friction-compensated joint, compact",
            identity: &self.identity,
            settings: &self.settings,
            history: &self.history,
            staging: &self.staging,
            supervisor: &self.supervisor,
            watch: self.watch.as_ref(),
            inputs: &self.inputs,
            blocking: self.blocking,
            is_armed: self.supervisor.is_armed(),
        }
    }

    fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let own = |base: u16| u32::from(base) + u32::from(self.node().number());
        match at_index {
            index::DEVICE_TYPE => Ok(DEVICE_TYPE),
            FIRST_TRANSMIT..=LAST_TRANSMIT => {
                let slot = usize::from(at_index - FIRST_TRANSMIT);
                Ok(match place {
                    1 => TRANSMIT_BASES.get(slot).map_or(0, |base| own(*base)),
                    TRANSMISSION_TYPE => self.sync_type(slot).into(),
                    _ => 0,
                })
            }
            // It sends no CAN FD, whatever a driver has stored.
            index::OPERATION if place == OperationObject::FD_TELEMETRY => Ok(0),
            index::TRACE => {
                let (sequence, joint_kind) = (self.samples.sequence(), self.joint_kind);
                entry(&TraceObject { run: 0, sequence, joint_kind }.words(), place)
            }
            // There are neither networks nor terms.
            index::NETWORK => entry(&NetworkObject::default().words(), place),
            index::LIVE_TERMS => Ok(0),
            index::FRAME_COUNTERS => {
                let (sent, not_sent) = (self.outbox.sent(), self.outbox.lost());
                entry(&Counters { sent, not_sent, ..self.counters }.words(), place)
            }
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
            _ => self.common().number(at_index, place),
        }
    }
}
