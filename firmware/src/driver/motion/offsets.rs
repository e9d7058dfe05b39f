//! Feed-forward of a master: velocity offset (60B1h) and torque offset (60B2h) of CiA 402-2.
//!
//! | mode | velocity offset | torque offset |
//! |---|---|---|
//! | 8 (CSP) | added to the velocity of the position loop | added to the current of the velocity loop |
//! | 9 (CSV) | added to 60FFh | added to the current of the velocity loop |
//! | 10 (CST) | no effect | added to 6071h |
//!
//! The sums have the limits of every set-point: 6072h, 6080h and 607Dh. The driver itself adds the torque of its inertia and of
//! friction, and in CSP the velocity of the course. So an offset is what a master knows beyond: gravity, the reaction of other
//! joints, an external force.
//!
//! Both belong to a cycle, as the targets do: an offset that is not written again for `setpoint_timeout_s` decays. While the
//! driver holds the joint, the last torque offset becomes a part of the loop's integral, because the load that it carries remains.

use super::Motion;
use crate::driver::loop_data::REPORT_PERIOD_S;
use crate::joint_node::JointBase;

/// Time constant of the decay of a stale offset, s: long against the velocity loop, which takes over, and short against the
/// ramps of a stop.
const DECAY_S: f32 = 0.05;

/// Share of a stale offset that remains after a report.
const RETAINED: f32 = 1.0 - REPORT_PERIOD_S / DECAY_S;

/// An offset of the master.
#[derive(Clone, Copy, Debug, Default)]
struct Offset {
    /// As written.
    written: i32,
    /// Time at which it was written, us; `None` if it never was.
    at_us: Option<u64>,
    /// Value in use, in units of `written`.
    applied: f32,
}

impl Offset {
    fn write(&mut self, number: i32, now_us: u64) {
        self.written = number;
        self.at_us = Some(now_us);
    }

    fn step(&mut self, now_us: u64, timeout_us: u64) {
        let is_fresh = self.at_us.is_some_and(|at| now_us.saturating_sub(at) < timeout_us);
        self.applied = if is_fresh {
            self.written as f32
        } else if self.applied.abs() < 0.5 {
            // Below the resolution of the object.
            0.0
        } else {
            RETAINED * self.applied
        };
    }
}

/// The offsets of the master.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Offsets {
    /// 60B1h, 1e-6 rad/s.
    velocity: Offset,
    /// 60B2h, thousandths of the rated torque.
    torque: Offset,
}

impl Motion {
    /// Sets what a master wrote: 60B1h, 1e-6 rad/s, and 60B2h, thousandths of the rated torque.
    pub(crate) fn set_offsets(
        &mut self,
        joint: &JointBase,
        micro_rad_s: Option<i32>,
        permille: Option<i16>,
    ) {
        if let Some(micro_rad_s) = micro_rad_s {
            self.offsets.velocity.write(micro_rad_s, joint.now_us);
        }
        if let Some(permille) = permille {
            self.offsets.torque.write(permille.into(), joint.now_us);
        }
    }

    /// Returns the offsets as they were written: 60B1h and 60B2h.
    pub(crate) const fn written_offsets(&self) -> [u32; 2] {
        [self.offsets.velocity.written as u32, self.offsets.torque.written as u32]
    }

    /// Lets stale offsets decay, once per report.
    pub(crate) fn step_offsets(&mut self, joint: &JointBase) {
        let timeout_us = (joint.set().motor.setpoint_timeout_s * 1e6) as u64;
        self.offsets.velocity.step(joint.now_us, timeout_us);
        self.offsets.torque.step(joint.now_us, timeout_us);
    }

    /// Returns the velocity offset, rad/s.
    pub(crate) const fn velocity_offset_rad_s(&self) -> f32 {
        self.offsets.velocity.applied * 1e-6
    }

    /// Returns the current of the torque offset, A.
    #[inline(never)]
    pub(crate) fn offset_current_a(&self, joint: &JointBase) -> f32 {
        self.offsets.torque.applied * 1e-3 * joint.rated_current_a()
    }
}
