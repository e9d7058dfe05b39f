//! Values of the objects that report the device's state.

use super::Device;
use crate::node::dictionary::records::EnclosureObject;
use crate::sensors::bme280::Air;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    /// Returns the readings of the dry side.
    pub(crate) fn enclosure_object(&self) -> EnclosureObject {
        let air = self.enclosure.air.unwrap_or(Air::INVALID);
        let [first, second] = self.enclosure.torque_allowed.unwrap_or_default();
        EnclosureObject {
            leak_share: self.enclosure.leak_share.unwrap_or(f32::NAN).to_bits(),
            humidity_percent: air.humidity_percent.to_bits(),
            housing_pressure_pa: air.pressure_pa.to_bits(),
            housing_temperature_c: air.temperature_c.to_bits(),
            torque_allowed: u32::from(first) | u32::from(second) << 1,
        }
    }
}
