//! What the reports show of the motor: see [`crate::driver::motor_watch`].

use crate::control::MotorParameters;
use crate::driver::loop_data::LoopReport;
use crate::driver::motor_watch::{MotorState, MotorWatch};
use crate::supervisor::Thresholds;

/// The watch of the motor with its last result, and the wiring that was measured.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MotorObservation {
    watch: MotorWatch,
    state: MotorState,
    /// CRC of the wiring that the last complete measurement of the motor found.
    measured_wiring: Option<u32>,
}

impl MotorObservation {
    /// Evaluates a report.
    pub(crate) fn step(
        &mut self,
        report: &LoopReport,
        motor: &MotorParameters,
        thresholds: &Thresholds,
        drives: bool,
        proven: bool,
    ) {
        self.state = self.watch.step(report, motor, thresholds, drives, proven);
    }

    /// Forgets what the joint has travelled: another wiring is in use.
    pub(crate) fn forget_travel(&mut self) {
        self.watch.forget_travel();
        self.state.is_proven = false;
    }

    /// Returns the result of the last report.
    pub(crate) const fn state(&self) -> &MotorState {
        &self.state
    }

    /// Sets the rise of the winding above the stator, K; `None` assumes a hot winding.
    pub(crate) fn set_winding_rise(&mut self, rise_k: Option<f32>) {
        self.watch = MotorWatch::with_rise(rise_k);
    }

    /// Returns the rise of the winding above the stator, K, once it is known.
    pub(crate) const fn winding_rise_k(&self) -> Option<f32> {
        self.watch.rise_k()
    }

    /// Keeps the CRC of the wiring that a complete measurement found.
    pub(crate) fn record_measurement(&mut self, wiring_crc: u32) {
        self.measured_wiring = Some(wiring_crc);
    }

    /// Returns true if the last complete measurement found this wiring.
    pub(crate) fn has_measured(&self, wiring_crc: u32) -> bool {
        self.measured_wiring == Some(wiring_crc)
    }
}
