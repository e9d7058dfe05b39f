//! LuGre under side load and pressure (Ding et al., eq. 16).

use super::bristle;
use super::interface::*;
use crate::effect::SealEffect;

/// Coefficients of the law for one sample period.
#[derive(Clone, Copy, Debug)]
pub struct ImprovedLugre<T> {
    /// The bristles.
    pub bristles: Bristles<T>,
    /// Effect of side load and pressure on the bristles.
    pub load: SealLoad<T>,
}

/// Coefficients of side load and pressure in the improved LuGre law.
#[derive(Clone, Copy, Debug)]
pub struct SealLoad<T> {
    /// Side load on `F_C`, Nm/N.
    pub radial_force_coulomb: T,
    /// Side load on `F_S`, Nm/N.
    pub radial_force_static: T,
    /// Pressure on `F_C`, Nm/MPa.
    pub pressure_coulomb: T,
    /// Pressure on `F_S`, Nm/MPa.
    pub pressure_static: T,
    /// Bristle rate for a change of the side load by 1 N within a sample, `eta3/dt`, rad/s.
    pub rate_per_newton: T,
}

impl<T: Real> SealLoad<T> {
    /// Returns the effect of side load and pressure in this sample.
    #[inline(always)]
    pub fn effect(&self, sample: &Sample<T>) -> SealEffect<T> {
        let (force, pressure) = (sample.radial_force_n, sample.pressure_diff_mpa);
        SealEffect {
            coulomb: self.radial_force_coulomb * force + self.pressure_coulomb * pressure,
            static_level: self.radial_force_static * force + self.pressure_static * pressure,
            bristle_rate: self.rate_per_newton * sample.radial_force_change_n,
        }
    }
}

/// Effect of side load and pressure in a model without terms.
///
/// Each product is added to the level directly, because multiply-add is one instruction. In a model with
/// terms, [`SealEffect`] holds the sum of the products instead, so that terms can add to it.
struct SealLoadEffect<'a, T> {
    load: &'a SealLoad<T>,
    sample: &'a Sample<T>,
}

impl<T: Real> Effect<T> for SealLoadEffect<'_, T> {
    #[inline(always)]
    fn coulomb(&self, base: T) -> T {
        base.plus_product(self.load.radial_force_coulomb, self.sample.radial_force_n)
            .plus_product(self.load.pressure_coulomb, self.sample.pressure_diff_mpa)
    }
    #[inline(always)]
    fn static_level(&self, base: T) -> T {
        base.plus_product(self.load.radial_force_static, self.sample.radial_force_n)
            .plus_product(self.load.pressure_static, self.sample.pressure_diff_mpa)
    }
    #[inline(always)]
    fn carried(&self, bristle_torque: T, stiffness_step: T) -> T {
        let load_rate = self.load.rate_per_newton * self.sample.radial_force_change_n;
        bristle_torque + stiffness_step * load_rate
    }
    #[inline(always)]
    fn bristle_rate(&self, rate: T) -> T {
        rate + self.load.rate_per_newton * self.sample.radial_force_change_n
    }
}

impl<T: Real> FrictionLaw<T> for ImprovedLugre<T> {
    const PARAMETERS: &'static [Id] = &[
        Id::CoulombTorque,
        Id::StaticTorque,
        Id::StribeckVelocity,
        Id::BristleStiffness,
        Id::BristleDamping,
        Id::ViscousFriction,
        Id::RadialForceCoulomb,
        Id::RadialForceStaticExcess,
        Id::PressureCoulomb,
        Id::PressureStaticExcess,
        Id::RadialForceRate,
    ];

    const HAS_SEAL_LOAD: bool = true;

    type Memory = ();

    fn build(written: &LawParameters<T::Setting>, period_s: T::Setting) -> Self {
        let setting = |id| written.values.get(id);
        let mega = T::Setting::from_f64(1e6);
        let load = SealLoad {
            radial_force_coulomb: T::from_setting(setting(Id::RadialForceCoulomb)),
            radial_force_static: T::from_setting(
                setting(Id::RadialForceCoulomb) + setting(Id::RadialForceStaticExcess),
            ),
            pressure_coulomb: T::from_setting(setting(Id::PressureCoulomb) * mega),
            pressure_static: T::from_setting(
                (setting(Id::PressureCoulomb) + setting(Id::PressureStaticExcess)) * mega,
            ),
            rate_per_newton: T::from_setting(setting(Id::RadialForceRate) / period_s),
        };
        Self { bristles: Bristles::build(written, period_s), load }
    }

    fn rescale_period(&mut self, of: &Self, ratio: T) {
        self.bristles.rescale_period(&of.bristles, ratio);
        self.load.rate_per_newton = of.load.rate_per_newton / ratio;
    }

    fn scale_levels(&mut self, level: T, viscous: T) {
        self.bristles.scale_levels(level, viscous);
        let load = &mut self.load;
        load.radial_force_coulomb = load.radial_force_coulomb * level;
        load.radial_force_static = load.radial_force_static * level;
        load.pressure_coulomb = load.pressure_coulomb * level;
        load.pressure_static = load.pressure_static * level;
    }

    #[inline(always)]
    fn velocity_limit(&self) -> T {
        self.bristles.velocity_limit
    }

    fn sliding_torque(&self) -> T {
        self.bristles.coulomb
    }

    #[inline(always)]
    fn step<E: Effect<T>>(&self, _: &mut T, (): &mut (), _: T, _: &E) -> Step<'_, T> {
        Step::of(&self.bristles)
    }

    #[inline(always)]
    fn step_alone(&self, held: &mut T, (): &mut (), sample: &Sample<T>) -> Step<'_, T> {
        let effect = SealLoadEffect { load: &self.load, sample };
        Step::Done(self.bristles.step(held, sample.velocity_rad_s, &effect))
    }

    #[inline(always)]
    fn load(&self, sample: &Sample<T>, effects: &mut Effects<T>) {
        effects.seal = self.load.effect(sample);
    }

    fn check<N: Real, S: Real>(
        written: &LawParameters<S>,
        range: &LawRange,
    ) -> Result<f32, ParameterError> {
        bristle::check::<N, S>(written, range, written.values.single(Id::BristleDamping))
    }
}
