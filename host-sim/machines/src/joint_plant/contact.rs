//! Contact of the seal with its shaft: the part of the friction that depends on the history of the motion.
//!
//! There are three families, each with its own equations. A model that fits one of them is not built from it:
//!
//! - `maxwell_slip`: parallel spring-slip elements whose level follows the speed with a lag,
//! - `rate_and_state`: a spring and an interface whose strength is that of its age,
//! - `iwan`: a continuous distribution of sliders whose strength falls as a film builds up.
//!
//! Every family is dissipative: no motion recovers more energy than it has put in.

mod iwan;
mod maxwell_slip;
mod rate_and_state;

use super::parameters::Parameters;
use iwan::Iwan;
use maxwell_slip::MaxwellSlip;
use rate_and_state::RateAndState;

/// Family of the friction of the contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrictionFamily {
    /// Parallel spring-slip elements with a frictional lag.
    #[default]
    MaxwellSlip,
    /// Rate-and-state friction with an elastic contact.
    RateAndState,
    /// Iwan's distribution of sliders with mixed lubrication.
    Iwan,
}

impl FrictionFamily {
    /// All families.
    pub const ALL: [Self; 3] = [Self::MaxwellSlip, Self::RateAndState, Self::Iwan];

    /// Returns the name of the family.
    pub const fn name(self) -> &'static str {
        match self {
            Self::MaxwellSlip => "maxwell-slip",
            Self::RateAndState => "rate-and-state",
            Self::Iwan => "iwan",
        }
    }

    /// Returns the family with this name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|family| family.name() == name)
    }
}

/// How the contact is pressed and lubricated in a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pressing {
    /// Torque per unit of the friction coefficient, Nm.
    pub unit_nm: f64,
    /// Factor of the level, and addition to it, Nm.
    pub factor: f64,
    pub raised_nm: f64,
    /// Viscosity of the film relative to that at 20 deg C.
    pub viscosity: f64,
}

/// A contact and its state.
#[derive(Clone, Debug)]
pub(super) enum Contact {
    MaxwellSlip(MaxwellSlip),
    RateAndState(RateAndState),
    Iwan(Iwan),
}

impl Contact {
    /// Creates a contact at rest. `unit_nm` is the torque per unit of the friction coefficient without side load and
    /// pressure.
    pub fn new(family: FrictionFamily, p: &Parameters, unit_nm: f64) -> Self {
        match family {
            FrictionFamily::MaxwellSlip => Self::MaxwellSlip(MaxwellSlip::default()),
            FrictionFamily::RateAndState => Self::RateAndState(RateAndState::new(p, unit_nm)),
            FrictionFamily::Iwan => Self::Iwan(Iwan::new(p, unit_nm)),
        }
    }

    /// Sets the exponent of the Stribeck curve. Only [`FrictionFamily::MaxwellSlip`] has one.
    pub fn set_stribeck_exponent(&mut self, exponent: f64) {
        if let Self::MaxwellSlip(elements) = self {
            elements.stribeck_exponent = exponent;
        }
    }

    /// Integrates by `dt` (s) at a velocity of the joint and a velocity that shears the contact, rad/s. Returns the
    /// torque, Nm.
    pub fn step(
        &mut self,
        p: &Parameters,
        pressing: &Pressing,
        velocity: f64,
        sheared: f64,
        dt: f64,
    ) -> f64 {
        match self {
            Self::MaxwellSlip(contact) => contact.step(p, pressing, velocity, sheared, dt),
            Self::RateAndState(contact) => {
                let level =
                    pressing.unit_nm * p.friction_kinetic * pressing.factor + pressing.raised_nm;
                contact.step(level, sheared, dt)
            }
            Self::Iwan(contact) => contact.step(p, pressing, sheared, dt),
        }
    }
}

#[cfg(test)]
#[path = "contact_tests.rs"]
mod tests;
