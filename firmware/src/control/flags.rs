//! Flags of a current-loop cycle.
//!
//! There are three kinds. *Faults* ([`LoopFlags::FAULTS`]) open the bridge in this cycle; the supervisor decides
//! whether it stays open. *Limits* hold the loop back while it runs. The others report values that were replaced
//! or functions that are off. The compensator reports its own state in [`compensator_core::Flags`].

bitflags::bitflags! {
    /// Values that were replaced, limited or refused in a cycle.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct LoopFlags: u32 {
        /// Fewer than two phase currents are valid, or one marked valid is not finite.
        const CURRENT_INVALID = 1 << 0;
        /// A phase current exceeds `overcurrent_a`.
        const OVERCURRENT = 1 << 1;
        /// The sum of three measured currents exceeds a tenth of `overcurrent_a`: a sensor is wrong or current
        /// leaks. Not a fault: the loop continues.
        const CURRENT_IMBALANCE = 1 << 2;
        /// The bus voltage is invalid, not finite or not positive. The last valid one replaces it for 20 cycles.
        const BUS_INVALID = 1 << 3;
        /// The bus voltage is unknown: invalid for more than 20 cycles, or never measured.
        const BUS_UNKNOWN = 1 << 4;
        /// The bus voltage is below `bus_voltage_min_v`.
        const BUS_UNDERVOLTAGE = 1 << 5;
        /// The bus voltage is above `bus_voltage_max_v`.
        const BUS_OVERVOLTAGE = 1 << 6;
        /// The encoder sample was marked invalid.
        const ENCODER_INVALID = 1 << 7;
        /// The encoder angle jumped farther than the shaft can turn; the sample was discarded.
        const ENCODER_IMPLAUSIBLE = 1 << 8;
        /// The angle is a prediction, not a measurement.
        const ENCODER_COASTING = 1 << 9;
        /// The rotor angle is unknown: predicted for too long, the samples are frozen, or the observer has not settled after a start.
        const ENCODER_LOST = 1 << 10;
        /// Whole turns of the motor are unknown; the compensator receives no position.
        const POSITION_UNREFERENCED = 1 << 11;
        /// The joint velocity exceeds `velocity_max_rad_s`. The supervisor stops the joint if it persists.
        const VELOCITY_EXCEEDED = 1 << 12;
        /// The set-point is older than `setpoint_timeout_s` or was never received: no current.
        const SETPOINT_STALE = 1 << 13;
        /// The set-point current is not finite: no current.
        const SETPOINT_INVALID = 1 << 14;
        /// A covariate or the velocity reference is not finite; the compensator treats it as missing.
        const COVARIATE_INVALID = 1 << 15;
        /// The demanded current exceeded a limit, after compensation.
        const CURRENT_LIMITED = 1 << 16;
        /// The demanded voltage exceeded the circle, or the current was reduced so that it fits.
        const VOLTAGE_LIMITED = 1 << 17;
        /// The compensator is off: by command, or because set-point or rotor angle are missing.
        const COMPENSATION_OFF = 1 << 18;
        /// After a swap, the compensation current cross-fades from the old to the new.
        const CROSS_FADING = 1 << 19;
        /// The bridge is open by command.
        const BRIDGE_OFF = 1 << 20;
        /// A value computed by the loop was not finite; its state was cleared. This cannot happen with validated
        /// parameters. The flag makes a programming error visible and keeps it out of the voltage.
        const NOT_FINITE = 1 << 21;
        /// The joint velocity exceeds `overspeed_rad_s`.
        const OVERSPEED = 1 << 23;
        /// The bus is nearly full: the copper burns braking power by a d current, or braking is reduced.
        const BRAKING_LIMITED = 1 << 22;

        /// Flags that open the bridge in the cycle in which they are set.
        const FAULTS = Self::CURRENT_INVALID.bits() | Self::OVERCURRENT.bits()
            | Self::BUS_UNKNOWN.bits() | Self::BUS_UNDERVOLTAGE.bits()
            | Self::BUS_OVERVOLTAGE.bits() | Self::ENCODER_LOST.bits() | Self::NOT_FINITE.bits()
            | Self::OVERSPEED.bits();
    }
}

impl LoopFlags {
    /// Returns these flags if `condition` is true, else none.
    #[inline(always)]
    pub(super) fn when(self, condition: bool) -> Self {
        if condition { self } else { Self::empty() }
    }
}
