//! What happened in a cycle of the current loop, as bits.
//!
//! Three kinds. *Faults* ([`LoopFlags::FAULTS`]): the bridge is open in this cycle because of them, and
//! whoever watches decides whether it stays so. *Limits*: still running, but held back. The rest says what
//! was replaced or is switched off. What the compensator has to say is in its own
//! [`compensator_core::Flags`], given beside these.

bitflags::bitflags! {
    /// What was replaced, limited or refused in a cycle.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct LoopFlags: u32 {
        /// Fewer than two phase currents valid, or one said to be valid that is not finite.
        const CURRENT_INVALID = 1 << 0;
        /// A phase current beyond `overcurrent_a`.
        const OVERCURRENT = 1 << 1;
        /// Three measured currents whose sum is beyond a tenth of `overcurrent_a`: one sensor is wrong,
        /// or current leaks. No fault: the loop runs on.
        const CURRENT_IMBALANCE = 1 << 2;
        /// Bus voltage not valid, not finite or not positive; the last good one stands in for 20 cycles.
        const BUS_INVALID = 1 << 3;
        /// No bus voltage to go by: invalid for longer than that, or never measured.
        const BUS_UNKNOWN = 1 << 4;
        /// Bus below `bus_voltage_min_v`.
        const BUS_UNDERVOLTAGE = 1 << 5;
        /// Bus above `bus_voltage_max_v`.
        const BUS_OVERVOLTAGE = 1 << 6;
        /// The encoder's validity bit was off.
        const ENCODER_INVALID = 1 << 7;
        /// The encoder jumped farther than the shaft can turn; not believed.
        const ENCODER_IMPLAUSIBLE = 1 << 8;
        /// The angle is a prediction, not a measurement.
        const ENCODER_COASTING = 1 << 9;
        /// No angle to drive by: coasted for too long, or starting and not settled.
        const ENCODER_LOST = 1 << 10;
        /// Whole turns of the motor are not known; the position is not given to the compensator.
        const POSITION_UNREFERENCED = 1 << 11;
        /// The joint is faster than `velocity_max_rad_s`.
        const OVERSPEED = 1 << 12;
        /// Set-point older than `setpoint_timeout_s`, or never heard: no current.
        const SETPOINT_STALE = 1 << 13;
        /// Set-point current not finite: no current.
        const SETPOINT_INVALID = 1 << 14;
        /// A covariate or the velocity reference was not finite; the compensator counts it as not heard.
        const COVARIATE_INVALID = 1 << 15;
        /// The current asked for was beyond a limit, after compensation.
        const CURRENT_LIMITED = 1 << 16;
        /// The voltage asked for was beyond the circle.
        const VOLTAGE_LIMITED = 1 << 17;
        /// The compensator is off, by order or for want of a set-point or a rotor.
        const COMPENSATION_OFF = 1 << 18;
        /// After a swap, from the old compensation to the new.
        const CROSS_FADING = 1 << 19;
        /// The bridge is open by order.
        const BRIDGE_OFF = 1 << 20;
        /// A number of the loop's own was not finite; its state was cleared. Never seen with validated
        /// parameters; here so that a mistake shows as a flag and not as a voltage.
        const NOT_FINITE = 1 << 21;

        /// Those that open the bridge in the cycle they are raised in.
        const FAULTS = Self::CURRENT_INVALID.bits() | Self::OVERCURRENT.bits()
            | Self::BUS_UNKNOWN.bits() | Self::BUS_UNDERVOLTAGE.bits()
            | Self::BUS_OVERVOLTAGE.bits() | Self::ENCODER_LOST.bits() | Self::NOT_FINITE.bits();
    }
}

impl LoopFlags {
    /// These flags if `condition`, else none.
    #[inline(always)]
    pub(super) fn when(self, condition: bool) -> Self {
        if condition { self } else { Self::empty() }
    }
}
