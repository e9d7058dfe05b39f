//! What the compensator says about a sample: one bit for each thing it replaced, faded or limited.
//!
//! Bits travel on CAN and in logs, so none may ever change; a new one takes the next free place.

use crate::number::Mask;

bitflags::bitflags! {
    /// What was replaced, faded or limited in a sample.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Flags: u32 {
        /// The compensator is off and did nothing.
        const DISABLED = 1 << 0;
        /// Measured velocity NaN, beyond the envelope or too old; the reference stood in.
        const VELOCITY_INVALID = 1 << 1;
        /// Reference velocity NaN, beyond the envelope or too old; the measured one stood in.
        const REFERENCE_INVALID = 1 << 2;
        /// Position NaN or beyond the envelope.
        const POSITION_INVALID = 1 << 3;
        /// Position so old that its terms fade.
        const POSITION_STALE = 1 << 4;
        /// Acceleration NaN or beyond the envelope.
        const ACCELERATION_INVALID = 1 << 5;
        /// Acceleration so old that its term fades.
        const ACCELERATION_STALE = 1 << 6;
        /// Radial force NaN or beyond the envelope.
        const RADIAL_FORCE_INVALID = 1 << 7;
        /// Radial force so old that it fades.
        const RADIAL_FORCE_STALE = 1 << 8;
        /// Pressure NaN or beyond the envelope.
        const PRESSURE_INVALID = 1 << 9;
        /// Pressure so old that it fades.
        const PRESSURE_STALE = 1 << 10;
        /// Temperature NaN or outside -50..150 deg C.
        const TEMPERATURE_INVALID = 1 << 11;
        /// Temperature so old that it fades to the reference.
        const TEMPERATURE_STALE = 1 << 12;
        /// Load torque NaN or beyond the envelope.
        const LOAD_TORQUE_INVALID = 1 << 13;
        /// Load torque so old that it fades.
        const LOAD_TORQUE_STALE = 1 << 14;
        /// Campaign time NaN, negative or beyond the envelope; the last good one stands.
        const CAMPAIGN_TIME_INVALID = 1 << 15;
        /// The torque limit acted.
        const TORQUE_LIMITED = 1 << 16;
        /// The slew limit acted.
        const SLEW_LIMITED = 1 << 17;
        /// The current limit acted on the sum.
        const CURRENT_LIMITED = 1 << 18;
        /// The model gave no finite torque; its state was cleared. Never seen with validated
        /// parameters; here so that a mistake shows as a flag and not as a current.
        const MODEL_NOT_FINITE = 1 << 19;
        /// The command given to the sum was not a finite number and counted as 0.
        const COMMAND_INVALID = 1 << 20;
        /// Auxiliary covariate NaN or beyond any sensible size.
        const AUXILIARY_INVALID = 1 << 21;
        /// Auxiliary covariate so old that its term fades.
        const AUXILIARY_STALE = 1 << 22;
        /// A network's last evaluation lay outside of what it was trained on: the law runs, or is on its way to run, on
        /// its constants.
        const NETWORK_OUTSIDE = 1 << 23;
    }
}

impl Flags {
    /// These flags where the mask is set, else none.
    #[inline(always)]
    pub(crate) fn when(self, mask: Mask) -> Self {
        Self::from_bits_retain(self.bits() & mask.bits())
    }
}
