//! Share of the compensation in use, reduced if the model has more friction than the joint.

use super::{Device, InputSource};
use crate::driver::over_compensation::{OverCompensationWatch, SlidingSample};
use embedded_storage::nor_flash::NorFlash;

/// Maximum change of the share per report: from 1 to 0 in a second, to avoid torque steps.
const MAX_CHANGE_PER_REPORT: f32 = 1e-3;

impl<F: NorFlash> Device<F> {
    /// Evaluates a report for over-compensation.
    pub(super) fn step_over_compensation(&mut self) {
        let scale = self.set().friction.compensator.scale;
        let sees = self.settings.source == InputSource::Sensors
            && self.supervisor.is_compensation_allowed()
            && !self.is_commissioning();
        if sees {
            let slid = SlidingSample {
                residual_nm: self.report.residual_torque_nm,
                friction_nm: self.report.friction_torque_nm,
                velocity_rad_s: self.report.velocity_rad_s,
            };
            self.over.step(&slid, scale);
        }
        let wanted = self.over.share(scale);
        let change =
            (wanted - self.compensation_left).clamp(-MAX_CHANGE_PER_REPORT, MAX_CHANGE_PER_REPORT);
        self.compensation_left += change;
    }

    /// Resets the detection after a change of parameters.
    pub(super) fn reset_over_compensation(&mut self) {
        self.over = OverCompensationWatch::default();
    }
}
