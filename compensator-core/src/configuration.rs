//! What a joint driver is configured with: a friction model, and how the current loop uses it.
//!
//! A person writes it as a file, a driver keeps it as a [record](crate::record); the
//! [compensator](crate::compensator) is built from it for a sample period.

use crate::parameters::{ParameterError, Parameters, check_ranges};

crate::named_fields! {
    /// How the model is used in the current loop, as a person writes it.
    pub struct CompensatorParameters {
        /// Share of the friction to cancel, 0..=1. Industry uses 0.7-0.9; above 1 joints oscillate.
        scale: f32 = 0.9, 0.0..=1.0, "over-compensation makes the joint oscillate";
        /// Largest compensation torque, Nm.
        torque_limit_nm: f32 = 6.0, 0.0..=1000.0, "a torque limit is a size";
        /// Fastest change of the compensation torque, Nm/s.
        slew_limit_nm_per_s: f32 = 2000.0, 1e-3..=1e9, "at no slew nothing would ever be compensated";
        /// Joint torque per motor current, Nm/A, gear included.
        torque_constant_nm_per_a: f32 = 1.0, 1e-6..=1e6, "current is torque over this";
        /// Largest current after the last addition, A.
        current_limit_a: f32 = 26.0, 0.0..=1000.0, "a current limit is a size";
        /// Below this speed the reference velocity takes over gradually, rad/s; 0 for never.
        blend_velocity_rad_s: f32 = 0.05, 0.0..=1e3, "a speed";
        /// A reading is good for this long, s.
        hold_s: f32 = 0.1, 0.0..=1000.0, "a time";
        /// After that it fades to neutral over this long, s.
        fade_s: f32 = 0.4, 1e-4..=1000.0, "a reading fades, it does not jump";
    }
    /// For the joint of Ding et al. (26 Nm; friction 2-3.5 Nm) with a 1 Nm/A drive.
}

impl CompensatorParameters {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field out of its range, its value, its bound and why.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::NAMES, &self.to_array(), &Self::RANGES)
    }
}

/// What a joint driver is configured with.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// The friction model.
    pub model: Parameters<f32>,
    /// How it is used in the current loop.
    pub compensator: CompensatorParameters,
}

impl Configuration {
    /// Checks both parts.
    ///
    /// # Errors
    /// The first refusal, as [`Parameters::validate`] and [`CompensatorParameters::validate`].
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.model.validate()?;
        self.compensator.validate()
    }
}
