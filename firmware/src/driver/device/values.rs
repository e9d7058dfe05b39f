//! Values of the objects that report the device's state.

use super::{Counters, Device, JointState};
use crate::node::dictionary::records::{self, EnclosureObject, WatchObject};
use crate::sensors::bme280::Air;
use crate::watch::ResidualWatch;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    pub(in crate::driver) fn error_register(&self) -> u8 {
        self.supervisor.faults().error_register() | self.supervisor.limits().error_register()
    }

    pub(in crate::driver) fn state_object(&self) -> records::StateObject {
        let state = match self.supervisor.state() {
            JointState::Fault => 2,
            _ if self.is_armed() => 1,
            _ => 0,
        };
        let (faults, limits) = (self.supervisor.faults(), self.supervisor.limits());
        records::StateObject {
            state,
            faults: faults.fault_bits(),
            limits: limits.limit_bits(),
            blocking_codes: self.blocking,
            failed_self_test: self.supervisor.failed_self_test().into(),
            ..Default::default()
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

    pub(in crate::driver) fn code_count(&self, place: usize) -> Option<u32> {
        self.supervisor.counts().get(place).copied()
    }

    pub(in crate::driver) fn watch_state(&self) -> WatchObject {
        watch_object(self.watch.as_ref())
    }
}

/// Returns the state of a watch of the model (2007h).
pub(crate) fn watch_object(watch: Option<&ResidualWatch>) -> WatchObject {
    /// Before the first window is complete, it is unknown whether the model is in its band.
    const UNKNOWN: u32 = 2;
    let Some(watch) = watch else {
        return WatchObject { in_band: UNKNOWN, ..Default::default() };
    };
    WatchObject {
        in_band: watch.in_band().map_or(UNKNOWN, u32::from),
        windows: watch.windows(),
        windows_out_of_band: watch.windows_out_of_band(),
        alarms: watch.alarms(),
        largest_in_bands: watch.largest_in_bands().to_bits(),
    }
}
