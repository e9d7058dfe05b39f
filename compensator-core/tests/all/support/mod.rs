//! An independent reference for the tests of the core.
//!
//! The reference is a separate implementation of LuGre. Its state is the bristle deflection `z` instead of the torque.
//! It uses the exponential instead of a table, and Runge-Kutta at 1 us instead of one step per sample. The module
//! [`schemes`] has two alternative integration schemes for comparison. [`Seal::parameters`] converts the same values
//! for the core.

#![allow(dead_code)] // Without terms, only a part is used.

pub mod cases;
pub mod motion;
#[cfg(feature = "network")]
pub mod network;
pub mod schemes;

use compensator_core::{LawKind, ParameterId as Id, Parameters, Real};

/// A seal, with the parameters of Ding et al., eq. 1 and 16, in SI units.
#[derive(Clone, Copy, Debug)]
pub struct Seal {
    pub coulomb: f64,
    pub static_level: f64,
    pub stribeck_velocity: f64,
    pub stiffness: f64,
    /// `sigma1` at rest, Nm s/rad. It fades as `exp(-(v/v_s)^2)`.
    pub damping: f64,
    pub viscous: f64,
    pub coulomb_per_newton: f64,
    pub static_per_newton: f64,
    pub coulomb_per_pascal: f64,
    pub static_per_pascal: f64,
    /// Bending of the bristles per side load, `eta3`, rad/N.
    pub bend_per_newton: f64,
}

/// Inputs of the seal at one time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Input {
    pub velocity: f64,
    pub radial_force: f64,
    pub radial_force_rate: f64,
    pub pressure_pa: f64,
}

impl Seal {
    /// A joint like that of Ding et al.: friction of 2 to 3.5 Nm under load.
    pub const JOINT: Seal = Seal {
        coulomb: 1.5,
        static_level: 2.2,
        stribeck_velocity: 0.1,
        stiffness: 1e4,
        damping: 30.0,
        viscous: 0.08,
        coulomb_per_newton: 0.008,
        static_per_newton: 0.01,
        coulomb_per_pascal: 2.4e-6,
        static_per_pascal: 3.0e-6,
        bend_per_newton: 1e-6,
    };

    /// Returns the friction level `g`, Nm.
    pub fn level(&self, input: &Input) -> f64 {
        let coulomb = self.coulomb
            + self.coulomb_per_newton * input.radial_force
            + self.coulomb_per_pascal * input.pressure_pa;
        let static_level = self.static_level
            + self.static_per_newton * input.radial_force
            + self.static_per_pascal * input.pressure_pa;
        coulomb + (static_level - coulomb) * self.stribeck_share(input.velocity)
    }

    fn stribeck_share(&self, velocity: f64) -> f64 {
        (-(velocity / self.stribeck_velocity).powi(2)).exp()
    }

    /// Returns the deflection rate `dz/dt`, rad/s.
    pub fn deflection_rate(&self, deflection: f64, input: &Input) -> f64 {
        let slip = self.stiffness * input.velocity.abs() * deflection / self.level(input);
        input.velocity - slip + self.bend_per_newton * input.radial_force_rate
    }

    /// Returns the friction `F`, Nm, for the deflection `z` (rad) and its rate (rad/s).
    pub fn friction(&self, deflection: f64, rate: f64, input: &Input) -> f64 {
        let damping = self.damping * self.stribeck_share(input.velocity);
        self.stiffness * deflection + damping * rate + self.viscous * input.velocity
    }

    /// Returns the same seal without the effects of load and pressure.
    pub fn unloaded(self) -> Seal {
        Seal {
            coulomb_per_newton: 0.0,
            static_per_newton: 0.0,
            coulomb_per_pascal: 0.0,
            static_per_pascal: 0.0,
            bend_per_newton: 0.0,
            ..self
        }
    }

    /// Returns the same values as parameters of the core.
    pub fn parameters<S: Real>(&self, law: LawKind) -> Parameters<S> {
        let mut parameters = Parameters::<S>::new(law);
        for (id, value) in [
            (Id::CoulombTorque, self.coulomb),
            (Id::StaticTorque, self.static_level),
            (Id::StribeckVelocity, self.stribeck_velocity),
            (Id::BristleStiffness, self.stiffness),
            (Id::BristleDamping, self.damping),
            (Id::ViscousFriction, self.viscous),
            (Id::RadialForceCoulomb, self.coulomb_per_newton),
            (Id::RadialForceStaticExcess, self.static_per_newton - self.coulomb_per_newton),
            (Id::PressureCoulomb, self.coulomb_per_pascal),
            (Id::PressureStaticExcess, self.static_per_pascal - self.coulomb_per_pascal),
            (Id::RadialForceRate, self.bend_per_newton),
        ] {
            parameters.set(id, S::from_f64(value));
        }
        parameters.choices.damping_fades = true;
        parameters
    }
}
