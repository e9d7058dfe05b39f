//! Building a model for a sample period.
//!
//! Everything that can be divided, multiplied or looked up once is, so that the step has one
//! division. For [`crate::number::Fixed`] the build also proves that no coefficient and no product
//! of the step can leave the number's range within the envelope, which is why the step itself need
//! not check.

use super::{Bound, LawKind, ParameterError, ParameterId, Parameters};
use crate::curve;
use crate::fits::{coefficient, product};
use crate::law::bristle::{AsymmetricLugre, Lugre, STRIBECK_END};
use crate::law::steady::{Shape, Steady};
use crate::model::{Law, Model, SealLoad};
use crate::number::Real;
use crate::refusal::refuse;
use crate::term::bounds::Bounds;
use crate::term::{Terms, check};
use ParameterId as Id;
use core::f64::consts::FRAC_PI_2;

/// Largest `sigma0 dt`; the step is stable for any, but beyond this a float's square overflows.
const STIFFNESS_STEP_MAX: f64 = 1e15;

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
        self.check_range(&model, period)?;
        Ok(model)
    }

    /// The same, without any check: for a fit, whose steps may pass through illegal values on
    /// their way to legal ones.
    pub fn build_unchecked<T: Real<Setting = S>>(&self, period_s: S) -> Model<T> {
        Model {
            law: self.build_law(period_s),
            terms: Terms::build(&self.terms, &self.values, period_s),
        }
    }

    fn build_law<T: Real<Setting = S>>(&self, period_s: S) -> Law<T> {
        let setting = |id| self.get(id);
        let number = |id| T::from_setting(setting(id));
        let velocity_limit = T::from_f64(f64::from(self.envelope.velocity_max_rad_s));
        let stribeck_end =
            || T::from_setting(setting(Id::StribeckVelocity) * S::from_f64(STRIBECK_END));
        let cells_per_velocity = || {
            let cells = S::from_f64(curve::CELLS_PER_STRIBECK_VELOCITY);
            T::from_setting(cells / setting(Id::StribeckVelocity))
        };
        let steady = |shape| {
            Law::Steady(Steady {
                coulomb: number(Id::CoulombTorque),
                viscous: number(Id::ViscousFriction),
                velocity_limit,
                shape,
            })
        };
        let lugre = || {
            let stiffness_step = setting(Id::BristleStiffness) * period_s;
            let (damping, damping_at_rest) = if self.choices.damping_fades {
                (T::zero(), number(Id::BristleDamping))
            } else {
                (number(Id::BristleDamping), T::zero())
            };
            Lugre {
                coulomb: number(Id::CoulombTorque),
                static_level: number(Id::StaticTorque),
                stribeck_end: stribeck_end(),
                cells_per_velocity: cells_per_velocity(),
                stiffness_step: T::from_setting(
                    stiffness_step.at_most(S::from_f64(STIFFNESS_STEP_MAX)),
                ),
                damping,
                damping_at_rest,
                viscous: number(Id::ViscousFriction),
                velocity_limit,
            }
        };
        match self.law {
            LawKind::Linear => steady(Shape::Linear),
            LawKind::Extended => steady(Shape::Extended {
                quadratic: number(Id::QuadraticFriction),
                cubic: number(Id::CubicFriction),
                printed: self.choices.printed_extended,
            }),
            LawKind::Atan => steady(Shape::Atan {
                offset: number(Id::TorqueOffset),
                torque: number(Id::AtanTorque),
                slope: number(Id::AtanSlope),
            }),
            LawKind::Stribeck => steady(Shape::Stribeck {
                static_level: number(Id::StaticTorque),
                stribeck_end: stribeck_end(),
                cells_per_velocity: cells_per_velocity(),
            }),
            LawKind::Dahl => Law::Lugre(Lugre {
                static_level: number(Id::CoulombTorque),
                damping: T::zero(),
                damping_at_rest: T::zero(),
                // At every speed as at rest: the Stribeck velocity is none of this law's
                // parameters and may be anything, NaN too.
                stribeck_end: T::zero(),
                cells_per_velocity: T::zero(),
                ..lugre()
            }),
            LawKind::Lugre => Law::Lugre(lugre()),
            LawKind::LugreAsymmetric => Law::Asymmetric(AsymmetricLugre {
                positive: lugre(),
                coulomb_negative: number(Id::CoulombTorqueNegative),
                static_level_negative: number(Id::StaticTorqueNegative),
            }),
            LawKind::ImprovedLugre => Law::Improved(lugre(), self.build_seal_load(period_s)),
        }
    }

    fn build_seal_load<T: Real<Setting = S>>(&self, period_s: S) -> SealLoad<T> {
        let setting = |id| self.get(id);
        let mega = S::from_f64(1e6);
        SealLoad {
            radial_force_coulomb: T::from_setting(setting(Id::RadialForceCoulomb)),
            radial_force_static: T::from_setting(
                setting(Id::RadialForceCoulomb) + setting(Id::RadialForceStaticExcess),
            ),
            pressure_coulomb: T::from_setting(setting(Id::PressureCoulomb) * mega),
            pressure_static: T::from_setting(
                (setting(Id::PressureCoulomb) + setting(Id::PressureStaticExcess)) * mega,
            ),
            rate_per_newton: T::from_setting(setting(Id::RadialForceRate) / period_s),
        }
    }

    fn check_range<T: Real<Setting = S>>(
        &self,
        model: &Model<T>,
        period: f64,
    ) -> Result<(), ParameterError> {
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
        match &model.law {
            Law::Steady(Steady { shape: Shape::Extended { .. }, .. }) => {
                let square = speed * speed;
                product::<T>(Id::QuadraticFriction.name(), value(Id::QuadraticFriction) * square)?;
                product::<T>(Id::CubicFriction.name(), value(Id::CubicFriction) * square * speed)?;
            }
            Law::Steady(Steady { shape: Shape::Atan { .. }, .. }) => {
                product::<T>("atan_slope * velocity_max", value(Id::AtanSlope) * speed)?;
                product::<T>(Id::AtanTorque.name(), value(Id::AtanTorque) * FRAC_PI_2)?;
            }
            _ => {}
        }
        let level = self.largest_level(&bounds);
        product::<T>("the largest level", level)?;
        if self.law.has_stribeck_curve() {
            let cells = curve::CELLS_PER_STRIBECK_VELOCITY / value(Id::StribeckVelocity);
            coefficient::<T>("16 / stribeck_velocity", cells)?;
            if bounds.bends_stribeck_curve {
                product::<T>("16 / stribeck_velocity * velocity_max", cells * speed)?;
            }
        }
        let mut torque = level + viscous + bounds.torque;
        if self.law.has_bristles() {
            torque += self.check_bristles::<T>(&bounds, period, speed, level)?;
        }
        product::<T>("the sum of all torques", torque)?;
        check::<T, S>(&self.terms, &self.values, &self.envelope, S::from_f64(period))
    }

    /// The products of a bristle step. The held torque is at most the largest level and what a
    /// jump of the side load adds to it; the numerator of the rate, level plus held torque times
    /// speed; and the rate, that over the smallest level, or over the stiffness step. Returns the
    /// largest torque of the damping, Nm.
    fn check_bristles<T: Real>(
        &self,
        bounds: &Bounds,
        period: f64,
        speed: f64,
        level: f64,
    ) -> Result<f64, ParameterError> {
        let value = |id: Id| self.get(id).value();
        let step = value(Id::BristleStiffness) * period;
        coefficient::<T>("bristle_stiffness * sample_period", step)?;
        let per_newton = bounds.travel_per_newton / period;
        coefficient::<T>("radial_force_rate / sample_period", per_newton)?;
        let bent = per_newton.abs() * f64::from(self.envelope.radial_force_max_n);
        product::<T>("radial_force_rate * radial_force_max / sample_period", bent)?;
        product::<T>("bristle_stiffness * radial_force_rate * radial_force_max", step * bent)?;
        let both = 2.0 * level + step * bent;
        product::<T>("level * velocity_max", both * speed)?;
        product::<T>("bristle_stiffness * sample_period * velocity_max", step * speed + level)?;
        let rate = (both * speed / self.smallest_level(bounds)).min(both / step);
        product::<T>("bristle rate", rate)?;
        let damping = if self.law.parameters().contains(&Id::BristleDamping) {
            value(Id::BristleDamping)
        } else {
            0.0
        };
        let damped = damping * (rate + bent);
        product::<T>("bristle_damping * bristle rate", damped)?;
        Ok(damped)
    }
}
