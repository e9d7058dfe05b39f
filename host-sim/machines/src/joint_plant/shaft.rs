//! How a side load at the shaft's end reaches the seal: a bent beam and a ring that pushes back.
//!
//! Ding et al., eq. 11-15, derived here for this package alone. Bearings a span `b` apart, the ring at `o` and the load at
//! `l` beyond the outer one. Without the ring the load bends the shaft at the ring by
//! `o (3 o l + 2 l b - o^2) / (6 E I)` per newton; the ring of radial stiffness `k` takes `o^2 (b + o) / (3 E I)` per
//! newton of its own force off again. What is left, times `k`, presses one side of the ring: the contact is a cosine
//! round the half, so the normal force that rubs is `4 / pi` of it.

use super::parameters::Parameters;
use std::f64::consts::PI;

/// What of the geometry a step needs.
#[derive(Clone, Copy, Debug)]
pub struct Shaft {
    displacement: f64,
    normal: f64,
    area: f64,
}

impl Shaft {
    /// From the table.
    pub fn of(p: &Parameters) -> Self {
        let stiffness = p.shaft_modulus_pa * PI / 4.0 * p.shaft_radius_m.powi(4);
        let (o, l, b) = (p.seal_overhang_m, p.load_overhang_m, p.bearing_span_m);
        let by_load = o * (3.0 * o * l + 2.0 * l * b - o * o) / (6.0 * stiffness);
        let by_ring = o * o * (b + o) / (3.0 * stiffness);
        // A thin ring, strained over its thickness.
        let ring = PI * p.seal_width_m * p.seal_modulus_pa * p.shaft_radius_m / p.seal_thickness_m;
        let displacement = by_load / (1.0 + ring * by_ring);
        Self {
            displacement,
            normal: 4.0 / PI * ring * displacement,
            area: 2.0 * PI * p.shaft_radius_m * p.seal_width_m,
        }
    }

    /// Radial displacement at the ring per side load, m/N.
    pub fn displacement_per_load_m_per_n(&self) -> f64 {
        self.displacement
    }

    /// Normal force that rubs, per side load.
    pub fn normal_per_load(&self) -> f64 {
        self.normal
    }

    /// Contact of the ring, m^2.
    pub fn contact_area_m2(&self) -> f64 {
        self.area
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_that_gives_way_leaves_the_beam_alone() {
        let p = Parameters::default();
        let free = Shaft::of(&Parameters { seal_modulus_pa: 1.0, ..p });
        let (o, l, b) = (0.030, 0.150, 0.025);
        let stiffness = 1.93e11 * PI / 4.0 * 0.0125f64.powi(4);
        // An overhanging beam by superposition: bent as a cantilever, and turned by the span's slope.
        let cantilever = (l * o * o / 2.0 - o * o * o / 6.0) / stiffness;
        let turned = o * l * b / (3.0 * stiffness);
        let beam = cantilever + turned;
        assert!((free.displacement_per_load_m_per_n() / beam - 1.0).abs() < 1e-6);
        let real = Shaft::of(&p);
        assert!(real.displacement_per_load_m_per_n() < beam);
        // The ring carries about what the lever makes of the load.
        assert!((0.5..3.0).contains(&real.normal_per_load()), "{}", real.normal_per_load());
    }
}
