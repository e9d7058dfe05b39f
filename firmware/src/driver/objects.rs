//! What each object of the dictionary reads as, and what writing it does.

use super::device::Device;
use crate::hil::Number;
use crate::node::dictionary::{self, Access, ERRORS_KEPT, LOAD, Object, SAVE, index};
use crate::node::sdo::{Abort, Objects, Value};
use crate::node_settings::{SettingError, Source};
use canopen_rs::Address;
use compensator_core::can::{Entry, JointKind, Message, Node, base};
use compensator_core::record;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Objects for Device<F> {
    fn may_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        if !matches!(entry.access, Access::ReadWrite | Access::WriteOnly) {
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
        // A request to disarm, and what a trace says of itself, are always heard.
        let always = matches!(
            (at.index, at.subindex),
            (index::STATE, 1) | (index::TRACE | index::ERROR_FIELD, _)
        );
        if !always && self.is_armed() {
            let why = "the joint is armed, and nothing is written then: disarm first";
            return Err(self.staging.refuse(Abort::State, why));
        }
        Ok(())
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        // The size of an expedited write need not be said: it is that of the object then.
        let value = match entry.data.length() {
            Some(length) => value.get(..length).ok_or(Abort::TooShort)?,
            None => value,
        };
        let mut word = [0; 4];
        for (place, byte) in word.iter_mut().zip(value) {
            *place = *byte;
        }
        let number = u32::from_le_bytes(word);
        match at.index {
            index::ERROR_FIELD if number == 0 => {
                self.errors.clear();
                Ok(())
            }
            index::ERROR_FIELD => Err(Abort::Value),
            index::STORE if number == SAVE => self.save(),
            index::RESTORE if number == LOAD => self.restore_defaults(),
            index::STORE | index::RESTORE => Err(self.staging.refuse(
                Abort::Refused,
                "save and load want their own word (65766173h, 64616F6Ch)",
            )),
            index::AWAITED_HEARTBEAT | index::HEARTBEAT | index::OPERATION => {
                self.write_setting(at, number)
            }
            index::TRACE => self.write_trace(at.subindex, number),
            index::STATE => match at.subindex {
                1 => self.request(number as u8),
                _ => self.set_position(f32::from_bits(number)),
            },
            index::MODEL
            | index::ENVELOPE
            | index::COMPENSATOR
            | index::PARAMETERS
            | index::MOTOR
            | index::THRESHOLDS
            | index::WATCH_PARAMETERS => self.staging.write(at.index, at.subindex, value),
            index::COMMIT => match at.subindex {
                3 => self.commit(number),
                4 => {
                    self.staging.discard();
                    Ok(())
                }
                5 => self.staging.write_record(value),
                _ => self.staging.write_drive(value),
            },
            _ => Err(Abort::ReadOnly),
        }
    }

    fn read(&mut self, at: Address, value: &mut Value) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        if entry.access == Access::WriteOnly {
            return Err(Abort::WriteOnly);
        }
        let object = Object::find(at.index).ok_or(Abort::NoObject)?;
        let is_variable = matches!(object.shape, dictionary::Shape::Variable(_));
        let number = match (at.index, at.subindex) {
            (index::ERROR_FIELD, 0) => self.errors.len() as u32,
            (_, 0) if !is_variable => u32::from(object.last()),
            (index::DEVICE_NAME, _) => return text("friction-compensated joint driver", value),
            (index::HARDWARE_VERSION, _) => return text(self.identity.hardware, value),
            (index::SOFTWARE_VERSION, _) => return text(env!("CARGO_PKG_VERSION"), value),
            (index::LAST_PANIC, _) => return text(&self.last_panic, value),
            (index::REFUSAL, _) => return text(self.staging.reason(), value),
            (index::COMMIT, 5) => {
                let record = record::emit(&self.staging.staged().friction);
                return value.extend_from_slice(&record).map_err(|_| Abort::Memory);
            }
            (index::COMMIT, 6) => {
                let drive = self.staging.staged().emit_drive();
                return value.extend_from_slice(&drive).map_err(|_| Abort::Memory);
            }
            (staged, place) if is_staged(staged) => {
                return self.staging.read(staged, place, value);
            }
            (index, place) => self.number(index, place)?,
        };
        let length = entry.data.length().unwrap_or(4);
        let bytes = number.to_le_bytes();
        value.extend_from_slice(bytes.get(..length).unwrap_or(&bytes)).map_err(|_| Abort::Memory)
    }
}

/// Whether an object is part of the parameter set, which is staged.
const fn is_staged(at_index: u16) -> bool {
    matches!(
        at_index,
        index::MODEL
            | index::ENVELOPE
            | index::COMPENSATOR
            | index::PARAMETERS
            | index::MOTOR
            | index::THRESHOLDS
            | index::WATCH_PARAMETERS
    )
}

/// A text as its bytes; one that is empty reads as a blank, for SDO has no word for nothing.
fn text(text: &str, value: &mut Value) -> Result<(), Abort> {
    let text = if text.is_empty() { " " } else { text };
    value.extend_from_slice(text.as_bytes()).map_err(|_| Abort::Memory)
}

/// What process frames are made of: objects of two numbers each, as index, sub-index and bits.
const fn mapped(index: u16, sub_index: u8, bits: u8) -> u32 {
    (index as u32) << 16 | (sub_index as u32) << 8 | bits as u32
}

/// The mapping of the receive PDOs, in their order.
const RECEIVED: [[u32; 2]; 5] = [
    [mapped(index::INPUTS, 1, 32), mapped(index::INPUTS, 2, 32)],
    [mapped(index::INPUTS, 3, 32), mapped(index::INPUTS, 4, 32)],
    [mapped(index::INPUTS, 5, 32), mapped(index::INPUTS, 6, 32)],
    [mapped(index::INPUTS, 7, 32), mapped(index::INPUTS, 8, 32)],
    [mapped(index::INPUTS, 9, 32), mapped(index::INPUTS, 10, 32)],
];
/// The mapping of the transmit PDOs.
const TRANSMITTED: [[u32; 2]; 3] = [
    [mapped(index::OUTPUTS, 1, 32), mapped(index::OUTPUTS, 2, 32)],
    [mapped(index::OUTPUTS, 3, 32), mapped(index::OUTPUTS, 4, 32)],
    [mapped(index::OUTPUTS, 5, 32), mapped(index::OUTPUTS, 6, 32)],
];
/// Identifiers of the PDOs without the node's number.
const RECEIVED_AT: [u16; 5] =
    [base::MOTION, base::TORQUE, base::SEAL, base::SURROUNDINGS, base::COMMAND];
const TRANSMITTED_AT: [u16; 3] = [base::ANSWER, base::STATUS, base::TELEMETRY];

/// How a PDO travels (CiA 301, table 72): with the SYNC, or whenever it comes.
const SYNCHRONOUS: u32 = 1;
const EVENT_DRIVEN: u32 = 0xFF;

impl<F: NorFlash> Device<F> {
    /// What a number reads as, a float as its bits.
    fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let node = u32::from(self.settings().node.number());
        let nth = usize::from(place).wrapping_sub(1);
        let settings = self.settings();
        let list = |numbers: &[u32]| numbers.get(nth).copied().ok_or(Abort::NoSubIndex);
        let at = |base: u16| u32::from(base) + node;
        let pdo = |table: &[u16], first: u16, kind: u32| {
            let base = *table.get(usize::from(at_index - first)).ok_or(Abort::NoObject)?;
            list(&[at(base), kind])
        };
        match at_index {
            // No device profile.
            index::DEVICE_TYPE => Ok(0),
            index::ERROR_REGISTER => Ok(u32::from(self.error_register())),
            index::ERROR_FIELD => {
                self.errors.iter().rev().nth(nth).copied().ok_or(Abort::NoSubIndex)
            }
            index::SYNC_IDENTIFIER => Ok(base::SYNC.into()),
            index::EMERGENCY_IDENTIFIER => Ok(at(base::EMERGENCY)),
            // Saved and restored on command, not by itself.
            index::STORE | index::RESTORE => Ok(1),
            index::AWAITED_HEARTBEAT => Ok(settings.awaited_heartbeat),
            index::HEARTBEAT => Ok(u32::from(settings.heartbeat_ms)),
            index::IDENTITY => list(&self.identity.numbers()),
            index::SYNC_OVERFLOW => Ok(240),
            index::SDO_SERVER => list(&[at(base::SDO_REQUEST), at(base::SDO_ANSWER)]),
            index::RECEIVE_PDO..=0x1403 => pdo(&RECEIVED_AT, index::RECEIVE_PDO, SYNCHRONOUS),
            0x1404 => pdo(&RECEIVED_AT, index::RECEIVE_PDO, EVENT_DRIVEN),
            index::TRANSMIT_PDO..=0x1802 => pdo(&TRANSMITTED_AT, index::TRANSMIT_PDO, SYNCHRONOUS),
            index::RECEIVE_MAPPING..=0x1604 => {
                let which = usize::from(at_index - index::RECEIVE_MAPPING);
                list(RECEIVED.get(which).ok_or(Abort::NoObject)?)
            }
            index::TRANSMIT_MAPPING..=0x1A02 => {
                let which = usize::from(at_index - index::TRANSMIT_MAPPING);
                list(TRANSMITTED.get(which).ok_or(Abort::NoObject)?)
            }
            index::TRACE => list(&[self.run, self.sequence(), self.joint_kind as u32]),
            index::OPERATION => list(&[
                settings.source as u32,
                settings.number as u32,
                settings.period_s.to_bits(),
                settings.campaign_h.to_bits(),
                u32::from(settings.telemetry_every),
                node,
            ]),
            index::STATE => list(&self.state_words()),
            index::FRAME_COUNTERS => list(&self.counters.words(self.outbox_counts())),
            index::INPUTS => list(&self.last_inputs()),
            index::OUTPUTS => list(&self.last_outputs()),
            index::CODE_COUNTERS => self.code_count(nth).ok_or(Abort::NoSubIndex),
            index::WATCH => list(&self.watch_words()),
            index::COMMIT => list(&[self.staging.active().crc(), self.staging.staged().crc()]),
            _ => Err(Abort::NoObject),
        }
    }

    fn write_setting(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        let mut changed = *self.settings();
        let byte = number as u8;
        match (at.index, at.subindex) {
            (index::HEARTBEAT, _) => changed.heartbeat_ms = number as u16,
            (index::AWAITED_HEARTBEAT, _) => changed.awaited_heartbeat = number,
            (_, 1) => {
                changed.source = match byte {
                    0 => Source::Sensors,
                    1 => Source::Bus,
                    _ => return Err(self.refuse_setting("source", "0 (sensors) or 1 (bus)")),
                }
            }
            (_, 2) => {
                changed.number = match byte {
                    0 => Number::Float,
                    1 => Number::Fixed,
                    _ => return Err(self.refuse_setting("number", "0 (f32) or 1 (fixed point)")),
                }
            }
            (_, 3) => changed.period_s = f32::from_bits(number),
            (_, 4) => changed.campaign_h = f32::from_bits(number),
            (_, 5) => changed.telemetry_every = byte,
            _ => {
                changed.node =
                    Node::new(byte).ok_or_else(|| self.refuse_setting("node", "1 to 127"))?;
            }
        }
        changed.validate().map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.set_settings(changed)
    }

    fn refuse_setting(&mut self, name: &'static str, legal: &'static str) -> Abort {
        self.staging.refuse(Abort::Value, SettingError { name, legal })
    }

    fn write_trace(&mut self, place: u8, number: u32) -> Result<(), Abort> {
        let entry = match place {
            1 => Entry::Run(number),
            2 => Entry::Sequence(number),
            _ => Entry::JointKind(match number {
                0 => JointKind::Revolute,
                1 => JointKind::Prismatic,
                _ => return Err(self.refuse_setting("joint_kind", "0 (turns) or 1 (slides)")),
            }),
        };
        let node = self.settings().node;
        self.trace(entry, &Message::Entry(node, entry));
        Ok(())
    }

    pub(super) fn keep_error(&mut self, code: u16, detail: u16) {
        if self.errors.len() == ERRORS_KEPT {
            self.errors.pop_front();
        }
        // There is room: one has just been taken out.
        let _ = self.errors.push_back(u32::from(code) | u32::from(detail) << 16);
    }
}
