//! The configuration of a joint driver: a friction model, and the settings of its compensator.
//!
//! A user writes it as a file. A driver stores it as a [record](crate::record). The
//! [compensator](crate::compensator) is built from it for a sample period.

use crate::number::Real;
use crate::parameter::ParameterId;
use crate::parameters::{ParameterError, Parameters, Text, check_ranges};
use crate::term::TermKind;
use crate::text;

crate::named_fields! {
    /// Settings of the compensator in the current loop, in the units of a configuration file.
    pub struct CompensatorParameters {
        /// Share of the friction to cancel, 0..=1. Industry uses 0.7-0.9; above 1, the joint oscillates.
        scale: f32 = 0.9, 0.0..=1.0, "over-compensation makes the joint oscillate";
        /// Largest compensation torque, Nm.
        torque_limit_nm: f32 = 6.0, 0.0..=1000.0, "a torque limit is a size";
        /// Fastest change of the compensation torque, Nm/s.
        slew_limit_nm_per_s: f32 = 2000.0, 1e-3..=1e9, "at no slew nothing would ever be compensated";
        /// Joint torque per motor current, including the gear, Nm/A.
        torque_constant_nm_per_a: f32 = 1.0, 1e-6..=1e6, "current is torque over this";
        /// Largest current after the last addition, A.
        current_limit_a: f32 = 26.0, 0.0..=1000.0, "a current limit is a size";
        /// Speed below which the velocity is blended towards the reference, rad/s; 0 disables blending.
        blend_velocity_rad_s: f32 = 0.05, 0.0..=1e3, "a speed";
        /// Age up to which a reading counts fully, s.
        hold_s: f32 = 0.1, 0.0..=1000.0, "a time";
        /// Time in which an older reading fades to its neutral value, s.
        fade_s: f32 = 0.4, 1e-4..=1000.0, "a reading fades, it does not jump";
    }
    /// Defaults for the joint of Ding et al. (26 Nm; friction 2-3.5 Nm) with a 1 Nm/A drive.
}

impl CompensatorParameters {
    /// Checks the range of every field.
    ///
    /// # Errors
    /// Returns the first field outside its range, with its value, its bound and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::TEXTS, &self.to_array(), &Self::RANGES)
    }
}

/// The configuration of a joint driver.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// The friction model.
    pub model: Parameters<f32>,
    /// The settings of the compensator.
    pub compensator: CompensatorParameters,
}

impl Configuration {
    /// Checks the model and the compensator settings.
    ///
    /// # Errors
    /// Returns the first error of [`Parameters::validate`] and [`CompensatorParameters::validate`].
    pub fn validate(&self) -> Result<(), ParameterError> {
        self.model.validate()?;
        self.compensator.validate()
    }

    /// Returns the first quantity with which this set may compensate more friction than another one: a level, a viscous
    /// coefficient or the size of a term, times the scale; the law, a term or `allow_active` if the other set does not have it.
    /// Shapes, such as the Stribeck velocity, are not compared: they move friction between the levels.
    #[must_use]
    pub fn larger_quantity(&self, other: &Self) -> Option<Text> {
        let (model, former) = (&self.model, &other.model);
        if model.law != former.law {
            return Some(text!("law"));
        }
        if model.choices.allow_active && !former.choices.allow_active {
            return Some(text!("allow_active"));
        }
        let is_new = |kind: &&TermKind| !former.terms.contains(kind);
        if let Some(kind) = model.terms.iter().find(is_new) {
            return Some(kind.text());
        }
        let is_larger = |id: &ParameterId| self.compensated(*id) > other.compensated(*id);
        let of_terms = model.terms.iter().flat_map(|kind| kind.sizes().iter().copied());
        let sizes = model.law.levels().chain(model.law.viscous()).chain(of_terms);
        sizes.into_iter().find(is_larger).map(ParameterId::text)
    }

    #[inline(never)]
    fn compensated(&self, id: ParameterId) -> f32 {
        self.compensator.scale * Real::abs(self.model.get(id))
    }
}
