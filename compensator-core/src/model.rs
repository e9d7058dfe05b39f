//! A friction model built for a sample period: one [`Sample`] in, one torque out.
//!
//! [`Model`] is immutable and swapped whole; [`State`] is what it remembers. The laws and terms it
//! is made of are in [`crate::law`] and [`crate::term`]; this module only puts them together.
//!
//! Units inside are chosen so that fixed point can hold them: pressure in MPa, campaign time in
//! hours. For a prismatic joint read m for rad and N for Nm throughout.

#[cfg(feature = "terms")]
use crate::effect::Effects;
use crate::effect::{NoEffect, SealEffect};
use crate::law::bristle::{AsymmetricLugre, Lugre};
use crate::law::steady::Steady;
use crate::number::Real;
#[cfg(feature = "terms")]
use crate::term::{MAX_TERMS, Memory, Term};
#[cfg(feature = "terms")]
use heapless::Vec;

/// What a model is told in one sample. Everything not measured is left at its default.
#[derive(Clone, Copy, Debug)]
pub struct Sample<T> {
    /// Joint velocity, rad/s.
    pub velocity_rad_s: T,
    /// Joint position, rad.
    pub position_rad: T,
    /// How far the position is to be believed, 0..=1: scales what follows the angle.
    pub position_trust: T,
    /// Joint acceleration, rad/s^2.
    pub acceleration_rad_s2: T,
    /// Side load on the shaft at the seal's end, N.
    pub radial_force_n: T,
    /// Change of the side load since the last sample, N.
    pub radial_force_change_n: T,
    /// Outside minus inside pressure, MPa.
    pub pressure_diff_mpa: T,
    /// Temperature of the seal, deg C.
    pub temperature_c: T,
    /// Torque transmitted to the load, Nm.
    pub load_torque_nm: T,
    /// Time since the campaign (or the seal's life) began, h.
    pub campaign_time_h: T,
}

impl<T: Real> Default for Sample<T> {
    fn default() -> Self {
        let zero = T::zero();
        Self {
            velocity_rad_s: zero,
            position_rad: zero,
            position_trust: T::one(),
            acceleration_rad_s2: zero,
            radial_force_n: zero,
            radial_force_change_n: zero,
            pressure_diff_mpa: zero,
            temperature_c: zero,
            load_torque_nm: zero,
            campaign_time_h: zero,
        }
    }
}

/// What a model remembers between samples.
#[derive(Clone, Copy, Debug, Default)]
pub struct State<T: Real> {
    /// Torque held by the bent bristles, `y = sigma0 z`, Nm.
    pub bristle_torque_nm: T,
    #[cfg(feature = "terms")]
    pub(crate) memory: Memory<T>,
}

impl<T: Real> State<T> {
    /// A model that holds this bristle torque, Nm.
    pub fn holding(bristle_torque_nm: T) -> Self {
        Self {
            bristle_torque_nm,
            #[cfg(feature = "terms")]
            memory: Memory::default(),
        }
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

/// A built law.
#[derive(Clone, Copy, Debug)]
pub enum Law<T> {
    /// linear, extended, atan, stribeck.
    Steady(Steady<T>),
    /// dahl, lugre.
    Lugre(Lugre<T>),
    /// lugre-asymmetric.
    Asymmetric(AsymmetricLugre<T>),
    /// improved-lugre.
    Improved(Lugre<T>, SealLoad<T>),
}

/// A friction model built for a sample period; see [`crate::parameters::Parameters::build`].
#[derive(Clone, Debug)]
pub struct Model<T: Real> {
    pub(crate) law: Law<T>,
    #[cfg(feature = "terms")]
    pub(crate) terms: Vec<Term<T>, MAX_TERMS>,
}

impl<T: Real> Model<T> {
    /// The law without its terms.
    pub fn law(&self) -> &Law<T> {
        &self.law
    }

    /// Friction torque in this sample, Nm, positive where it has to be driven towards positive
    /// velocity; advances `state` by the sample period the model was built for.
    ///
    /// Defined for every bit pattern of the velocity. Other inputs are to be finite: the
    /// [`crate::compensator::Compensator`] sees to that.
    #[inline]
    pub fn step(&self, state: &mut State<T>, sample: &Sample<T>) -> T {
        #[cfg(feature = "terms")]
        if !self.terms.is_empty() {
            return self.step_with_terms(state, sample);
        }
        let (bristle, velocity) = (&mut state.bristle_torque_nm, sample.velocity_rad_s);
        match &self.law {
            Law::Lugre(law) => law.step(bristle, velocity, &NoEffect),
            Law::Improved(law, seal) => law.step(bristle, velocity, &seal.effect(sample)),
            Law::Asymmetric(law) => law.step(bristle, velocity, &NoEffect),
            Law::Steady(law) => law.torque(velocity, &NoEffect),
        }
    }

    #[cfg(feature = "terms")]
    #[inline(never)]
    fn step_with_terms(&self, state: &mut State<T>, sample: &Sample<T>) -> T {
        let mut effects = Effects::none(sample.velocity_rad_s);
        if let Law::Improved(_, seal) = &self.law {
            effects.seal = seal.effect(sample);
        }
        for term in &self.terms {
            term.act(sample, &mut state.memory, &mut effects);
        }
        let (bristle, velocity) = (&mut state.bristle_torque_nm, effects.velocity);
        let friction = match &self.law {
            Law::Lugre(law) | Law::Improved(law, _) => law.step(bristle, velocity, &effects),
            Law::Asymmetric(law) => law.step(bristle, velocity, &effects),
            Law::Steady(law) => law.torque(velocity, &effects),
        };
        friction + effects.torque
    }
}
