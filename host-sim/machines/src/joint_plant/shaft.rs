//! Transmission of a side load at the end of the shaft to the seal: a bent beam with an elastic ring.
//!
//! Ding et al., eq. 11-15, derived independently for this package. The bearings have a span `b`. The ring is at `o` and
//! the load at `l` beyond the outer bearing. Without the ring, the load bends the shaft at the ring by
//! `o (3 o l + 2 l b - o^2) / (6 E I)` per newton. The ring of radial stiffness `k` reduces this by
//! `o^2 (b + o) / (3 E I)` per newton of its own force.
//!
//! The remaining displacement times `k` presses one side of the ring. The contact pressure is a cosine over half of the
//! circumference, so the normal force for friction is `4 / pi` of it.

use super::parameters::Parameters;
use std::f64::consts::PI;

/// Geometry factors for a simulation step.
#[derive(Clone, Copy, Debug)]
pub struct Shaft {
    /// Radial displacement at the ring per side load, m/N.
    pub displacement_per_load_m_per_n: f64,
    /// Normal force for friction per side load, N/N.
    pub normal_per_load: f64,
    /// Contact area of the ring, m^2.
    pub contact_area_m2: f64,
}

impl Shaft {
    /// Computes the factors from the parameters.
    pub fn of(p: &Parameters) -> Self {
        let stiffness = p.shaft_modulus_pa * PI / 4.0 * p.shaft_radius_m.powi(4);
        let (o, l, b) = (p.seal_overhang_m, p.load_overhang_m, p.bearing_span_m);
        let by_load = o * (3.0 * o * l + 2.0 * l * b - o * o) / (6.0 * stiffness);
        let by_ring = o * o * (b + o) / (3.0 * stiffness);
        // A thin ring, compressed over its thickness.
        let ring = PI * p.seal_width_m * p.seal_modulus_pa * p.shaft_radius_m / p.seal_thickness_m;
        let displacement = by_load / (1.0 + ring * by_ring);
        Self {
            displacement_per_load_m_per_n: displacement,
            normal_per_load: 4.0 / PI * ring * displacement,
            contact_area_m2: 2.0 * PI * p.shaft_radius_m * p.seal_width_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shaft_with_soft_ring_bends_as_free_beam() {
        let p = Parameters::default();
        let free = Shaft::of(&Parameters { seal_modulus_pa: 1.0, ..p });
        let (o, l, b) = (0.030, 0.150, 0.025);
        let stiffness = 1.93e11 * PI / 4.0 * 0.0125f64.powi(4);
        // Overhanging beam by superposition: deflection of a cantilever plus rotation by the slope of the span.
        let cantilever = (l * o * o / 2.0 - o * o * o / 6.0) / stiffness;
        let turned = o * l * b / (3.0 * stiffness);
        let beam = cantilever + turned;
        assert!((free.displacement_per_load_m_per_n / beam - 1.0).abs() < 1e-6);
        let real = Shaft::of(&p);
        assert!(real.displacement_per_load_m_per_n < beam);
        // The force on the ring is in the order of the load times the lever ratio.
        assert!((0.5..3.0).contains(&real.normal_per_load), "{}", real.normal_per_load);
    }
}
