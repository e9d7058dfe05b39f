//! Parameters of the adaptation, and the reasons why it learns nothing.

use crate::parameters::{ParameterError, check_ranges};

crate::named_fields! {
    /// Parameters of the adaptation.
    pub struct AdaptationParameters {
        /// Least gain of the box; 1 is the tuned set.
        least_gain: f32 = 0.4, 0.05..=1.0, "the box contains the tuned set";
        /// Largest gain of the box.
        largest_gain: f32 = 2.5, 1.0..=10.0, "the box contains the tuned set";
        /// Memory of the regression in each direction that is excited, s of sliding.
        memory_s: f32 = 10.0, 1.0..=1e4, "some windows at least, some hours at most";
        /// Fastest change of a gain, 1/s of sliding.
        slew_per_s: f32 = 0.02, 1e-5..=0.1, "slow beside the loops around the model";
        /// Time without learning after arming, a fault or missing inputs, s.
        settle_s: f32 = 3.0, 0.0..=600.0, "a time";
        /// Time without learning after a reversal, s.
        reversal_s: f32 = 0.1, 0.0..=60.0, "a time";
        /// Least speed of sliding, rad/s.
        least_velocity_rad_s: f32 = 0.05, 0.0..=1e3, "a speed";
        /// Scatter of the torque of a window, Nm: the residual of the identification.
        noise_nm: f32 = 0.1, 1e-6..=1e6, "an error is measured against it";
    }
    /// Defaults for a joint of some newton metres.
}

impl AdaptationParameters {
    /// Checks the range of every field.
    ///
    /// # Errors
    /// Returns the first field outside its range, with its value, its bound and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::TEXTS, &self.to_array(), &Self::RANGES)
    }
}

macro_rules! define_reasons {
    ($($(#[$doc:meta])* $reason:ident = $number:literal, $name:literal;)*) => {
        /// Reason why the adaptation learns nothing at present.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        pub enum Frozen { $($(#[$doc])* $reason = $number),* }

        impl Frozen {
            /// Every reason, ordered by number.
            pub const ALL: &'static [Self] = &[$(Self::$reason),*];

            /// Returns the name in reports.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$reason => $name),* }
            }
        }
    };
}

define_reasons! {
    /// It learns.
    None = 0, "learning";
    /// It is switched off: the tuned set applies.
    Off = 1, "off";
    /// What was learnt applies, and nothing more is learnt.
    Hold = 2, "hold";
    /// The joint is not armed, or a fault acts.
    NotArmed = 3, "not-armed";
    /// Armed, or free of another reason, only just now.
    Settling = 4, "settling";
    /// Current, voltage or torque is at a limit.
    Saturated = 5, "saturated";
    /// The joint is at rest, or slow.
    Standstill = 6, "standstill";
    /// The joint has reversed just now, or its bristles are not saturated.
    Reversal = 7, "reversal";
    /// An input is missing, stale or implausible.
    Inputs = 8, "inputs";
    /// The torque made a step that friction cannot make.
    Contact = 9, "contact";
    /// The set with the next gains is not valid.
    Refused = 10, "refused";
}

impl Frozen {
    /// Returns true if the joint may have changed meanwhile, so that it has to settle again.
    pub(super) const fn restarts(self) -> bool {
        matches!(self, Self::Off | Self::Hold | Self::NotArmed | Self::Inputs)
    }
}
