//! The compensator's flags of a sample: one bit for each value that it replaced, faded or limited.
//!
//! CAN frames and logs contain the bits. Therefore the value of a bit must not change.
//! A new flag takes the next free bit.

use crate::number::Mask;

bitflags::bitflags! {
    /// Values that were replaced, faded or limited in a sample.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Flags: u32 {
        /// The compensator is disabled.
        const DISABLED = 1 << 0;
        /// Measured velocity is NaN, outside the envelope or too old; the reference replaces it.
        const VELOCITY_INVALID = 1 << 1;
        /// Reference velocity is NaN, outside the envelope or too old; the measured velocity replaces it.
        const REFERENCE_INVALID = 1 << 2;
        /// Position is NaN or outside the envelope.
        const POSITION_INVALID = 1 << 3;
        /// Position is too old; its terms fade.
        const POSITION_STALE = 1 << 4;
        /// Acceleration is NaN or outside the envelope.
        const ACCELERATION_INVALID = 1 << 5;
        /// Acceleration is too old; its term fades.
        const ACCELERATION_STALE = 1 << 6;
        /// Radial force is NaN or outside the envelope.
        const RADIAL_FORCE_INVALID = 1 << 7;
        /// Radial force is too old; it fades.
        const RADIAL_FORCE_STALE = 1 << 8;
        /// Pressure is NaN or outside the envelope.
        const PRESSURE_INVALID = 1 << 9;
        /// Pressure is too old; it fades.
        const PRESSURE_STALE = 1 << 10;
        /// Temperature is NaN or outside -50..150 deg C.
        const TEMPERATURE_INVALID = 1 << 11;
        /// Temperature is too old; it fades to the reference temperature.
        const TEMPERATURE_STALE = 1 << 12;
        /// Load torque is NaN or outside the envelope.
        const LOAD_TORQUE_INVALID = 1 << 13;
        /// Load torque is too old; it fades.
        const LOAD_TORQUE_STALE = 1 << 14;
        /// Campaign time is NaN, negative or outside the envelope; the last valid value applies.
        const CAMPAIGN_TIME_INVALID = 1 << 15;
        /// The torque limit acted.
        const TORQUE_LIMITED = 1 << 16;
        /// The slew limit acted.
        const SLEW_LIMITED = 1 << 17;
        /// The current limit acted on the sum.
        const CURRENT_LIMITED = 1 << 18;
        /// The model torque was not finite; the model state was cleared. Validated parameters
        /// cannot cause this. The flag reveals a defect before it becomes a current.
        const MODEL_NOT_FINITE = 1 << 19;
        /// The current command was not finite and counted as 0.
        const COMMAND_INVALID = 1 << 20;
        /// Auxiliary covariate is NaN or outside -1e9..1e9.
        const AUXILIARY_INVALID = 1 << 21;
        /// Auxiliary covariate is too old; its term fades.
        const AUXILIARY_STALE = 1 << 22;
        /// The last network input was outside the training range; the law returns to its constants.
        const NETWORK_OUTSIDE = 1 << 23;
    }
}

impl Flags {
    /// Returns these flags if the mask is set, otherwise no flags.
    #[inline(always)]
    pub(crate) fn when(self, mask: Mask) -> Self {
        Self::from_bits_retain(self.bits() & mask.bits())
    }
}
