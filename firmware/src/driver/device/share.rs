//! What share of the compensation is left to a joint whose model has more friction than it.

use super::{Device, Source};
use crate::driver::over_compensation::{OverCompensation, Slid};
use embedded_storage::nor_flash::NorFlash;

/// Change of the share with a report: from all to nothing in a second, so that no torque jumps.
const RAMP: f32 = 1e-3;

impl<F: NorFlash> Device<F> {
    /// A report came: what it says of the model's friction.
    pub(super) fn see_over_compensation(&mut self) {
        let scale = self.set().friction.compensator.scale;
        let sees = self.settings.source == Source::Sensors
            && self.supervisor.compensation_allowed()
            && !self.commissions();
        if sees {
            let slid = Slid {
                residual_nm: self.report.residual_torque_nm,
                friction_nm: self.report.friction_torque_nm,
                velocity_rad_s: self.report.velocity_rad_s,
            };
            self.over.step(&slid, scale);
        }
        let wanted = self.over.share(scale);
        let change = (wanted - self.compensation_left).clamp(-RAMP, RAMP);
        self.compensation_left += change;
    }

    /// Other parameters are in force: nothing was seen of them.
    pub(super) fn forget_over_compensation(&mut self) {
        self.over = OverCompensation::default();
    }
}
