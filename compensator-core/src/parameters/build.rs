//! Builds a model for a sample period.
//!
//! The build computes every constant quotient, product and look-up, so that a step has one division. For
//! [`crate::number::Fixed`], it also verifies that no coefficient and no product of a step can overflow within
//! the envelope. The step itself therefore needs no checks.

use super::{Bound, ParameterError, ParameterId, Parameters};
use crate::curve;
use crate::fits::{coefficient, product};
use crate::law::{Law, LawParameters, LawRange};
use crate::model::FrictionModel;
use crate::number::Real;
use crate::refusal::refuse;
use crate::term::{Terms, check};
use crate::text;
use ParameterId as Id;

impl<S: Real<Setting = S>> Parameters<S> {
    /// Validates the parameters and builds the model for a sample period in s.
    ///
    /// # Errors
    /// As [`Parameters::validate`]. Also returns an error if the period is not positive and finite, if a delay
    /// is longer than the delay line, or if the number type cannot represent a coefficient or product.
    pub fn build<T: Real<Setting = S>>(
        &self,
        period_s: S,
    ) -> Result<FrictionModel<T>, ParameterError> {
        self.validate()?;
        let period = period_s.single();
        if !(period.is_finite() && period > 0.0) {
            refuse(text!("sample_period_s"), period, Bound::MoreThan(0.0), text!("time moves on"))?;
        }
        let model = self.build_unchecked(period_s);
        self.check_range::<T>(period_s)?;
        Ok(model)
    }

    /// As [`Parameters::build`], without any check.
    ///
    /// A fit uses it, because its iterations may try illegal values.
    pub fn build_unchecked<T: Real<Setting = S>>(&self, period_s: S) -> FrictionModel<T> {
        FrictionModel {
            law: Law::build(self.law, &self.law_parameters(), period_s),
            terms: Terms::build(&self.terms, &self.values, period_s),
        }
    }

    /// Returns the largest bristle torque and the largest friction torque, Nm, that a model with these parameters can have
    /// within its envelope, for every input and every sample period up to this one, s. The parameters must be valid.
    ///
    /// The bristle torque of a step never exceeds the largest level, whatever the stiffness ([`crate::law`]).
    ///
    /// # Errors
    /// Returns an error if the law or a term refuses the period.
    pub fn largest_torques_nm(&self, period_s: f32) -> Result<[f32; 2], ParameterError> {
        self.check_range::<f32>(S::from_f64(f64::from(period_s)))
    }

    fn law_parameters(&self) -> LawParameters<'_, S> {
        LawParameters { values: &self.values, choices: self.choices, envelope: &self.envelope }
    }

    /// Checks every coefficient and product in the number type `T`. Returns as [`Parameters::largest_torques_nm`].
    fn check_range<T: Real>(&self, period_s: S) -> Result<[f32; 2], ParameterError> {
        let value = |id: Id| self.get(id).single();
        let speed = self.envelope.velocity_max_rad_s;
        coefficient::<T>(text!("velocity_max_rad_s"), speed)?;
        for id in self.law.parameters() {
            // The step uses these only in a product, which is checked below or by the law.
            let combined = [Id::BristleStiffness, Id::StribeckVelocity, Id::RadialForceRate];
            let per_pascal = [Id::PressureCoulomb, Id::PressureStaticExcess];
            if per_pascal.contains(id) {
                coefficient::<T>(id.text(), value(*id) * 1e6)?;
            } else if !combined.contains(id) {
                coefficient::<T>(id.text(), value(*id))?;
            }
        }
        let bounds = self.bounds();
        let viscous = self.largest_viscous(&bounds) * speed;
        product::<T>(text!("viscous_friction * velocity_max"), viscous)?;
        let level = self.largest_level(&bounds);
        product::<T>(text!("the largest level"), level)?;
        if self.law.has_stribeck_curve() {
            let cells = curve::CELLS_PER_STRIBECK_VELOCITY as f32 / value(Id::StribeckVelocity);
            coefficient::<T>(text!("16 / stribeck_velocity"), cells)?;
            if bounds.bends_stribeck_curve {
                product::<T>(text!("16 / stribeck_velocity * velocity_max"), cells * speed)?;
            }
        }
        let range = LawRange {
            period_s: period_s.single(),
            speed_rad_s: speed,
            smallest_level_nm: self.smallest_level(&bounds),
            largest_level_nm: level,
            bounds: &bounds,
        };
        let law_torque = self.law.check::<T, S>(&self.law_parameters(), &range)?;
        let torque = level + viscous + bounds.torque + law_torque;
        product::<T>(text!("the sum of all torques"), torque)?;
        check::<T, S>(&self.terms, &self.values, &self.envelope, period_s)?;
        Ok([level, torque])
    }
}
