//! Values of the objects that read as a number.

use crate::driver::device::Device;
use crate::driver::profile;
use crate::joint_node::objects::entry;
use crate::node::dictionary::records::{EnclosureObject, HoldingBrakeObject};
use crate::node::dictionary::{HOMING_METHODS, index};
use crate::node::sdo::Abort;
use crate::sensors::bme280::Air;
use crate::sensors::enclosure;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Returns the value of an object; a float as its bits.
    pub(crate) fn number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        match at_index {
            index::SYNC_PERIOD | index::SYNC_WINDOW | index::SYNC_OVERFLOW | 0x1400..=0x1BFF => {
                self.pdo_number(at_index, place)
            }
            ..=0x5FFF => self.joint_number(at_index, place),
            _ => self.profile_number(at_index, place),
        }
    }

    fn profile_number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        if let Some(word) = self.settings().drive.get(at_index, place) {
            return Ok(word);
        }
        Ok(match at_index {
            index::ERROR_CODE => self.error_code().into(),
            index::CONTROLWORD => self.motion.profile.controlword.into(),
            index::STATUSWORD => self.motion.statusword(&self.base).into(),
            index::MODE | index::MODE_DISPLAY => self.motion.profile.mode as u32,
            index::POSITION_DEMAND => self.motion.position_demand(&self.base) as u32,
            index::FOLLOWING_ERROR => self.motion.following_error() as u32,
            index::TARGET_POSITION => self.motion.profile.target_position_micro_rad as u32,
            index::BUS_VOLTAGE => self.bus_millivolts(),
            index::ACTUAL_CURRENT => self.base.actual_current_permille() as u32,
            index::ACTUAL_POSITION => self.base.actual_position() as u32,
            index::ADDITIONAL_POSITION => {
                return entry(&[self.joint_encoder.position() as u32], place);
            }
            index::ACTUAL_VELOCITY => self.base.actual_velocity() as u32,
            index::TARGET_TORQUE => self.motion.profile.target_permille as u32,
            index::MAX_TORQUE => self.motion.profile.max_permille.into(),
            index::TORQUE_DEMAND => self.motion.torque_demand(&self.base) as u32,
            index::VELOCITY_DEMAND => self.motion.velocity_demand() as u32,
            index::TARGET_VELOCITY => self.motion.profile.target_micro_rad_s as u32,
            index::VELOCITY_OFFSET => self.motion.written_offsets()[0],
            index::TORQUE_OFFSET => self.motion.written_offsets()[1],
            index::TOUCH_FUNCTION => self.touch.function.into(),
            index::TOUCH_STATUS => self.touch.status.into(),
            index::TOUCH_1_POSITIVE..=index::TOUCH_2_NEGATIVE => {
                let places = self.touch.positions.map(|position| position as u32);
                return entry(&places, (at_index - index::TOUCH_1_POSITIVE) as u8 + 1);
            }
            index::MAX_MOTOR_SPEED => self.motion.max_motor_rpm(&self.base),
            index::HOME_OFFSET => self.motion.profile.home_offset_micro_rad as u32,
            index::HOMING_METHOD => self.motion.profile.homing_method as u32,
            index::HOMING_METHODS => {
                return entry(&HOMING_METHODS.map(|method| method as u32), place);
            }
            index::RATED_CURRENT => (self.base.rated_current_a() * 1e3) as u32,
            index::RATED_TORQUE => (self.base.rated_torque_nm() * 1e3) as u32,
            index::ACTUAL_TORQUE => self.base.actual_permille() as u32,
            index::SUPPORTED_MODES => profile::SUPPORTED_MODES,
            _ => return Err(Abort::NoObject),
        })
    }

    fn joint_number(&self, at_index: u16, place: u8) -> Result<u32, Abort> {
        let settings = self.settings();
        match at_index {
            index::DEVICE_TYPE => Ok(profile::DEVICE_TYPE),
            index::PROGRAM_CONTROL => Ok(self.program.control()),
            index::PROGRAM_IDENTIFICATION => entry(&self.program.crcs(), place),
            index::FLASH_STATUS => Ok(self.program.flash_status()),
            index::TRACE => entry(&self.samples.trace_object().words(), place),
            index::OUTPUTS => entry(&self.samples.outputs(), place),
            index::COMMISSIONING_RUN => {
                entry(&self.motion.commissioning_object(&self.base).words(), place)
            }
            index::MEASURED => entry(&self.base.measured().words(), place),
            index::LIVE_TERMS => Ok(self.live_terms()),
            index::SCOPE => entry(&self.scope_object().words(), place),
            index::SCOPE_SIGNALS => self.scope_signal(place),
            index::ENCLOSURE => entry(&enclosure_object(&self.enclosure).words(), place),
            index::JOINT_ENCODER => entry(&self.joint_encoder.object().words(), place),
            index::HOLDING_BRAKE if place == HoldingBrakeObject::RELEASED => {
                Ok(self.motion.stopping.brake().is_released().into())
            }
            index::HOLDING_BRAKE if place >= HoldingBrakeObject::TEST_RESULT => {
                entry(&self.motion.brake_test_words(), place - HoldingBrakeObject::TEST_RESULT + 1)
            }
            index::HOLDING_BRAKE | index::HOMING_STOP => {
                settings.drive.get(at_index, place).ok_or(Abort::NoSubIndex)
            }
            index::PROGRAM => entry(&self.program.object().words(), place),
            index::TRIAL => entry(&self.trial_object().words(), place),
            index::ADAPTATION => entry(&self.adaptation_object().words(), place),
            index::LEARNT_GAINS => entry(&self.learnt_gains(), place),
            index::GAIN_DEVIATIONS => entry(&self.gain_deviations(), place),
            index::TUNING => entry(&settings.tuning, place),
            index::ACCESS => entry(&self.access_object().words(), place),
            index::NETWORK => entry(&self.network_state().words(), place),
            _ => self.base.number(at_index, place),
        }
    }
}

/// Returns the readings of the dry side (2012h).
fn enclosure_object(readings: &enclosure::Readings) -> EnclosureObject {
    let air = readings.air.unwrap_or(Air::INVALID);
    let [first, second] = readings.torque_allowed.unwrap_or_default();
    EnclosureObject {
        leak_share: readings.leak_share.unwrap_or(f32::NAN).to_bits(),
        humidity_percent: air.humidity_percent.to_bits(),
        housing_pressure_pa: air.pressure_pa.to_bits(),
        housing_temperature_c: air.temperature_c.to_bits(),
        torque_allowed: u32::from(first) | u32::from(second) << 1,
    }
}
