//! Reading and writing the objects of the dictionary.

pub(crate) mod common;
pub(crate) mod numbers;

use super::device::Device;
use super::motion::{Refused, Target};
use crate::hil::NumberType;
use crate::node::dictionary::records::{
    AccessObject, CommitObject, HoldingBrakeObject, OperationObject, ScopeObject, StateObject,
    TraceObject,
};
use crate::node::dictionary::{self, Access, LOAD_SIGNATURE, SAVE_SIGNATURE, index};
use crate::node::sdo::{Abort, Objects, ValueBuffer};
use crate::node_settings::InputSource;
use crate::setting_error::SettingError;
use canopen_rs::Address;
use common::{check_entry, is_staged, put, written};
use compensator_core::can::{JointKind, Message, NodeId, TraceEntry};
use compensator_core::network::record as network_record;
use compensator_core::parameters::Text;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Objects for Device<F> {
    fn check_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        check_entry(&entry, length)?;
        self.check_level(entry.level)?;
        if !entry.is_written_armed && self.is_bridge_in_use() {
            return Err(self.refuse_armed());
        }
        Ok(())
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        let (value, number) = written(&entry, value)?;
        match at.index {
            index::PROGRAM_DATA => self.write_program(value),
            ..0x2000 => self.write_communication(at, number),
            0x2000..0x6000 => self.write_joint(at, number, value),
            _ => self.write_profile(at, number),
        }
    }

    fn begin_stream(&mut self, at: Address, _declared: Option<usize>) -> Result<bool, Abort> {
        Ok(at.index == index::PROGRAM_DATA)
    }

    fn write_part(&mut self, at: Address, _offset: usize, part: &[u8]) -> Result<(), Abort> {
        // The joint may have been armed since the begin of the transfer.
        self.check_write(at, None)?;
        self.write_program(part)
    }

    fn end_stream(&mut self, _at: Address, _length: usize) -> Result<(), Abort> {
        Ok(())
    }

    fn read(&mut self, at: Address, value: &mut ValueBuffer) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        if entry.access == Access::WriteOnly {
            return Err(Abort::WriteOnly);
        }
        if let Some(read) = self.common().read(at, value) {
            return read;
        }
        let number = match (at.index, at.subindex) {
            (mapping, 0) if dictionary::is_mapping(mapping) => self.number(mapping, 0)?,
            (_, 0) if let Some(count) = self.common().count(at.index) => count,
            (index::COMMIT, CommitObject::NETWORK_RECORD) => {
                let record = network_record::emit(self.staging.staged().network.as_ref());
                return value.extend_from_slice(&record).map_err(|_| Abort::Memory);
            }
            (index::ACCESS, AccessObject::CHALLENGE) => {
                return value.extend_from_slice(&self.challenge()).map_err(|_| Abort::Memory);
            }
            (index, place) => self.number(index, place)?,
        };
        put(&entry, number, value)
    }

    fn stream_length(&mut self, at: Address) -> Result<Option<usize>, Abort> {
        match (at.index, at.subindex) {
            (index::LEVEL_TREND, 0) => return self.trend_length().map(Some),
            (index::SCOPE, ScopeObject::DATA) => {}
            _ => return Ok(None),
        }
        match self.scope.readable_bytes() {
            0 => {
                Err(self.staging.refuse(Abort::Refused, text!("the scope has no complete capture")))
            }
            length => Ok(Some(length)),
        }
    }

    fn read_part(&mut self, at: Address, offset: usize, part: &mut [u8]) -> Result<(), Abort> {
        match (at.index, at.subindex) {
            (index::LEVEL_TREND, 0) => self.read_trend(offset, part),
            (index::SCOPE, ScopeObject::DATA) => self.scope.read(offset, part),
            _ => return Err(Abort::Command),
        }
        Ok(())
    }
}

impl<F: NorFlash> Device<F> {
    /// Writes an object of the communication profile (1000h to 1FFFh).
    fn write_communication(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        match at.index {
            index::ERROR_FIELD if number == 0 => {
                self.history.clear_errors();
                Ok(())
            }
            index::ERROR_FIELD => Err(Abort::Value),
            index::PROGRAM_CONTROL => self.control_program(number as u8),
            index::STORE if number == SAVE_SIGNATURE => {
                self.refuse_in_trial()?;
                self.save()
            }
            index::RESTORE if number == LOAD_SIGNATURE => self.restore_defaults(),
            index::STORE | index::RESTORE => Err(self.staging.refuse(
                Abort::Refused,
                text!("save and load need their own word (65766173h, 64616F6Ch)"),
            )),
            index::AWAITED_HEARTBEAT => self.write_setting(at, number),
            index::HEARTBEAT => {
                self.set_heartbeat(number as u16);
                Ok(())
            }
            // The deadline of the targets is stored.
            index::RECEIVE_DRIVE if at.subindex == 5 => self.write_setting(at, number),
            _ => self.write_pdo(at, number),
        }
    }

    /// Writes an object of the joint (2000h to 5FFFh).
    fn write_joint(&mut self, at: Address, number: u32, value: &[u8]) -> Result<(), Abort> {
        match at.index {
            index::OPERATION => self.write_setting(at, number),
            index::HOLDING_BRAKE if at.subindex == HoldingBrakeObject::TEST_ORDER => {
                self.order_brake_test(number as u8)
            }
            index::HOLDING_BRAKE | index::HOMING_STOP => {
                self.set_drive_setting(at.index, at.subindex, number)
            }
            index::TRACE => self.write_trace(at.subindex, number),
            index::INPUTS => {
                self.input(at.subindex, number);
                Ok(())
            }
            index::SCOPE | index::SCOPE_SIGNALS => self.write_scope(at.index, at.subindex, number),
            index::ACCESS => self.write_access(at.subindex, value),
            index::TRIAL => self.write_trial(at.subindex, number),
            index::ADAPTATION => self.write_adaptation(at.index, at.subindex, number),
            index::TUNING => self.write_tuning(at.subindex, number),
            index::COMMISSIONING => self.commission(number),
            index::COMMISSIONING_RUN => self.write_commissioning(at.subindex, number),
            index::STATE => match at.subindex {
                StateObject::REQUEST => self.request(number as u8),
                _ => self.set_position(f32::from_bits(number)),
            },
            staged if is_staged(staged) => self.staging.write(staged, at.subindex, value),
            index::COMMIT => match at.subindex {
                CommitObject::COMMIT => self.commit(number),
                CommitObject::DISCARD => {
                    self.staging.discard();
                    Ok(())
                }
                CommitObject::FRICTION_RECORD => self.staging.write_record(value),
                CommitObject::NETWORK_RECORD => self.staging.write_network(value),
                _ => self.staging.write_drive(value),
            },
            _ => Err(Abort::ReadOnly),
        }
    }

    /// Writes an object of the drive profile (6000h to 67FFh).
    fn write_profile(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        let mut target = Target::default();
        if target.add(at.index, number) {
            return self.take_target(&target);
        }
        match at.index {
            index::MODE => return self.set_mode(number as i8),
            index::TOUCH_FUNCTION => return self.set_touch_function(number as u16),
            index::HOMING_METHOD => {
                let taken = self.motion.set_homing_method(number as i8);
                return taken.map_err(|refused| self.refuse(refused));
            }
            index::MAX_MOTOR_SPEED => self.motion.profile.max_motor_rpm = Some(number),
            index::HOME_OFFSET => self.motion.profile.home_offset_micro_rad = number as i32,
            index::MAX_TORQUE => self.motion.profile.max_permille = number as u16,
            _ => return self.set_drive_setting(at.index, at.subindex, number),
        }
        Ok(())
    }

    fn write_setting(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        let mut changed = *self.settings();
        let byte = number as u8;
        match (at.index, at.subindex) {
            (index::AWAITED_HEARTBEAT, _) => changed.awaited_heartbeat = number,
            (index::RECEIVE_DRIVE, _) => changed.target_timeout_ms = number as u16,
            (_, OperationObject::SOURCE) => {
                changed.source = match byte {
                    0 => InputSource::Sensors,
                    1 => InputSource::Bus,
                    _ => {
                        return Err(
                            self.refuse_setting(text!("source"), text!("0 (sensors) or 1 (bus)"))
                        );
                    }
                }
            }
            (_, OperationObject::NUMBER) => {
                changed.number = NumberType::from_code(byte)
                    .ok_or_else(|| self.refuse_setting(text!("number"), NumberType::LEGAL_CODES))?;
            }
            (_, OperationObject::PERIOD_S) => changed.period_s = f32::from_bits(number),
            (_, OperationObject::CAMPAIGN_H) => changed.campaign_h = f32::from_bits(number),
            (_, OperationObject::TELEMETRY_EVERY) => changed.telemetry_every = byte,
            (_, OperationObject::NODE) => {
                changed.node = NodeId::new(byte)
                    .ok_or_else(|| self.refuse_setting(text!("node"), text!("1 to 127")))?;
            }
            (_, OperationObject::DATA_BIT_RATE) => changed.data_bit_rate_kbit = number as u16,
            (_, OperationObject::FD_TELEMETRY) => {
                let most = u8::from(self.sends_fd);
                if byte > most {
                    let legal = text!("0, or 1 with a controller that sends CAN FD");
                    return Err(self.refuse_setting(text!("fd_telemetry"), legal));
                }
                changed.fd_telemetry = byte == 1;
            }
            _ => changed.bit_rate_kbit = number as u16,
        }
        changed.validate().map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.set_settings(changed)
    }

    /// Refuses a write because the bridge is in use.
    pub(super) fn refuse_armed(&mut self) -> Abort {
        self.refuse(Refused::armed())
    }

    /// Refuses a setting that is out of range.
    #[inline(never)]
    pub(super) fn refuse_setting(&mut self, name: Text, legal: Text) -> Abort {
        self.staging.refuse(Abort::Value, SettingError { name, legal })
    }

    fn write_trace(&mut self, place: u8, number: u32) -> Result<(), Abort> {
        let entry = match place {
            TraceObject::RUN => TraceEntry::Run(number),
            TraceObject::SEQUENCE => TraceEntry::Sequence(number),
            _ => TraceEntry::JointKind(match number {
                0 => JointKind::Revolute,
                1 => JointKind::Prismatic,
                _ => {
                    return Err(
                        self.refuse_setting(text!("joint_kind"), text!("0 (turns) or 1 (slides)"))
                    );
                }
            }),
        };
        let node = self.settings().node;
        self.trace(entry, &Message::Entry(node, entry));
        Ok(())
    }
}
