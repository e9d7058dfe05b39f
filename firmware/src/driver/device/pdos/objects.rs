//! Writing the objects of the PDOs: communication parameters, mappings, and the parameters of the SYNC.
//!
//! The dictionary refuses a sub-index that is absent, and a write to one that is read-only, before it comes here.

use super::mapping::Direction;
use super::transmit::is_legal_type;
use super::{PDO_UNUSED, Pdos};
use crate::joint_node::JointBase;
use crate::node::dictionary::index;
use crate::node::dictionary::records::TransmitPdoObject as Parameter;
use crate::node::sdo::Abort;
use canopen_rs::Address;
use compensator_core::can::SyncFrame;
use compensator_core::refusal;
use compensator_core::text;

/// Highest counter of a SYNC.
const LAST_SYNC_COUNTER: u32 = SyncFrame::LAST as u32;

/// The PDO whose parameters or mapping an object holds.
pub struct PdoObjectAddress {
    pub direction: Direction,
    /// Number of the PDO in its direction, from 0.
    pub slot: usize,
    pub is_mapping: bool,
}

impl PdoObjectAddress {
    /// Returns the PDO of an object of CiA 301: parameters from 1400h (receive) and 1800h (transmit), mappings from 1600h and
    /// 1A00h.
    pub const fn of(at_index: u16) -> Self {
        let direction = if at_index >= 0x1800 { Direction::Transmit } else { Direction::Receive };
        Self { direction, slot: (at_index & 0x1FF) as usize, is_mapping: at_index & 0x200 != 0 }
    }
}

impl Pdos {
    /// Writes a PDO parameter, a mapping or a SYNC object.
    pub(super) fn write(
        &mut self,
        base: &mut JointBase,
        at: Address,
        number: u32,
    ) -> Result<(), Abort> {
        let sync = &mut self.sync;
        match at.index {
            index::SYNC_PERIOD => {
                sync.period_us = number;
                return Ok(());
            }
            index::SYNC_WINDOW => {
                sync.window_us = number;
                return Ok(());
            }
            index::SYNC_OVERFLOW => return self.set_sync_overflow(base, number),
            _ => {}
        }
        let PdoObjectAddress { direction, slot, is_mapping } = PdoObjectAddress::of(at.index);
        if is_mapping {
            return self.write_mapping(base, direction, slot, at.subindex, number);
        }
        if at.subindex == Parameter::COB_ID {
            check_identifier(base, number)?;
        }
        if at.subindex == Parameter::TRANSMISSION_TYPE && !is_legal_type(number) {
            let why = refusal!("transmission_type = {u32}: must be 0 to 240, 254 or 255", number);
            return Err(base.refuse(Abort::Value, why));
        }
        if at.subindex == Parameter::SYNC_START && number > LAST_SYNC_COUNTER {
            let why = refusal!("sync_start = {u32}: must be at most 240", number);
            return Err(base.refuse(Abort::Value, why));
        }
        match direction {
            Direction::Receive => {
                let pdo = self.receive.get_mut(slot).ok_or(Abort::NoObject)?;
                pdo.pending = None;
                match at.subindex {
                    Parameter::COB_ID => pdo.identifier = Some(number),
                    Parameter::TRANSMISSION_TYPE => pdo.kind = number as u8,
                    _ => return Err(Abort::ReadOnly),
                }
            }
            Direction::Transmit => {
                let pdo = self.transmit.get_mut(slot).ok_or(Abort::NoObject)?;
                pdo.restart();
                match at.subindex {
                    Parameter::COB_ID => pdo.identifier = Some(number),
                    Parameter::TRANSMISSION_TYPE => pdo.kind = Some(number as u8),
                    Parameter::INHIBIT_TIME => pdo.inhibit_time = number as u16,
                    Parameter::EVENT_TIMER => pdo.event_timer_ms = number as u16,
                    Parameter::SYNC_START => pdo.sync_start = number as u8,
                    _ => return Err(Abort::ReadOnly),
                }
            }
        }
        Ok(())
    }

    fn set_sync_overflow(&mut self, base: &mut JointBase, number: u32) -> Result<(), Abort> {
        if self.sync.period_us != 0 {
            let why =
                text!("sync_counter_overflow: set the communication cycle (1006h) to 0 first");
            return Err(base.refuse(Abort::State, why));
        }
        if number == 1 || number > LAST_SYNC_COUNTER {
            let why = refusal!("sync_counter_overflow = {u32}: must be 0 or 2 to 240", number);
            return Err(base.refuse(Abort::Value, why));
        }
        self.sync.overflow = number as u8;
        Ok(())
    }

    fn write_mapping(
        &mut self,
        base: &mut JointBase,
        direction: Direction,
        slot: usize,
        sub_index: u8,
        number: u32,
    ) -> Result<(), Abort> {
        let (identifier, mapping) = match direction {
            Direction::Receive => (
                self.receive_identifier(slot, base.settings.source),
                self.receive.get_mut(slot).map(|pdo| &mut pdo.mapping),
            ),
            Direction::Transmit => (
                self.transmit_identifier(slot, base.settings.source),
                self.transmit.get_mut(slot).map(|pdo| &mut pdo.mapping),
            ),
        };
        if identifier & PDO_UNUSED == 0 {
            let why =
                text!("a mapping is changed while its PDO is disabled (bit 31 of the identifier)");
            return Err(base.refuse(Abort::State, why));
        }
        let written = mapping.ok_or(Abort::NoObject)?.write(sub_index, number, direction);
        written.map_err(|abort| match abort {
            Abort::State => {
                let why =
                    text!("an entry of a mapping is written while the count (sub-index 0) is 0");
                base.refuse(Abort::State, why)
            }
            other => other,
        })
    }
}

fn check_identifier(base: &mut JointBase, identifier: u32) -> Result<(), Abort> {
    // Bit 30 forbids remote requests, which are never answered.
    let number = identifier & !(PDO_UNUSED | 1 << 30);
    // The identifiers that CiA 301 permits for PDOs: the predefined set, and the free ones above SDO.
    let is_legal = (0x181..=0x57F).contains(&number) || (0x680..=0x6FF).contains(&number);
    if !is_legal && identifier & PDO_UNUSED == 0 {
        let why = refusal!("cob_id = {hex}h: must be 181h to 57Fh or 680h to 6FFh", identifier);
        return Err(base.refuse(Abort::Value, why));
    }
    Ok(())
}
