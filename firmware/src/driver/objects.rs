//! What each object of the dictionary reads as, and what writing it does.

use super::device::{Device, PDO_UNUSED};
use super::profile;
use crate::hil::Number;
use crate::node::dictionary::records::{
    self, Commissioning, CommissioningRun, Commit, Inputs, Measured, Operation, Outputs, State,
    Trace,
};
use crate::node::dictionary::{self, Access, ERRORS_KEPT, LOAD, Object, SAVE, index};
use crate::node::sdo::{Abort, Objects, Value};
use crate::node_settings::{SettingError, Source};
use canopen_rs::Address;
use compensator_core::can::{Entry, JointKind, Message, Node, cob_id};
use compensator_core::network::record as network_record;
use compensator_core::record;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Objects for Device<F> {
    fn may_write(&mut self, at: Address, length: Option<usize>) -> Result<(), Abort> {
        let entry = dictionary::find(at.index, at.subindex)?;
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
        // A request to disarm, what a trace says of itself, and what else comes in frames, are always heard.
        let always = matches!(
            (at.index, at.subindex),
            (index::STATE, State::REQUEST)
                | (index::TRACE | index::ERROR_FIELD | index::INPUTS, _)
                | (index::CONTROLWORD | index::TARGET_TORQUE | index::TARGET_VELOCITY, _)
                | (index::COMMISSIONING_RUN, CommissioningRun::ORDER)
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
            index::INPUTS => {
                self.input(at.subindex, number);
                Ok(())
            }
            index::COMMISSIONING => self.commission(number),
            index::COMMISSIONING_RUN => self.write_commissioning(at.subindex, number),
            index::CONTROLWORD => self.set_controlword(number as u16),
            index::TARGET_TORQUE => {
                self.set_target(number as i16);
                Ok(())
            }
            index::TARGET_VELOCITY => {
                self.set_target_velocity(number as i32);
                Ok(())
            }
            index::MAX_MOTOR_SPEED => {
                self.profile.max_motor_rpm = Some(number);
                Ok(())
            }
            index::MODE => self.set_mode(number as i8),
            index::HOMING_METHOD => self.set_homing_method(number as i8),
            index::HOME_OFFSET => {
                self.profile.home_offset_micro_rad = number as i32;
                Ok(())
            }
            index::MAX_TORQUE => {
                self.profile.max_permille = number as u16;
                Ok(())
            }
            index::TRANSMIT_ANSWER..=index::TRANSMIT_DRIVE => {
                self.set_identifier(usize::from(at.index - index::TRANSMIT_ANSWER), number)
            }
            index::STATE => match at.subindex {
                State::REQUEST => self.request(number as u8),
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
                Commit::COMMIT => self.commit(number),
                Commit::DISCARD => {
                    self.staging.discard();
                    Ok(())
                }
                Commit::FRICTION_RECORD => self.staging.write_record(value),
                Commit::NETWORK_RECORD => self.staging.write_network(value),
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
            (index::COMMIT, Commit::FRICTION_RECORD) => {
                let record = record::emit(&self.staging.staged().friction);
                return value.extend_from_slice(&record).map_err(|_| Abort::Memory);
            }
            (index::COMMIT, Commit::NETWORK_RECORD) => {
                let record = network_record::emit(self.staging.staged().network.as_ref());
                return value.extend_from_slice(&record).map_err(|_| Abort::Memory);
            }
            (index::COMMIT, Commit::DRIVE_RECORD) => {
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

/// Objects of 32 bits that make a process frame.
const fn mapped(index: u16, sub_indices: [u8; 2]) -> [u32; 2] {
    let [first, second] = sub_indices;
    let head = (index as u32) << 16 | 32;
    [head | (first as u32) << 8, head | (second as u32) << 8]
}

/// How a PDO travels (CiA 301, table 72): with the SYNC, or whenever it comes.
const SYNCHRONOUS: u32 = 1;
const EVENT_DRIVEN: u32 = 0xFF;

/// An object of the profile in a process frame.
const fn of_profile(index: u16, bits: u32) -> u32 {
    (index as u32) << 16 | bits
}

impl<F: NorFlash> Device<F> {
    /// What a number reads as, a float as its bits.
    fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let node = u32::from(self.settings().node.number());
        let nth = usize::from(place).wrapping_sub(1);
        let settings = self.settings();
        let list = |numbers: &[u32]| numbers.get(nth).copied().ok_or(Abort::NoSubIndex);
        let at = |base: u16| u32::from(base) + node;
        let pdo = |base, transmission_type| {
            list(&records::Pdo { cob_id: at(base), transmission_type }.words())
        };
        // A joint says what it measures; one in HIL is told it, on the same identifier.
        let told = |base| {
            let unused = if settings.source == Source::Bus { 0 } else { PDO_UNUSED };
            let pdo = records::Pdo { cob_id: at(base) | unused, transmission_type: SYNCHRONOUS };
            list(&pdo.words())
        };
        let inputs = |sub_indices| list(&mapped(index::INPUTS, sub_indices));
        let outputs = |sub_indices| list(&mapped(index::OUTPUTS, sub_indices));
        match at_index {
            index::DEVICE_TYPE => Ok(profile::DEVICE_TYPE),
            index::ERROR_REGISTER => Ok(u32::from(self.error_register())),
            index::ERROR_FIELD => {
                self.errors.iter().rev().nth(nth).copied().ok_or(Abort::NoSubIndex)
            }
            index::SYNC_IDENTIFIER => Ok(cob_id::SYNC.into()),
            index::EMERGENCY_IDENTIFIER => Ok(at(cob_id::EMERGENCY)),
            // Saved and restored on command, not by itself.
            index::STORE | index::RESTORE => Ok(1),
            index::AWAITED_HEARTBEAT => Ok(settings.awaited_heartbeat),
            index::HEARTBEAT => Ok(u32::from(settings.heartbeat_ms)),
            index::IDENTITY => list(&self.identity.object().words()),
            index::SYNC_OVERFLOW => Ok(240),
            index::SDO_SERVER => list(
                &records::SdoServer {
                    client_to_server: at(cob_id::SDO_REQUEST),
                    server_to_client: at(cob_id::SDO_ANSWER),
                }
                .words(),
            ),
            index::RECEIVE_COMMAND => pdo(cob_id::RPDO_2, EVENT_DRIVEN),
            index::RECEIVE_SEAL => pdo(cob_id::RPDO_3, SYNCHRONOUS),
            index::RECEIVE_SURROUNDINGS => pdo(cob_id::RPDO_4, SYNCHRONOUS),
            index::RECEIVE_MOTION => told(cob_id::TPDO_4),
            index::RECEIVE_TORQUE => told(cob_id::TPDO_5),
            index::RECEIVE_DRIVE => pdo(cob_id::RPDO_1, EVENT_DRIVEN),
            index::TRANSMIT_ANSWER..=index::TRANSMIT_DRIVE => {
                let cob_id = self.identifier(usize::from(at_index - index::TRANSMIT_ANSWER));
                list(&records::TransmitPdo { cob_id, transmission_type: SYNCHRONOUS }.words())
            }
            index::MAPPING_RECEIVED_DRIVE => list(&[
                of_profile(index::CONTROLWORD, 16),
                of_profile(index::TARGET_TORQUE, 16),
                of_profile(index::TARGET_VELOCITY, 32),
            ]),
            index::MAPPING_DRIVE => list(&[
                of_profile(index::STATUSWORD, 16),
                of_profile(index::ACTUAL_TORQUE, 16),
                of_profile(index::ACTUAL_POSITION, 32),
            ]),
            index::ERROR_CODE => Ok(self.error_code().into()),
            index::CONTROLWORD => Ok(self.profile.controlword.into()),
            index::STATUSWORD => Ok(self.statusword().into()),
            index::MODE | index::MODE_DISPLAY => Ok(self.profile.mode as u32),
            index::ACTUAL_POSITION => Ok(self.actual_position() as u32),
            index::ACTUAL_VELOCITY => Ok(self.actual_velocity() as u32),
            index::TARGET_TORQUE => Ok(self.profile.target_permille as u32),
            index::MAX_TORQUE => Ok(self.profile.max_permille.into()),
            index::VELOCITY_DEMAND => Ok(self.velocity_demand() as u32),
            index::TARGET_VELOCITY => Ok(self.profile.target_micro_rad_s as u32),
            index::MAX_MOTOR_SPEED => Ok(self.max_motor_rpm()),
            index::HOME_OFFSET => Ok(self.profile.home_offset_micro_rad as u32),
            index::HOMING_METHOD => Ok(self.profile.homing_method as u32),
            index::HOMING_METHODS => list(&profile::HOMING_METHODS.map(|method| method as u32)),
            index::RATED_CURRENT => Ok(self.ratings()[0]),
            index::RATED_TORQUE => Ok(self.ratings()[1]),
            index::ACTUAL_TORQUE => Ok(self.actual_permille() as u32),
            index::SUPPORTED_MODES => Ok(profile::SUPPORTED_MODES),
            index::MAPPING_RECEIVED_COMMAND => {
                inputs([Inputs::COMMAND_CURRENT, Inputs::COMMAND_REST])
            }
            index::MAPPING_RECEIVED_SEAL => inputs([Inputs::RADIAL_FORCE, Inputs::PRESSURE_DIFF]),
            index::MAPPING_RECEIVED_SURROUNDINGS => {
                inputs([Inputs::TEMPERATURE, Inputs::AUXILIARY])
            }
            index::MAPPING_RECEIVED_MOTION => inputs([Inputs::VELOCITY, Inputs::POSITION]),
            index::MAPPING_RECEIVED_TORQUE => inputs([Inputs::TORQUE, Inputs::LOAD_TORQUE]),
            index::MAPPING_ANSWER => {
                outputs([Outputs::FRICTION_TORQUE, Outputs::FEED_FORWARD_CURRENT])
            }
            index::MAPPING_STATUS => outputs([Outputs::FLAGS, Outputs::SEQUENCE]),
            index::MAPPING_TELEMETRY => outputs([Outputs::CURRENT, Outputs::RESIDUAL_TORQUE]),
            index::MAPPING_MOTION => {
                list(&mapped(index::MEASURED, [Measured::VELOCITY, Measured::POSITION]))
            }
            index::MAPPING_TORQUE => {
                list(&mapped(index::MEASURED, [Measured::TORQUE, Measured::LOAD_TORQUE]))
            }
            index::TRACE => {
                let joint_kind = self.joint_kind as u32;
                let (run, sequence) = (self.run, self.sequence());
                list(&Trace { run, sequence, joint_kind }.words())
            }
            index::OPERATION => list(
                &Operation {
                    source: settings.source as u32,
                    number: settings.number as u32,
                    period_s: settings.period_s.to_bits(),
                    campaign_h: settings.campaign_h.to_bits(),
                    telemetry_every: settings.telemetry_every.into(),
                    node,
                    bit_rate_kbit: settings.bit_rate_kbit.into(),
                }
                .words(),
            ),
            index::STATE => list(&self.state_object().words()),
            index::FRAME_COUNTERS => list(&self.all_counters().words()),
            index::INPUTS => list(&self.last_inputs().words()),
            index::OUTPUTS => list(&self.last_outputs().words()),
            index::COMMISSIONING => list(
                &Commissioning {
                    commissioned: self.is_commissioned().into(),
                    wiring_crc: self.staging.active().wiring_crc(),
                    ..Default::default()
                }
                .words(),
            ),
            index::COMMISSIONING_RUN => list(&self.commissioning_object().words()),
            index::MEASURED => list(&self.measured().words()),
            index::CODE_COUNTERS => self.code_count(nth).ok_or(Abort::NoSubIndex),
            index::WATCH => list(&self.watch_state().words()),
            index::NETWORK => list(&self.network_state().words()),
            index::COMMIT => {
                let (active_crc, staged_crc) =
                    (self.staging.active().crc(), self.staging.staged().crc());
                list(&Commit { active_crc, staged_crc, ..Default::default() }.words())
            }
            _ => Err(Abort::NoObject),
        }
    }

    fn write_setting(&mut self, at: Address, number: u32) -> Result<(), Abort> {
        let mut changed = *self.settings();
        let byte = number as u8;
        match (at.index, at.subindex) {
            (index::HEARTBEAT, _) => changed.heartbeat_ms = number as u16,
            (index::AWAITED_HEARTBEAT, _) => changed.awaited_heartbeat = number,
            (_, Operation::SOURCE) => {
                changed.source = match byte {
                    0 => Source::Sensors,
                    1 => Source::Bus,
                    _ => return Err(self.refuse_setting("source", "0 (sensors) or 1 (bus)")),
                }
            }
            (_, Operation::NUMBER) => {
                changed.number = Number::from_code(byte)
                    .ok_or_else(|| self.refuse_setting("number", Number::LEGAL))?;
            }
            (_, Operation::PERIOD_S) => changed.period_s = f32::from_bits(number),
            (_, Operation::CAMPAIGN_H) => changed.campaign_h = f32::from_bits(number),
            (_, Operation::TELEMETRY_EVERY) => changed.telemetry_every = byte,
            (_, Operation::NODE) => {
                changed.node =
                    Node::new(byte).ok_or_else(|| self.refuse_setting("node", "1 to 127"))?;
            }
            _ => changed.bit_rate_kbit = number as u16,
        }
        changed.validate().map_err(|error| self.staging.refuse(Abort::Value, error))?;
        self.set_settings(changed)
    }

    fn refuse_setting(&mut self, name: &'static str, legal: &'static str) -> Abort {
        self.staging.refuse(Abort::Value, SettingError { name, legal })
    }

    fn write_trace(&mut self, place: u8, number: u32) -> Result<(), Abort> {
        let entry = match place {
            Trace::RUN => Entry::Run(number),
            Trace::SEQUENCE => Entry::Sequence(number),
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
