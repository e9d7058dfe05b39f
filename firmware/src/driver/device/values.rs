//! What the objects read as: the device's state, value by value.

use super::{Counters, Device, Reply, State};
use crate::node::dictionary::records::{self, Inputs, Measured, Outputs, WatchState};
use crate::node_settings::Source;
use embedded_storage::nor_flash::NorFlash;

impl<F: NorFlash> Device<F> {
    pub(in crate::driver) fn error_register(&self) -> u8 {
        self.supervisor.faults().error_register() | self.supervisor.limits().error_register()
    }

    pub(in crate::driver) fn sequence(&self) -> u32 {
        self.hil.inbox().sequence()
    }

    pub(in crate::driver) fn state_object(&self) -> records::State {
        let state = match self.supervisor.state() {
            State::Fault => 2,
            _ if self.is_armed() => 1,
            _ => 0,
        };
        let (faults, limits) = (self.supervisor.faults(), self.supervisor.limits());
        records::State {
            state,
            faults: faults.fault_bits(),
            limits: limits.limit_bits(),
            blocking_codes: self.blocking,
            ..Default::default()
        }
    }

    pub(in crate::driver) fn all_counters(&self) -> Counters {
        Counters { sent: self.outbox.sent(), not_sent: self.outbox.lost(), ..self.counters }
    }

    pub(in crate::driver) const fn last_inputs(&self) -> Inputs {
        self.inputs
    }

    pub(in crate::driver) fn measured(&self) -> Measured {
        let told = &self.inputs;
        match self.settings.source {
            Source::Bus => Measured {
                velocity_rad_s: told.velocity_rad_s,
                position_rad: told.position_rad,
                torque_nm: told.torque_nm,
                load_torque_nm: told.load_torque_nm,
            },
            Source::Sensors => Measured {
                velocity_rad_s: self.report.velocity_rad_s.to_bits(),
                position_rad: self.report.position_rad.to_bits(),
                torque_nm: self.report.motor_torque_nm.to_bits(),
                load_torque_nm: told.load_torque_nm,
            },
        }
    }

    pub(in crate::driver) fn last_outputs(&self) -> Outputs {
        let Reply { answer, status, telemetry } = self.reply;
        Outputs {
            friction_torque_nm: answer.friction_torque_nm.to_bits(),
            feed_forward_current_a: answer.feed_forward_current_a.to_bits(),
            flags: status.flags.bits(),
            sequence: status.sequence,
            current_a: telemetry.current_a.to_bits(),
            residual_torque_nm: telemetry.residual_torque_nm.to_bits(),
        }
    }

    pub(in crate::driver) fn code_count(&self, place: usize) -> Option<u32> {
        self.supervisor.counts().get(place).copied()
    }

    pub(in crate::driver) fn watch_state(&self) -> WatchState {
        /// Whether the model is in its band is not known before the first window is full.
        const UNKNOWN: u32 = 2;
        let Some(watch) = &self.watch else {
            return WatchState { in_band: UNKNOWN, ..Default::default() };
        };
        WatchState {
            in_band: watch.in_band().map_or(UNKNOWN, u32::from),
            windows: watch.windows(),
            windows_out_of_band: watch.windows_out_of_band(),
            alarms: watch.alarms(),
            largest_in_bands: watch.largest_in_bands().to_bits(),
        }
    }
}
