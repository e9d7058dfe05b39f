//! Share of the compensation in use, reduced if the model has more friction than the joint.

use super::{Device, InputSource};
use crate::driver::over_compensation::{OverCompensationWatch, SlidingSample};
use embedded_storage::nor_flash::NorFlash;

/// Maximum change of the share per report: from 1 to 0 in a second, to avoid torque steps.
const MAX_CHANGE_PER_REPORT: f32 = 1e-3;

/// The detection of over-compensation, and the share that it leaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompensationShare {
    watch: OverCompensationWatch,
    /// Share in use, 0..=1.
    share: f32,
}

impl Default for CompensationShare {
    fn default() -> Self {
        Self { watch: OverCompensationWatch::default(), share: 1.0 }
    }
}

impl CompensationShare {
    /// Returns the share of the compensation in use, 0..=1.
    pub(crate) const fn share(&self) -> f32 {
        self.share
    }

    /// Returns true if the model has more friction than the joint.
    pub(crate) const fn is_over_compensated(&self) -> bool {
        self.watch.is_detected()
    }

    /// Resets the detection after a change of parameters.
    pub(crate) fn reset(&mut self) {
        self.watch = OverCompensationWatch::default();
    }

    /// Evaluates a sliding joint, if it is one, and moves the share in use towards the wanted one.
    pub(crate) fn step(&mut self, slid: Option<&SlidingSample>, scale: f32) {
        if let Some(slid) = slid {
            self.watch.step(slid, scale);
        }
        let change = self.watch.share(scale) - self.share;
        self.share += change.clamp(-MAX_CHANGE_PER_REPORT, MAX_CHANGE_PER_REPORT);
    }
}

impl<F: NorFlash> Device<F> {
    /// Evaluates a report for over-compensation.
    pub(super) fn step_over_compensation(&mut self) {
        let scale = self.set().friction.compensator.scale;
        let sees = self.settings.source == InputSource::Sensors
            && self.supervisor.is_compensation_allowed()
            && !self.is_commissioning();
        let report = self.current_loop.report();
        let slid = SlidingSample {
            residual_nm: report.residual_torque_nm,
            friction_nm: report.friction_torque_nm,
            velocity_rad_s: report.velocity_rad_s,
        };
        self.compensation.step(sees.then_some(&slid), scale);
    }
}
