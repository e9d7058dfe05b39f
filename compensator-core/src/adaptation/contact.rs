//! External contact: a step of the torque that friction cannot make.
//!
//! While a joint is in use, its friction in one direction changes slowly. A torque that changes by a large share of the
//! level from one window to the next in the same direction is a contact, a payload or a sensor. Learning pauses until the
//! torque is back, or has stayed where it is for [`HOLD_S`] of sliding: then it is accepted as the new state of the joint.

use crate::number::Real;

/// Sliding time for which a contact stops the learning, s. A blow is shorter; a dropped payload is learnt afterwards.
const HOLD_S: f32 = 5.0;

/// Step of the torque between two windows that is a contact, as a share of the level.
const STEP_SHARE: f32 = 0.25;

/// The least such step, in units of the noise.
const STEP_NOISES: f32 = 6.0;

/// Detects contacts from the errors of the windows in one direction of motion.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct ContactWatch {
    /// Error of the last window, Nm; `None` before the first.
    last_nm: Option<f32>,
    /// Error before the contact, Nm.
    before_nm: f32,
    /// Remaining sliding time of the pause, s.
    left_s: f32,
}

impl ContactWatch {
    /// Processes the error of a window, Nm. Returns true while a contact acts.
    pub fn step(&mut self, error_nm: f32, level_nm: f32, noise_nm: f32, window_s: f32) -> bool {
        let step_nm = (STEP_SHARE * level_nm).at_least(STEP_NOISES * noise_nm);
        let last_nm = self.last_nm.replace(error_nm).unwrap_or(error_nm);
        let is_step = Real::abs(error_nm - last_nm) > step_nm;
        if is_step && self.left_s <= 0.0 {
            (self.before_nm, self.left_s) = (last_nm, HOLD_S);
        } else if self.left_s > 0.0 {
            let is_back = Real::abs(error_nm - self.before_nm) <= 0.5 * step_nm;
            let rest_s = if is_step { HOLD_S } else { self.left_s - window_s };
            self.left_s = if is_back { 0.0 } else { rest_s };
        }
        self.left_s > 0.0
    }
}
