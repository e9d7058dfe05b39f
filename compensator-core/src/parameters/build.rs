//! Building a model for a sample period.
//!
//! Everything that can be divided, multiplied or looked up once is, so that the step has one
//! division. For [`crate::number::Fixed`] the build also proves that no coefficient and no product
//! of the step can leave the number's range within the envelope, which is why the step itself need
//! not check.

use super::validate::refuse;
use super::{Bound, LawKind, ParameterError, ParameterId, Parameters};
use crate::curve;
use crate::law::bristle::{AsymmetricLugre, Lugre, STRIBECK_END};
use crate::law::steady::{Shape, Steady};
use crate::model::{Law, Model, SealLoad};
use crate::number::Real;
#[cfg(feature = "terms")]
use crate::term::{DELAY_LINE, Term, TermKind};
use ParameterId as Id;

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
        #[cfg(not(feature = "terms"))]
        if let Some(term) = self.terms.first() {
            refuse(term.name(), 1.0, Bound::AtMost(0.0), "built without the feature `terms`")?;
        }
        let model = Model {
            law: self.build_law(period_s),
            #[cfg(feature = "terms")]
            terms: self.terms.iter().map(|kind| Term::build(*kind, self, period_s)).collect(),
        };
        self.check_range(&model, period)?;
        Ok(model)
    }

    /// The same, without any check: for a fit, whose steps may pass through illegal values on
    /// their way to legal ones.
    pub fn build_unchecked<T: Real<Setting = S>>(&self, period_s: S) -> Model<T> {
        Model {
            law: self.build_law(period_s),
            #[cfg(feature = "terms")]
            terms: self.terms.iter().map(|kind| Term::build(*kind, self, period_s)).collect(),
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
        let fits = |field, value: f64| {
            if T::represents(value) {
                return Ok(());
            }
            let why = "the number type cannot hold this coefficient to 1e-3 of its value";
            refuse(field, value, Bound::Finite, why)
        };
        let e = &self.envelope;
        let speed = f64::from(e.velocity_max_rad_s);
        fits("velocity_max_rad_s", speed)?;
        for id in [Id::CoulombTorque, Id::ViscousFriction] {
            fits(id.name(), value(id))?;
        }
        fits("viscous_friction * velocity_max", value(Id::ViscousFriction) * speed)?;
        if let Law::Steady(Steady { shape: Shape::Extended { .. }, .. }) = model.law {
            fits(Id::QuadraticFriction.name(), value(Id::QuadraticFriction) * speed * speed)?;
            fits(Id::CubicFriction.name(), value(Id::CubicFriction) * speed * speed * speed)?;
        }
        if self.law.has_stribeck_curve() {
            fits(Id::StaticTorque.name(), value(Id::StaticTorque))?;
            let cells = curve::CELLS_PER_STRIBECK_VELOCITY / value(Id::StribeckVelocity);
            fits("16 / stribeck_velocity", cells)?;
        }
        if self.law.has_bristles() {
            let step = value(Id::BristleStiffness) * period;
            fits("bristle_stiffness * sample_period", step)?;
            let level = self.largest_level();
            fits("level * velocity_max", level * speed)?;
            // The numerator of the rate is at most twice level times speed, its denominator at
            // least the smallest level; the bristle's rate is below 1 + level/coulomb of the speed.
            fits("bristle_stiffness * sample_period * velocity_max", step * speed + level)?;
            let rate = speed * (1.0 + level / value(Id::CoulombTorque).max(1e-9));
            fits("bristle_stiffness * sample_period * bristle rate", step * rate)?;
            fits("bristle_damping * bristle rate", value(Id::BristleDamping) * rate)?;
        }
        if let Law::Improved(..) = &model.law {
            fits(Id::RadialForceCoulomb.name(), value(Id::RadialForceCoulomb))?;
            fits("pressure_coulomb, Nm/MPa", value(Id::PressureCoulomb) * 1e6)?;
            fits("radial_force_rate / sample_period", value(Id::RadialForceRate) / period)?;
        }
        #[cfg(feature = "terms")]
        self.check_terms::<T>(period)?;
        Ok(())
    }

    /// The highest level load and pressure can raise within the envelope, Nm.
    fn largest_level(&self) -> f64 {
        let value = |id: Id| self.get(id).value();
        let e = &self.envelope;
        let force = value(Id::RadialForceCoulomb) + value(Id::RadialForceStaticExcess);
        let pressure = value(Id::PressureCoulomb) + value(Id::PressureStaticExcess);
        let mut level = value(Id::CoulombTorque).max(value(Id::StaticTorque));
        level += force.max(0.0) * f64::from(e.radial_force_max_n);
        level += pressure.max(0.0) * f64::from(e.pressure_diff_max_pa);
        level
    }

    #[cfg(feature = "terms")]
    fn check_terms<T: Real>(&self, period: f64) -> Result<(), ParameterError> {
        if self.terms.contains(&TermKind::ChannelDelay) {
            let longest = (DELAY_LINE - 2) as f64 * period;
            let delay = self.get(Id::ChannelDelay).value();
            if delay > longest {
                let why = "the delay line holds 31 samples";
                return refuse(Id::ChannelDelay.name(), delay, Bound::AtMost(longest), why);
            }
        }
        for kind in &self.terms {
            // Built in the number of the settings, which has the range, and held against T's.
            let term = Term::<S>::build(*kind, self, S::from_f64(period));
            let largest = term.largest_product(&self.envelope);
            let why = "the number type cannot hold what this term computes within the envelope";
            for value in term.coefficients().map(Real::value) {
                if !T::represents(value) {
                    return refuse(kind.name(), value, Bound::Finite, why);
                }
            }
            if !T::represents(largest) {
                return refuse(kind.name(), largest, Bound::Finite, why);
            }
        }
        Ok(())
    }
}
