//! Generalised Maxwell slip: parallel spring-slip elements (Al-Bender, Lampaert and Swevers, "The generalized
//! Maxwell-slip model", IEEE Trans. Automatic Control 50, 2005).
//!
//! Their common level has a frictional lag and a Stribeck curve that by default is sharper than a Gaussian.

use super::Pressing;
use crate::joint_plant::parameters::Parameters;

/// Spring-slip elements of the seal.
const ELEMENTS: usize = 6;
/// Share of each element in the level, assumed. Weak elements slip first.
const LEVEL_SHARE: [f64; ELEMENTS] = [0.10, 0.13, 0.16, 0.18, 0.20, 0.23];
/// Share of each element in the stiffness, assumed. Stiff elements slip first.
const STIFFNESS_SHARE: [f64; ELEMENTS] = [0.30, 0.25, 0.18, 0.13, 0.09, 0.05];

/// State of a spring-slip element.
#[derive(Clone, Copy, Debug, Default)]
struct Element {
    torque: f64,
    slips: bool,
}

/// The elements.
#[derive(Clone, Debug)]
pub struct MaxwellSlip {
    elements: [Element; ELEMENTS],
    /// Exponent of the Stribeck curve.
    pub stribeck_exponent: f64,
}

impl Default for MaxwellSlip {
    fn default() -> Self {
        Self { elements: [Element::default(); ELEMENTS], stribeck_exponent: 1.0 }
    }
}

impl MaxwellSlip {
    /// Integrates by `dt` (s) and returns the torque, Nm.
    pub fn step(
        &mut self,
        p: &Parameters,
        pressing: &Pressing,
        velocity: f64,
        sheared: f64,
        dt: f64,
    ) -> f64 {
        let speed = velocity.abs() / p.stribeck_velocity_rad_s;
        let stribeck = match self.stribeck_exponent {
            1.0 => (-speed).exp(),
            exponent => (-speed.powf(exponent)).exp(),
        };
        let level = pressing.unit_nm
            * (p.friction_kinetic + (p.friction_static - p.friction_kinetic) * stribeck)
            * pressing.factor
            + pressing.raised_nm;
        let held = self.advance(p, sheared, level, dt);
        let damping = p.presliding_damping_nm_s_per_rad * stribeck * velocity;
        held + damping
    }

    /// Advances the elements by `dt` (s). Returns their total torque, Nm.
    fn advance(&mut self, p: &Parameters, velocity: f64, level: f64, dt: f64) -> f64 {
        let direction = if velocity < 0.0 { -1.0 } else { 1.0 };
        let mut held = 0.0;
        for (index, element) in self.elements.iter_mut().enumerate() {
            let element_level = LEVEL_SHARE[index] * level;
            if element.slips && element.torque * direction < 0.0 {
                element.slips = false;
            }
            if element.slips {
                let pull = LEVEL_SHARE[index] - element.torque * direction / level;
                element.torque += dt * direction * p.attraction_nm_per_s * pull;
            } else {
                let stiffness = STIFFNESS_SHARE[index] * p.presliding_stiffness_nm_per_rad;
                element.torque += dt * stiffness * velocity;
                element.slips = element.torque * direction >= element_level;
                if element.slips {
                    // An element that exceeds its level within the step is limited to it.
                    element.torque = direction * element_level;
                }
            }
            held += element.torque;
        }
        held
    }
}
