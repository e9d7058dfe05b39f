//! Values of the objects that report the device's state.

use super::{Counters, Device};
use crate::driver::objects::common::CommonObjects;
use crate::node::dictionary::records::EnclosureObject;
use crate::sensors::bme280::Air;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    pub(in crate::driver) fn error_register(&self) -> u8 {
        self.supervisor.faults().error_register() | self.supervisor.limits().error_register()
    }

    /// Returns the parts that a compact node has, too.
    pub(in crate::driver) fn common(&self) -> CommonObjects<'_> {
        CommonObjects {
            name: "friction-compensated joint driver",
            identity: &self.identity,
            settings: &self.settings,
            history: &self.history,
            staging: &self.staging,
            supervisor: &self.supervisor,
            watch: self.watch.as_ref(),
            inputs: self.samples.inputs(),
            blocking: self.blocking,
            is_armed: self.is_armed(),
        }
    }

    pub(in crate::driver) fn all_counters(&self) -> Counters {
        Counters { sent: self.outbox.sent(), not_sent: self.outbox.lost(), ..self.counters }
    }

    /// Returns the readings of the dry side.
    pub(in crate::driver) fn enclosure_object(&self) -> EnclosureObject {
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
