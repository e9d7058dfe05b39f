//! Values of the objects that read as a number.

use super::Area;
use crate::driver::device::{Device, PDO_UNUSED};
use crate::driver::profile;
use crate::node::dictionary::index;
use crate::node::dictionary::records::{
    self, CommissioningObject, CommitObject, InputsObject, MeasuredObject, OperationObject,
    OutputsObject, TraceObject,
};
use crate::node::sdo::Abort;
use crate::node_settings::InputSource;
use compensator_core::can::cob_id;
use embedded_storage::nor_flash::NorFlash;

/// Transmission types of a PDO (CiA 301, table 72): with the SYNC, or at any time.
const SYNCHRONOUS: u32 = 1;
const EVENT_DRIVEN: u32 = 0xFF;

/// Returns the word at a sub-index, which counts from 1.
fn entry(words: &[u32], sub_index: u8) -> Result<u32, Abort> {
    let place = usize::from(sub_index).wrapping_sub(1);
    words.get(place).copied().ok_or(Abort::NoSubIndex)
}

/// Returns the mapping of two entries of 32 bits to a process frame.
const fn mapped(index: u16, sub_indices: [u8; 2]) -> [u32; 2] {
    let [first, second] = sub_indices;
    let head = (index as u32) << 16 | 32;
    [head | (first as u32) << 8, head | (second as u32) << 8]
}

/// Returns the mapping of an object of the drive profile to a process frame.
const fn of_profile(index: u16, bits: u32) -> u32 {
    (index as u32) << 16 | bits
}

impl<F: NorFlash> Device<F> {
    /// Returns the value of an object; a float as its bits.
    pub(super) fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        match Area::of(at_index) {
            Area::Communication => self.communication_number(at_index, place),
            Area::Joint => self.joint_number(at_index, place),
            Area::Profile => self.profile_number(at_index, place),
        }
    }

    fn communication_number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        match at_index {
            index::DEVICE_TYPE => Ok(profile::DEVICE_TYPE),
            index::ERROR_REGISTER => Ok(u32::from(self.error_register())),
            index::ERROR_FIELD => {
                let newest = usize::from(place).wrapping_sub(1);
                self.errors.iter().rev().nth(newest).copied().ok_or(Abort::NoSubIndex)
            }
            index::SYNC_IDENTIFIER => Ok(cob_id::SYNC.into()),
            index::EMERGENCY_IDENTIFIER => Ok(self.own_identifier(cob_id::EMERGENCY)),
            // Parameters are saved and restored on command, not automatically.
            index::STORE | index::RESTORE => Ok(1),
            index::AWAITED_HEARTBEAT => Ok(self.settings().awaited_heartbeat),
            index::HEARTBEAT => Ok(u32::from(self.settings().heartbeat_ms)),
            index::IDENTITY => entry(&self.identity.object().words(), place),
            index::SYNC_OVERFLOW => Ok(240),
            index::SDO_SERVER => entry(
                &records::SdoServerObject {
                    client_to_server: self.own_identifier(cob_id::SDO_REQUEST),
                    server_to_client: self.own_identifier(cob_id::SDO_ANSWER),
                }
                .words(),
                place,
            ),
            0x1400..=0x15FF | 0x1800..=0x19FF => self.pdo_number(at_index, place),
            _ => pdo_mapping(at_index, place),
        }
    }

    /// Returns the identifier of this node in a range of identifiers.
    fn own_identifier(&self, base: u16) -> u32 {
        u32::from(base) + u32::from(self.settings().node.number())
    }

    /// Returns an entry of the communication parameters of a PDO.
    fn pdo_number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        // A joint on its sensors sends Motion and Torque; a joint in HIL receives them with the same identifier.
        let unused = if self.settings().source == InputSource::Bus { 0 } else { PDO_UNUSED };
        let (base, unused, transmission_type) = match at_index {
            index::RECEIVE_COMMAND => (cob_id::RPDO_2, 0, EVENT_DRIVEN),
            index::RECEIVE_SEAL => (cob_id::RPDO_3, 0, SYNCHRONOUS),
            index::RECEIVE_SURROUNDINGS => (cob_id::RPDO_4, 0, SYNCHRONOUS),
            index::RECEIVE_MOTION => (cob_id::TPDO_4, unused, SYNCHRONOUS),
            index::RECEIVE_TORQUE => (cob_id::TPDO_5, unused, SYNCHRONOUS),
            index::RECEIVE_DRIVE => {
                let pdo = records::DrivePdoObject {
                    cob_id: self.own_identifier(cob_id::RPDO_1),
                    transmission_type: EVENT_DRIVEN,
                    inhibit_time: 0,
                    compatibility_entry: 0,
                    event_timer_ms: self.settings().target_timeout_ms.into(),
                };
                return entry(&pdo.words(), place);
            }
            index::TRANSMIT_ANSWER..=index::TRANSMIT_DRIVE => {
                let cob_id = self.identifier(usize::from(at_index - index::TRANSMIT_ANSWER));
                let pdo = records::TransmitPdoObject { cob_id, transmission_type: SYNCHRONOUS };
                return entry(&pdo.words(), place);
            }
            _ => return Err(Abort::NoObject),
        };
        let cob_id = self.own_identifier(base) | unused;
        entry(&records::PdoObject { cob_id, transmission_type }.words(), place)
    }

    fn profile_number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        Ok(match at_index {
            index::ERROR_CODE => self.error_code().into(),
            index::CONTROLWORD => self.profile.controlword.into(),
            index::STATUSWORD => self.statusword().into(),
            index::MODE | index::MODE_DISPLAY => self.profile.mode as u32,
            index::ACTUAL_POSITION => self.actual_position() as u32,
            index::ACTUAL_VELOCITY => self.actual_velocity() as u32,
            index::TARGET_TORQUE => self.profile.target_permille as u32,
            index::MAX_TORQUE => self.profile.max_permille.into(),
            index::VELOCITY_DEMAND => self.velocity_demand() as u32,
            index::TARGET_VELOCITY => self.profile.target_micro_rad_s as u32,
            index::MAX_MOTOR_SPEED => self.max_motor_rpm(),
            index::HOME_OFFSET => self.profile.home_offset_micro_rad as u32,
            index::HOMING_METHOD => self.profile.homing_method as u32,
            index::HOMING_METHODS => {
                return entry(&profile::HOMING_METHODS.map(|method| method as u32), place);
            }
            index::RATED_CURRENT => self.ratings()[0],
            index::RATED_TORQUE => self.ratings()[1],
            index::ACTUAL_TORQUE => self.actual_permille() as u32,
            index::SUPPORTED_MODES => profile::SUPPORTED_MODES,
            _ => return Err(Abort::NoObject),
        })
    }

    fn joint_number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let settings = self.settings();
        match at_index {
            index::TRACE => {
                let joint_kind = self.joint_kind as u32;
                let (run, sequence) = (self.run, self.sequence());
                entry(&TraceObject { run, sequence, joint_kind }.words(), place)
            }
            index::OPERATION => entry(
                &OperationObject {
                    source: settings.source as u32,
                    number: settings.number as u32,
                    period_s: settings.period_s.to_bits(),
                    campaign_h: settings.campaign_h.to_bits(),
                    telemetry_every: settings.telemetry_every.into(),
                    node: settings.node.number().into(),
                    bit_rate_kbit: settings.bit_rate_kbit.into(),
                }
                .words(),
                place,
            ),
            index::STATE => entry(&self.state_object().words(), place),
            index::FRAME_COUNTERS => entry(&self.all_counters().words(), place),
            index::INPUTS => entry(&self.last_inputs().words(), place),
            index::OUTPUTS => entry(&self.last_outputs().words(), place),
            index::COMMISSIONING => entry(
                &CommissioningObject {
                    commissioned: self.is_commissioned().into(),
                    wiring_crc: self.staging.active().wiring_crc(),
                    proven: self.is_wiring_proven().into(),
                    ..Default::default()
                }
                .words(),
                place,
            ),
            index::COMMISSIONING_RUN => entry(&self.commissioning_object().words(), place),
            index::MEASURED => entry(&self.measured().words(), place),
            index::CODE_COUNTERS => {
                let code = usize::from(place).wrapping_sub(1);
                self.code_count(code).ok_or(Abort::NoSubIndex)
            }
            index::WATCH => entry(&self.watch_state().words(), place),
            index::LIVE_TERMS => Ok(self.live_terms()),
            index::SCOPE => entry(&self.scope_object().words(), place),
            index::SCOPE_SIGNALS => self.scope_signal(place),
            index::ENCLOSURE => entry(&self.enclosure_object().words(), place),
            index::NETWORK => entry(&self.network_state().words(), place),
            index::COMMIT => {
                let (active_crc, staged_crc) =
                    (self.staging.active().crc(), self.staging.staged().crc());
                entry(&CommitObject { active_crc, staged_crc, ..Default::default() }.words(), place)
            }
            _ => Err(Abort::NoObject),
        }
    }
}

/// Returns an entry of the mapping of a PDO.
fn pdo_mapping(at_index: u16, place: u8) -> Result<u32, Abort> {
    let (object, sub_indices) = match at_index {
        index::MAPPING_RECEIVED_DRIVE => {
            let mapping = [
                of_profile(index::CONTROLWORD, 16),
                of_profile(index::TARGET_TORQUE, 16),
                of_profile(index::TARGET_VELOCITY, 32),
            ];
            return entry(&mapping, place);
        }
        index::MAPPING_DRIVE => {
            let mapping = [
                of_profile(index::STATUSWORD, 16),
                of_profile(index::ACTUAL_TORQUE, 16),
                of_profile(index::ACTUAL_POSITION, 32),
            ];
            return entry(&mapping, place);
        }
        index::MAPPING_RECEIVED_COMMAND => {
            (index::INPUTS, [InputsObject::COMMAND_CURRENT, InputsObject::COMMAND_REST])
        }
        index::MAPPING_RECEIVED_SEAL => {
            (index::INPUTS, [InputsObject::RADIAL_FORCE, InputsObject::PRESSURE_DIFF])
        }
        index::MAPPING_RECEIVED_SURROUNDINGS => {
            (index::INPUTS, [InputsObject::TEMPERATURE, InputsObject::AUXILIARY])
        }
        index::MAPPING_RECEIVED_MOTION => {
            (index::INPUTS, [InputsObject::VELOCITY, InputsObject::POSITION])
        }
        index::MAPPING_RECEIVED_TORQUE => {
            (index::INPUTS, [InputsObject::TORQUE, InputsObject::LOAD_TORQUE])
        }
        index::MAPPING_ANSWER => {
            (index::OUTPUTS, [OutputsObject::FRICTION_TORQUE, OutputsObject::FEED_FORWARD_CURRENT])
        }
        index::MAPPING_STATUS => (index::OUTPUTS, [OutputsObject::FLAGS, OutputsObject::SEQUENCE]),
        index::MAPPING_TELEMETRY => {
            (index::OUTPUTS, [OutputsObject::CURRENT, OutputsObject::RESIDUAL_TORQUE])
        }
        index::MAPPING_MOTION => {
            (index::MEASURED, [MeasuredObject::VELOCITY, MeasuredObject::POSITION])
        }
        index::MAPPING_TORQUE => {
            (index::MEASURED, [MeasuredObject::TORQUE, MeasuredObject::LOAD_TORQUE])
        }
        _ => return Err(Abort::NoObject),
    };
    entry(&mapped(object, sub_indices), place)
}
