//! Building a model for a sample period.
//!
//! Everything that can be divided, multiplied or looked up once is, so that the step has one
//! division. For [`crate::number::Fixed`] the build also proves that no coefficient and no product
//! of the step can leave the number's range within the envelope, which is why the step itself need
//! not check.

use super::{Bound, ParameterError, ParameterId, Parameters};
use crate::curve;
use crate::fits::{coefficient, product};
use crate::law::{Law, Range, Written};
use crate::model::Model;
use crate::number::Real;
use crate::refusal::refuse;
use crate::term::{Terms, check};
use ParameterId as Id;

/// Why a sample period was refused.
pub type WrongPeriod = ParameterError;

impl<S: Real<Setting = S>> Parameters<S> {
    /// Validates the parameters and builds the model for a sample period in s.
    ///
    /// # Errors
    /// As [`Parameters::validate`]; also if the period is not a positive number, if a delay is
    /// longer than the delay line, or if the number type cannot hold a coefficient.
    pub fn build<T: Real<Setting = S>>(&self, period_s: S) -> Result<Model<T>, ParameterError> {
        self.validate()?;
        let period = period_s.value();
        if !(period.is_finite() && period > 0.0) {
            refuse("sample_period_s", period, Bound::MoreThan(0.0), "time moves on")?;
        }
        let model = self.build_unchecked(period_s);
        self.check_range::<T>(period)?;
        Ok(model)
    }

    /// The same, without any check: for a fit, whose steps may pass through illegal values on
    /// their way to legal ones.
    pub fn build_unchecked<T: Real<Setting = S>>(&self, period_s: S) -> Model<T> {
        Model {
            law: Law::build(self.law, &self.written(), period_s),
            terms: Terms::build(&self.terms, &self.values, period_s),
        }
    }

    fn written(&self) -> Written<'_, S> {
        Written { values: &self.values, choices: self.choices, envelope: &self.envelope }
    }

    fn check_range<T: Real<Setting = S>>(&self, period: f64) -> Result<(), ParameterError> {
        let value = |id: Id| self.get(id).value();
        let speed = f64::from(self.envelope.velocity_max_rad_s);
        coefficient::<T>("velocity_max_rad_s", speed)?;
        for id in self.law.parameters() {
            // These enter the step only together with something else, and are asked for there.
            let combined = [Id::BristleStiffness, Id::StribeckVelocity, Id::RadialForceRate];
            let per_pascal = [Id::PressureCoulomb, Id::PressureStaticExcess];
            if per_pascal.contains(id) {
                coefficient::<T>(id.name(), value(*id) * 1e6)?;
            } else if !combined.contains(id) {
                coefficient::<T>(id.name(), value(*id))?;
            }
        }
        let bounds = self.bounds();
        let viscous = self.largest_viscous(&bounds) * speed;
        product::<T>("viscous_friction * velocity_max", viscous)?;
        let level = self.largest_level(&bounds);
        product::<T>("the largest level", level)?;
        if self.law.has_stribeck_curve() {
            let cells = curve::CELLS_PER_STRIBECK_VELOCITY / value(Id::StribeckVelocity);
            coefficient::<T>("16 / stribeck_velocity", cells)?;
            if bounds.bends_stribeck_curve {
                product::<T>("16 / stribeck_velocity * velocity_max", cells * speed)?;
            }
        }
        let range = Range {
            period_s: period,
            speed,
            smallest_level: self.smallest_level(&bounds),
            largest_level: level,
            bounds: &bounds,
        };
        let of_law = self.law.check::<T, S>(&self.written(), &range)?;
        let torque = level + viscous + bounds.torque + of_law;
        product::<T>("the sum of all torques", torque)?;
        check::<T, S>(&self.terms, &self.values, &self.envelope, S::from_f64(period))
    }
}
