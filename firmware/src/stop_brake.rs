//! The reaction of a bridge that stops while the motor turns: coasting, or a brake by shorted low sides.
//!
//! An open bridge lets the joint coast, and a load falls. With all low sides closed, the motor brakes itself: its
//! induced voltage drives a current of at most `psi / L` through the winding, which burns the energy. The bus takes
//! none, and no encoder is needed. The parameter `brake_at_stop` selects it; the default is to coast.
//!
//! A short needs a sound bridge and sound shunts. After a fault of either (gate driver, overcurrent, phase currents,
//! bus voltage too low for the gate driver), the bridge opens instead, also while it brakes. A processor that stops,
//! by a panic or its watchdog, opens the bridge as well.
//!
//! The brake ends after [`HOLD_PERIODS`] with less than [`END_A`]: the joint stands. A load that sinks against the
//! brake keeps it closed. A new command to close the bridge also ends it, because the offsets of the shunts are found
//! with open switches.

use crate::control::transform::Stationary;
use crate::control::{Bridge, LoopFlags};

/// Periods with little current after which the brake ends, 0.1 s.
pub const HOLD_PERIODS: u32 = 2000;

/// Current below which a shorted motor stands, A: five times the error of the shunts. The reference joint then turns
/// with less than 0.1 rad/s.
pub const END_A: f32 = 0.5;

/// Periods after the brake until no current flows: the bus drives 20 A to zero in one.
const OPENING_PERIODS: u32 = 4;

/// Flags of the current loop with which the low sides are never shorted.
pub const PREVENTING: LoopFlags = LoopFlags::CURRENT_INVALID
    .union(LoopFlags::OVERCURRENT)
    .union(LoopFlags::BUS_UNKNOWN)
    .union(LoopFlags::BUS_UNDERVOLTAGE)
    .union(LoopFlags::NOT_FINITE);

/// State of the brake.
#[derive(Clone, Copy, Debug, Default)]
pub struct StopBrake {
    /// Periods until the brake ends; 0 without a brake.
    remaining: u32,
    is_shorted: bool,
    /// Periods until the current has ended after a brake.
    opening: u32,
}

impl StopBrake {
    /// Records a period in which the bridge was driven: a brake may follow.
    #[inline(always)]
    pub fn record_driven(&mut self) {
        *self = Self { remaining: HOLD_PERIODS, is_shorted: false, opening: 0 };
    }

    /// Returns true if a period without a driven bridge needs [`StopBrake::step`].
    #[inline(always)]
    pub const fn is_due(&self) -> bool {
        self.remaining > 0 || self.opening > 0
    }

    /// Returns the bridge for a period in which it is not driven. `may_short` is the permission of the parameters, the
    /// supervisor and the hardware, and `current` the measured current vector, A.
    pub fn step(&mut self, may_short: bool, current: Stationary) -> Bridge {
        if self.remaining == 0 {
            self.opening = self.opening.saturating_sub(1);
            return Bridge::Off;
        }
        let Stationary { alpha, beta } = current;
        self.remaining = if !may_short {
            0
        } else if alpha * alpha + beta * beta > END_A * END_A {
            HOLD_PERIODS
        } else {
            self.remaining - 1
        };
        if self.remaining > 0 || self.is_shorted {
            self.opening = OPENING_PERIODS;
        }
        self.is_shorted = self.remaining > 0;
        if self.is_shorted { Bridge::Shorted } else { Bridge::Off }
    }

    /// Returns true if no current of a brake flows: the offsets of the shunts may be found.
    pub const fn has_ended(&self) -> bool {
        self.opening == 0
    }

    /// Returns true while the low sides are shorted.
    pub const fn is_shorted(&self) -> bool {
        self.is_shorted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn current(alpha: f32) -> Stationary {
        Stationary { alpha, beta: 0.0 }
    }

    #[test]
    fn brake_lasts_while_current_flows_and_a_tenth_of_a_second_longer() {
        let mut brake = StopBrake::default();
        assert!(!brake.is_due(), "was never driven");
        assert_eq!(brake.step(true, current(9.0)), Bridge::Off);
        brake.record_driven();
        for _ in 0..10_000 {
            assert_eq!(brake.step(true, current(2.0)), Bridge::Shorted);
        }
        let left =
            (0..10_000).take_while(|_| brake.step(true, current(0.3)) == Bridge::Shorted).count();
        assert_eq!(left as u32, HOLD_PERIODS - 1);
        assert!(!brake.is_shorted());
        assert_eq!(brake.step(true, current(9.0)), Bridge::Off, "it has ended");
        (0..OPENING_PERIODS).for_each(|_| assert_eq!(brake.step(true, current(0.0)), Bridge::Off));
        assert!(brake.has_ended() && !brake.is_due());
    }

    #[test]
    fn brake_without_permission_ends_at_once_and_does_not_return() {
        let mut brake = StopBrake::default();
        brake.record_driven();
        assert_eq!(brake.step(true, current(9.0)), Bridge::Shorted);
        assert_eq!(brake.step(false, current(9.0)), Bridge::Off);
        assert_eq!(brake.step(true, current(9.0)), Bridge::Off);
        assert!(!brake.is_shorted());
    }

    #[test]
    fn bridge_that_opens_without_a_brake_has_no_current_to_wait_for() {
        let mut brake = StopBrake::default();
        brake.record_driven();
        assert_eq!(brake.step(false, current(9.0)), Bridge::Off);
        assert!(brake.has_ended());
    }
}
