//! A friction model built for a sample period: one [`Sample`] in, one torque out.
//!
//! [`Model`] is immutable and swapped whole; [`State`] is what it remembers. The laws and terms it
//! is made of are in [`crate::law`] and [`crate::term`]; this module only puts them together.
//!
//! Units inside are chosen so that fixed point can hold them: pressure in MPa, campaign time in
//! hours. For a prismatic joint read m for rad and N for Nm throughout.

pub use crate::quantity::Sample;

use crate::effect::{Effect, Effects, NoEffect, SealEffect};
use crate::law::bristle::{AsymmetricLugre, Lugre};
use crate::law::steady::Steady;
use crate::number::Real;
use crate::term::{Memory, Terms};

/// What a model remembers between samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct State<T: Real> {
    /// Torque held by the bent bristles, `y = sigma0 z`, Nm.
    pub bristle_torque_nm: T,
    pub(crate) memory: Memory<T>,
}

impl<T: Real> State<T> {
    /// A model that holds this bristle torque, Nm.
    pub fn holding(bristle_torque_nm: T) -> Self {
        Self { bristle_torque_nm, memory: Memory::default() }
    }
}

/// How side load and pressure act in the improved LuGre law.
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
    /// What the seal does to the law in this sample.
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

/// The improved law's effect, added to the levels one product at a time: a product and a sum are
/// one instruction then. [`SealEffect`] is the sum, for terms to add to.
struct SealUnder<'a, T> {
    load: &'a SealLoad<T>,
    sample: &'a Sample<T>,
}

impl<T: Real> Effect<T> for SealUnder<'_, T> {
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
        let own_rate = self.load.rate_per_newton * self.sample.radial_force_change_n;
        bristle_torque + stiffness_step * own_rate
    }
    #[inline(always)]
    fn bristle_rate(&self, rate: T) -> T {
        rate + self.load.rate_per_newton * self.sample.radial_force_change_n
    }
}

/// A built law.
#[derive(Clone, Copy, Debug)]
pub enum Law<T> {
    /// improved-lugre; first, so that it is the first the step asks for.
    Improved(Lugre<T>, SealLoad<T>),
    /// dahl, lugre.
    Lugre(Lugre<T>),
    /// lugre-asymmetric.
    Asymmetric(AsymmetricLugre<T>),
    /// linear, extended, atan, stribeck.
    Steady(Steady<T>),
}

impl<T: Real> Law<T> {
    /// The speed velocity is limited to, rad/s.
    pub fn velocity_limit(&self) -> T {
        match self {
            Law::Steady(law) => law.velocity_limit,
            Law::Lugre(law) | Law::Improved(law, _) => law.velocity_limit,
            Law::Asymmetric(law) => law.positive.velocity_limit,
        }
    }
}

/// A friction model built for a sample period; see [`crate::parameters::Parameters::build`].
#[derive(Clone, Debug)]
pub struct Model<T: Real> {
    pub(crate) law: Law<T>,
    pub(crate) terms: Terms<T>,
}

impl<T: Real> Model<T> {
    /// The law without its terms.
    pub fn law(&self) -> &Law<T> {
        &self.law
    }

    /// A copy for a sample period `ratio` times as long; see [`Model::rescale_period`].
    pub fn rescaled(&self, ratio: T) -> Self {
        let mut rescaled = self.clone();
        rescaled.rescale_period(self, ratio);
        rescaled
    }

    /// Becomes `of` for a sample period `ratio` times as long: for logs whose samples are unevenly
    /// spaced. `self` is to be a copy of `of`, or what an earlier call made of one; only what the period
    /// enters is written. `ratio` is positive.
    pub fn rescale_period(&mut self, of: &Self, ratio: T) {
        match (&mut self.law, &of.law) {
            (Law::Lugre(law), Law::Lugre(from)) => law.stiffness_step = from.stiffness_step * ratio,
            (Law::Asymmetric(law), Law::Asymmetric(from)) => {
                law.positive.stiffness_step = from.positive.stiffness_step * ratio;
            }
            (Law::Improved(law, seal), Law::Improved(from, from_seal)) => {
                law.stiffness_step = from.stiffness_step * ratio;
                seal.rate_per_newton = from_seal.rate_per_newton / ratio;
            }
            _ => {}
        }
        self.terms.rescale_period(&of.terms, ratio);
    }

    /// Whether the model is its law alone.
    pub fn is_plain(&self) -> bool {
        self.terms.is_empty()
    }

    /// Friction torque in this sample, Nm, positive where it has to be driven towards positive
    /// velocity; advances `state` by the sample period the model was built for.
    ///
    /// Defined for every bit pattern of the velocity. Other inputs are to be finite: the
    /// [`crate::compensator::Compensator`] sees to that.
    #[inline]
    pub fn step(&self, state: &mut State<T>, sample: &Sample<T>) -> T {
        if !self.terms.is_empty() {
            return self.step_with_terms(state, sample);
        }
        let bristle = &mut state.bristle_torque_nm;
        match &self.law {
            Law::Improved(law, load) => {
                law.step(bristle, sample.velocity_rad_s, &SealUnder { load, sample })
            }
            Law::Lugre(law) => law.step(bristle, sample.velocity_rad_s, &NoEffect),
            _ => self.step_other_law(bristle, sample),
        }
    }

    /// The laws no joint driver is tuned for, out of line: the arc tangent's call alone would make
    /// the others save and restore registers on every step.
    #[cold]
    #[inline(never)]
    fn step_other_law(&self, bristle: &mut T, sample: &Sample<T>) -> T {
        let velocity = sample.velocity_rad_s;
        match &self.law {
            Law::Lugre(law) | Law::Improved(law, _) => law.step(bristle, velocity, &NoEffect),
            Law::Asymmetric(law) => law.step(bristle, velocity, &NoEffect),
            Law::Steady(law) => law.torque(velocity, &NoEffect),
        }
    }

    #[inline(never)]
    fn step_with_terms(&self, state: &mut State<T>, sample: &Sample<T>) -> T {
        // Guarded before the terms see it: what is not a number must not enter their memory.
        let velocity = sample.velocity_rad_s.or_zero_if_nan().within(self.law.velocity_limit());
        let mut effects = Effects::none(velocity);
        if let Law::Improved(_, seal) = &self.law {
            effects.seal = seal.effect(sample);
        }
        self.terms.act(sample, &mut state.memory, &mut effects);
        let (bristle, velocity) = (&mut state.bristle_torque_nm, effects.velocity);
        let friction = match &self.law {
            Law::Lugre(law) | Law::Improved(law, _) => law.step(bristle, velocity, &effects),
            Law::Asymmetric(law) => law.step(bristle, velocity, &effects),
            Law::Steady(law) => law.torque(velocity, &effects),
        };
        friction + effects.torque
    }
}
