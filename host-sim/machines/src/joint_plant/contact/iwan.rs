//! Iwan's parallel sliders with mixed lubrication: hysteresis with non-local memory, and a strength that falls with the
//! logarithm of the speed.
//!
//! - Iwan, "A distributed-element model for hysteresis and its steady-state dynamic response", J. Appl. Mech. 33 (1966).
//! - Segalman, "A four-parameter Iwan model for lap-type joints", J. Appl. Mech. 72 (2005): the strengths of the sliders
//!   have a density that is a power of the strength.
//! - Hersey, "The laws of lubrication of horizontal journal bearings", J. Wash. Acad. Sci. 4 (1914), and Stribeck (1902):
//!   friction is a function of viscosity times speed per load, from boundary contact to a film.
//! - Hess and Soom, "Friction at a lubricated line contact operating at oscillating sliding velocities", J. Tribology 112
//!   (1990): the film follows the speed with a lag.
//!
//! The stiffness of a slider is constant. A strength that falls takes elastic energy away, and one that grows adds none,
//! so that the contact is dissipative.

use super::Pressing;
use crate::joint_plant::parameters::Parameters;

/// Sliders of the discretised distribution.
const SLIDERS: usize = 12;
/// Exponent of the density of the strengths: micro-slip dissipates with the power 3 + exponent of the stroke.
const DENSITY_EXPONENT: f64 = -0.4;
/// Smallest travel of a slider relative to the largest.
const SHORTEST_TRAVEL: f64 = 0.04;
/// Exponent of the boundary contact over the Hersey number: it falls over three decades of speed.
const FILM_EXPONENT: f64 = 0.8;
/// Time in which the film builds up, and in which it is squeezed out, s.
const BUILD_UP_S: f64 = 0.03;
const SQUEEZE_S: f64 = 0.15;

/// The sliders and the film.
#[derive(Clone, Debug)]
pub struct Iwan {
    /// Share of each slider in the strength, and its stiffness, Nm/rad.
    strength: [f64; SLIDERS],
    stiffness: [f64; SLIDERS],
    torque: [f64; SLIDERS],
    /// Torque per unit of the friction coefficient of the reference load, Nm.
    reference_nm: f64,
    /// Share of the load that the film bears, 0 to 1.
    film: f64,
}

impl Iwan {
    /// Creates a contact at rest, without a film.
    pub fn new(p: &Parameters, unit_nm: f64) -> Self {
        let at = |edge: usize| SHORTEST_TRAVEL.powf(1.0 - edge as f64 / SLIDERS as f64);
        // Number of sliders in each bin of travel, and their mean travel.
        let moment = |power: f64, bin: usize| {
            let power = power + DENSITY_EXPONENT + 1.0;
            (at(bin + 1).powf(power) - at(bin).powf(power)) / power
        };
        let number: [f64; SLIDERS] = std::array::from_fn(|bin| moment(0.0, bin));
        let strength: [f64; SLIDERS] = std::array::from_fn(|bin| moment(1.0, bin));
        let (all, total): (f64, f64) = (number.iter().sum(), strength.iter().sum());
        Self {
            strength: strength.map(|share| share / total),
            stiffness: number.map(|share| share / all * p.presliding_stiffness_nm_per_rad),
            torque: [0.0; SLIDERS],
            reference_nm: unit_nm,
            film: 0.0,
        }
    }

    /// Returns the elastic energy, J.
    #[cfg(test)]
    pub fn energy_j(&self) -> f64 {
        self.torque.iter().zip(&self.stiffness).map(|(t, k)| 0.5 * t * t / k).sum()
    }

    /// Integrates by `dt` (s) and returns the torque, Nm.
    pub fn step(&mut self, p: &Parameters, pressing: &Pressing, velocity: f64, dt: f64) -> f64 {
        let speed = velocity.abs() / p.stribeck_velocity_rad_s;
        let hersey = pressing.viscosity * speed * self.reference_nm / pressing.unit_nm;
        let boundary = 1.0 / (1.0 + hersey.powf(FILM_EXPONENT));
        let borne = 1.0 - boundary;
        let time_s = if borne > self.film { BUILD_UP_S } else { SQUEEZE_S };
        self.film += dt / time_s * (borne - self.film);
        let excess = p.friction_static - p.friction_kinetic;
        let level =
            pressing.unit_nm * (p.friction_kinetic + excess * (1.0 - self.film)) * pressing.factor
                + pressing.raised_nm;
        let travel = velocity * dt;
        let mut held = 0.0;
        for ((torque, stiffness), share) in
            self.torque.iter_mut().zip(&self.stiffness).zip(&self.strength)
        {
            let most = share * level;
            *torque = (*torque + stiffness * travel).max(-most).min(most);
            held += *torque;
        }
        held
    }
}
