//! Reading and writing the objects of the dictionary.

mod numbers;

use super::device::Device;
use super::motion::Target;
use crate::hil::NumberType;
use crate::joint_node::objects::{check_entry, put, written};
use crate::node::dictionary::records::{
    AccessObject, HoldingBrakeObject, OperationObject, ScopeObject, StateObject, TraceObject,
};
use crate::node::dictionary::{self, index};
use crate::node::sdo::{Abort, Objects, ValueBuffer};
use crate::node_settings::InputSource;
use canopen_rs::Address;
use compensator_core::can::{JointKind, Message, TraceEntry};
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Objects for Device<F> {
    fn check_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        check_entry(&entry, length)?;
        self.check_level(entry.level)?;
        self.base.check_armed(&entry)
    }

    fn write(&mut self, at: Address, value: &[u8]) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
        let (value, number) = written(&entry, value)?;
        if let Some(written) = self.base.write(at, number, value) {
            return written;
        }
        match at.index {
            index::PROGRAM_DATA => self.write_program(value),
            ..0x2000 => self.write_communication(at, number),
            0x2000..0x6000 => self.write_joint(at, number, value),
            _ => self.write_profile(at, number),
        }
    }

    fn takes_parts(&self, at: Address) -> bool {
        at.index == index::PROGRAM_DATA
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
        if let Some(read) = self.base.read(&entry, at, value) {
            return read;
        }
        if (at.index, at.subindex) == (index::ACCESS, AccessObject::CHALLENGE) {
            return value.extend_from_slice(&self.challenge()).map_err(|_| Abort::Memory);
        }
        let number = self.number(at.index, at.subindex)?;
        put(&entry, number, value)
    }

    fn stream_length(&mut self, at: Address) -> Result<Option<usize>, Abort> {
        match (at.index, at.subindex) {
            (index::LEVEL_TREND, 0) => return self.trend_length().map(Some),
            (index::SCOPE, ScopeObject::DATA) => {}
            _ => return Ok(None),
        }
        match self.scope.readable_bytes() {
            0 => Err(self.base.refuse(Abort::Refused, text!("the scope has no complete capture"))),
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
            index::PROGRAM_CONTROL => self.control_program(number as u8),
            index::STORE => {
                self.refuse_in_trial()?;
                self.save()
            }
            index::RESTORE => self.restore_defaults(),
            index::AWAITED_HEARTBEAT => self.write_setting(at, number),
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
            index::COMMISSIONING => self.base.confirm_wiring(number),
            index::COMMISSIONING_RUN => self.write_commissioning(at.subindex, number),
            index::STATE => match at.subindex {
                StateObject::REQUEST => self.request(number as u8),
                _ => self.set_position(f32::from_bits(number)),
            },
            index::COMMIT => self.commit(number),
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
        let mut changed = self.base.settings;
        let byte = number as u8;
        match (at.index, at.subindex) {
            (index::RECEIVE_DRIVE, _) => changed.target_timeout_ms = number as u16,
            (index::OPERATION, OperationObject::SOURCE) => {
                changed.source = InputSource::from_code(byte).ok_or_else(|| {
                    self.base.refuse_setting(text!("source"), text!("0 (sensors) or 1 (bus)"))
                })?;
            }
            (index::OPERATION, OperationObject::NUMBER) => {
                changed.number = NumberType::from_code(byte).ok_or_else(|| {
                    self.base.refuse_setting(text!("number"), NumberType::LEGAL_CODES)
                })?;
            }
            (index::OPERATION, OperationObject::PERIOD_S) => {
                changed.period_s = f32::from_bits(number);
            }
            (index::OPERATION, OperationObject::FD_TELEMETRY) => {
                if byte > u8::from(self.sends_fd) {
                    let legal = text!("0, or 1 with a controller that sends CAN FD");
                    return Err(self.base.refuse_setting(text!("fd_telemetry"), legal));
                }
                changed.fd_telemetry = byte == 1;
            }
            _ => changed = self.base.changed_settings(at, number)?,
        }
        self.base.check_settings(&changed)?;
        self.set_settings(changed)
    }

    fn write_trace(&mut self, place: u8, number: u32) -> Result<(), Abort> {
        let entry = match place {
            TraceObject::RUN => TraceEntry::Run(number),
            TraceObject::SEQUENCE => TraceEntry::Sequence(number),
            _ => TraceEntry::JointKind(match number {
                0 => JointKind::Revolute,
                1 => JointKind::Prismatic,
                _ => {
                    return Err(self
                        .base
                        .refuse_setting(text!("joint_kind"), text!("0 (turns) or 1 (slides)")));
                }
            }),
        };
        let node = self.settings().node;
        self.trace(entry, &Message::Entry(node, entry));
        Ok(())
    }
}
