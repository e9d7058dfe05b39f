//! The objects of a compact node: those of the whole driver that it serves, with the same types and rights.

use super::device::Device;
use crate::joint_node::objects::{check_entry, entry, put, written};
use crate::node::dictionary::records::{NetworkObject, OperationObject, StateObject, TraceObject};
use crate::node::dictionary::{self, index};
use crate::node::sdo::{Abort, Objects, ValueBuffer};
use canopen_rs::Address;
use compensator_core::can::{SyncFrame, cob_id};
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
        self.base.check_armed(&entry)
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        let (value, number) = written(&find(at)?, value)?;
        if let Some(written) = self.base.write(at, number, value) {
            return written;
        }
        match (at.index, at.subindex) {
            (index::STORE, _) => self.save(),
            (index::RESTORE, _) => self.restore_defaults(),
            (index::AWAITED_HEARTBEAT | index::OPERATION, _) => self.write_setting(at, number),
            (FIRST_TRANSMIT..=LAST_TRANSMIT, place) => {
                self.write_sync_type(at.index, place, number)
            }
            (index::STATE, StateObject::REQUEST) => self.request(number as u8),
            (index::STATE, _) => self.base.set_position(f32::from_bits(number)),
            (index::TRACE, TraceObject::JOINT_KIND) if number <= 1 => {
                self.joint_kind = number;
                Ok(())
            }
            (index::TRACE, TraceObject::JOINT_KIND) => {
                let legal = text!("0 (turns) or 1 (slides)");
                Err(self.base.refuse_setting(text!("joint_kind"), legal))
            }
            (index::INPUTS, place) => {
                // Velocity, position and torque of this joint are measured; its load torque is not.
                if let Some(message) = self.base.input_message(place, number) {
                    self.base.process_input(&message);
                }
                Ok(())
            }
            (index::COMMISSIONING, _) => self.base.confirm_wiring(number),
            (index::COMMIT, _) => self.commit(number),
            _ => Err(Abort::ReadOnly),
        }
    }

    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
        let entry = find(at)?;
        if let Some(read) = self.base.read(&entry, at, value) {
            return read;
        }
        put(&entry, self.number(at.index, at.subindex)?, value)
    }
}

impl<F: NorFlash> Device<F> {
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
                Err(self.base.refuse(Abort::Value, why))
            }
        }
    }

    fn write_setting(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        if at.index == index::OPERATION
            && matches!(
                at.subindex,
                OperationObject::SOURCE
                    | OperationObject::NUMBER
                    | OperationObject::PERIOD_S
                    | OperationObject::FD_TELEMETRY
            )
        {
            // A tool may write the value that a compact node has: its own sensors, classic frames.
            if self.number(at.index, at.subindex) == Ok(number) {
                return Ok(());
            }
            let why = text!("a compact node has no HIL and sends no CAN FD");
            return Err(self.base.refuse(Abort::Value, why));
        }
        let changed = self.base.changed_settings(at, number)?;
        self.base.check_settings(&changed)?;
        self.base.settings = changed;
        Ok(())
    }

    fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        match at_index {
            index::DEVICE_TYPE => Ok(DEVICE_TYPE),
            FIRST_TRANSMIT..=LAST_TRANSMIT => {
                let slot = usize::from(at_index - FIRST_TRANSMIT);
                let node = self.base.settings.node.number();
                Ok(match place {
                    1 => TRANSMIT_BASES.get(slot).map_or(0, |base| base + u16::from(node)).into(),
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
            index::MEASURED => entry(&self.base.measured().words(), place),
            _ => self.base.number(at_index, place),
        }
    }
}
