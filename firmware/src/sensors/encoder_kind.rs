//! The kinds of encoders of a motor.

use crate::control::PERIOD_S;

/// Kind of an encoder: the value of `encoder_kind`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderKind {
    /// AS5047P on SPI.
    #[default]
    As5047p,
    /// AS5048A on SPI.
    As5048a,
    /// A quadrature encoder with an index.
    Abz,
    /// A quadrature encoder with Hall sensors, and an index if it has one.
    AbzHall,
    /// Hall sensors alone.
    Hall,
    /// An absolute encoder with BiSS C.
    Biss,
}

impl EncoderKind {
    /// Returns the kind of a validated parameter.
    #[inline(never)]
    pub const fn of(parameter: f32) -> Self {
        match parameter as u8 {
            1 => Self::As5048a,
            2 => Self::Abz,
            3 => Self::AbzHall,
            4 => Self::Hall,
            5 => Self::Biss,
            _ => Self::As5047p,
        }
    }

    /// Returns true if its samples at rest or in slow motion are identical although it is sound: Hall sensors, and lines whose
    /// four counts are wider than the innovation that tells a frozen encoder ([`crate::control`]).
    pub(super) const fn has_wide_steps(self, abz_lines: f32) -> bool {
        match self {
            Self::As5047p | Self::As5048a | Self::Biss => false,
            Self::Abz | Self::AbzHall => abz_lines < LEAST_LINES_OF_FROZEN,
            Self::Hall => true,
        }
    }

    /// Returns the age of its angle at the sample of the currents, s, if the board latches frames of an AS504x and of BiSS C
    /// at these ages. Counts and levels are read with the sample, and Hall sensors are confirmed by the next one.
    pub const fn age_s(self, frames_age_s: f32, biss_age_s: f32) -> f32 {
        match self {
            Self::As5047p | Self::As5048a => frames_age_s,
            Self::Biss => biss_age_s,
            Self::Abz | Self::AbzHall => 0.0,
            Self::Hall => PERIOD_S,
        }
    }
}

/// Lines of an encoder from which identical samples show that it is frozen: four counts are 0.0123 rad of the motor.
const LEAST_LINES_OF_FROZEN: f32 = 512.0;
