//! Share of the compensation in use, reduced if the model has more friction than the joint.

use crate::driver::LoopReport;
use crate::driver::over_compensation::{OverCompensationWatch, SlidingSample};
use crate::driver::passivity::{PassivityGuard, PassivityParameters, TorqueSample};
use crate::parameter_set::ParameterSet;

/// Maximum change of the share per report by the two-sided detection: from 1 to 0 in a second, to avoid torque steps.
const MAX_CHANGE_PER_REPORT: f32 = 1e-3;

with_defaults! {
    /// The detections of over-compensation, and the share that they leave.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct CompensationShare {
        watch: OverCompensationWatch,
        guard: PassivityGuard,
        /// Share of the two-sided detection, 0..=1.
        share: f32 = 1.0,
    }
}

impl CompensationShare {
    /// Returns the share of the compensation in use, 0..=1.
    pub(crate) fn share(&self) -> f32 {
        self.share.min(self.guard.share())
    }

    /// Returns true if the model has more friction than the joint.
    pub(crate) fn is_over_compensated(&self) -> bool {
        self.watch.is_detected() || self.guard.is_detected()
    }

    /// Resets the detections after a change of parameters.
    pub(crate) fn reset(&mut self) {
        self.watch = OverCompensationWatch::default();
        self.guard = PassivityGuard::default();
    }

    /// Evaluates a report. `is_compensated`: the joint is compensated; `offset_nm`: part of the command that balances a load
    /// and moves nothing, in a torque mode; `None` in any other.
    pub(crate) fn step(
        &mut self,
        report: &LoopReport,
        set: &ParameterSet,
        is_compensated: bool,
        offset_nm: Option<f32>,
    ) {
        let joint = &set.friction.compensator;
        if is_compensated {
            let slid = SlidingSample {
                residual_nm: report.residual_torque_nm,
                friction_nm: report.friction_torque_nm,
                velocity_rad_s: report.velocity_rad_s,
            };
            self.watch.step(&slid, joint.scale);
        }
        let change = self.watch.share(joint.scale) - self.share;
        self.share += change.clamp(-MAX_CHANGE_PER_REPORT, MAX_CHANGE_PER_REPORT);
        let Some(offset_nm) = offset_nm.filter(|_| is_compensated) else {
            self.guard.interrupt();
            return;
        };
        let by_a = joint.torque_constant_nm_per_a;
        let compensation_nm = by_a * report.feed_forward_current_a;
        let sample = TorqueSample {
            velocity_rad_s: report.velocity_rad_s,
            command_nm: by_a * report.current_reference_a - compensation_nm - offset_nm,
            compensation_nm,
            friction_nm: report.friction_torque_nm,
        };
        let parameters = PassivityParameters {
            inertia_kg_m2: set.motor.inertia_kg_m2,
            velocity_max_rad_s: set.motor.velocity_max_rad_s,
            scale: joint.scale,
        };
        self.guard.step(&sample, &parameters);
    }
}
