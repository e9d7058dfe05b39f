//! What the driver exchanges with the current loop: its last report, and the numbers of what it is to do once.

use super::compensation_share::CompensationShare;
use super::seal_sensors::SealSensors;
use crate::driver::loop_data::{Home, LoopReport};
use crate::driver::motor_watch::MotorState;
use crate::supervisor::Observation;

with_defaults! {
    /// State of the exchange.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct LoopExchange {
        report: LoopReport,
        /// A tick has evaluated the report.
        is_report_seen: bool = true,
        /// Number of the parameter set that the loop is to use.
        pub(super) set_number: u32,
        /// Number of resets of the gate driver.
        pub(super) gate_resets: u8,
        home: Home,
        /// The position is unknown until it is set, whatever the loop reports.
        is_home_lost: bool,
    }
}

impl LoopExchange {
    /// Keeps a report. Flags since the last tick are kept if two reports come between ticks.
    pub(crate) fn take_report(&mut self, report: &LoopReport) {
        let before = (self.report.loop_flags, self.report.flags);
        self.report = *report;
        if self.is_home_lost {
            self.report.position_rad = f32::NAN;
        }
        if !self.is_report_seen {
            self.report.loop_flags |= before.0;
            self.report.flags |= before.1;
        }
        self.is_report_seen = false;
    }

    /// Completes an observation with what the report and its watches show.
    pub(crate) fn observe(
        &self,
        motor: &MotorState,
        compensation: &CompensationShare,
        seal_sensors: &SealSensors,
        observation: &mut Observation,
    ) {
        let report = &self.report;
        observation.bus_voltage_v = report.bus_voltage_v;
        observation.phase_currents_a = report.phase_currents_a;
        observation.current_a = report.current_a;
        observation.current_setpoint_a = report.current_reference_a;
        observation.velocity_rad_s = report.velocity_rad_s;
        observation.bridge_temperature_c = report.bridge_temperature_c;
        observation.motor_temperature_c = report.motor_temperature_c;
        observation.winding_temperature_c = motor.winding_c;
        observation.motor_against = motor.is_emf_reversed;
        observation.turns_unseen = motor.is_turning_unseen;
        observation.motor_stands = motor.is_blocked;
        observation.stalled = motor.is_stalled;
        observation.over_compensated = compensation.is_over_compensated();
        observation.radial_force_stuck = seal_sensors.radial_force.is_stuck();
        observation.pressure_stuck = seal_sensors.pressure.is_stuck();
        observation.sample_age_us = report.sample_age_us;
        observation.gate_driver_fault = report.gate_driver_fault;
        observation.system_break = report.system_break;
        observation.bridge_shorted = report.bridge_shorted;
        observation.magnet_fault = report.magnet_fault;
        observation.loop_flags = report.loop_flags;
        observation.compensator = report.flags;
    }

    /// Notes that a tick has evaluated the report.
    pub(crate) fn mark_report_seen(&mut self) {
        self.is_report_seen = true;
    }

    /// Returns the last report.
    pub(crate) const fn report(&self) -> &LoopReport {
        &self.report
    }

    /// Makes the loop take the parameter set that became active.
    pub(crate) fn take_set(&mut self) {
        self.set_number = self.set_number.wrapping_add(1);
    }

    /// Makes the loop reset the gate driver.
    pub(crate) fn reset_gate_driver(&mut self) {
        self.gate_resets = self.gate_resets.wrapping_add(1);
    }

    /// Makes the loop take the present position as this one, rad.
    pub(crate) fn set_home(&mut self, position_rad: f32) {
        self.is_home_lost = false;
        self.home = Home { position_rad, number: self.home.number.wrapping_add(1) };
    }

    /// Makes the position unknown until it is set: the joint has moved without its encoder.
    pub(crate) fn lose_home(&mut self) {
        self.is_home_lost = true;
    }

    /// Returns the position that was set last.
    pub(crate) const fn home(&self) -> Home {
        self.home
    }
}
