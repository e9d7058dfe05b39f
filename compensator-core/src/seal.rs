//! Computes a physical starting value of `eta3` from the geometry of shaft and seal (Ding et al., eq. 11-15).
//!
//! A side load `F_L` at the end of the shaft deflects it at the seal by `z_L` (eq. 11). The rubber seal ring
//! exerts a restoring force `F_O`, which reduces the deflection by `z_o`. Hence `z_r = z_L - z_o`; eq. 14 prints
//! a sum. The bearings are `l_b` apart. The seal is at `l_O` and the load at `l_L` beyond the outer bearing.
//! For an Euler-Bernoulli beam:
//!
//! ```text
//! z_L = F_L l_O (3 l_O l_L + 2 l_L l_b - l_O^2) / (6 E I)      eq. 11
//! z_o = F_O l_O^2 (l_b + l_O) / (3 E I)                        eq. 14; eq. 11 with l_L = l_O
//! F_O = k z_r,  k = pi B E_seal r / t                          eq. 12-13, see below
//! k_L = z_r / F_L = (z_L / F_L) / (1 + k z_o / F_O)            eq. 14, solved
//! eta3 = eta2 k_L                                              eq. 15-16
//! ```
//!
//! Eq. 12 uses an undefined angle `a`. Its second form is the distance from the bore's centre to the surface of
//! the displaced shaft at `theta`, which is `r - z_r cos(theta)` to first order. Eq. 13 defines the strain as
//! the change of this distance over the outer radius of the seal. It takes the area at the same radius, so the
//! radius cancels and `k = pi B E_seal`. In a thin ring, the strain refers to the thickness `t` and the area to
//! the shaft radius `r`. [`RadialStrain`] selects the definition.

use core::f64::consts::PI;

/// Reference length of the radial strain of the seal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RadialStrain {
    /// Thickness of the ring: `k = pi B E_seal r / t`.
    #[default]
    OverThickness,
    /// Outer radius, as printed in eq. 13: `k = pi B E_seal`.
    OverOuterRadius,
}

/// Geometry and materials of the shaft and its seal. All values are positive and in SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShaftAndSeal {
    /// `l_b`, distance between the bearings, m.
    pub bearing_span_m: f64,
    /// `l_O`, distance from the outer bearing to the seal, m.
    pub seal_overhang_m: f64,
    /// `l_L`, distance from the outer bearing to the load, m; at least `seal_overhang_m`.
    pub load_overhang_m: f64,
    /// `r`, radius of the shaft, m.
    pub shaft_radius_m: f64,
    /// `E_shaft`, Pa.
    pub shaft_modulus_pa: f64,
    /// `B`, width of the seal along the shaft, m.
    pub seal_width_m: f64,
    /// `t` (`R_seal`), radial thickness of the seal, m.
    pub seal_thickness_m: f64,
    /// `E_seal`, Pa.
    pub seal_modulus_pa: f64,
    /// `eta2`, circumferential bristle travel per radial displacement, rad/m.
    pub radial_to_bristle_rad_per_m: f64,
    /// Reference length of the radial strain of the seal.
    pub strain: RadialStrain,
}

impl ShaftAndSeal {
    /// Returns `E I` of a solid round shaft, N m^2.
    pub fn bending_stiffness_n_m2(&self) -> f64 {
        let radius_squared = self.shaft_radius_m * self.shaft_radius_m;
        self.shaft_modulus_pa * PI / 4.0 * radius_squared * radius_squared
    }

    /// Returns `z_L / F_L`: deflection at the seal per load at the shaft end, without the seal, m/N (eq. 11).
    pub fn load_compliance_m_per_n(&self) -> f64 {
        let (o, l, b) = (self.seal_overhang_m, self.load_overhang_m, self.bearing_span_m);
        o * (3.0 * o * l + 2.0 * l * b - o * o) / (6.0 * self.bending_stiffness_n_m2())
    }

    /// Returns `z_o / F_O`: deflection at the seal per seal force, m/N (eq. 14).
    pub fn seal_compliance_m_per_n(&self) -> f64 {
        let o = self.seal_overhang_m;
        o * o * (self.bearing_span_m + o) / (3.0 * self.bending_stiffness_n_m2())
    }

    /// Returns `k = F_O / z_r`, radial stiffness of the seal ring, N/m (eq. 13).
    pub fn seal_stiffness_n_per_m(&self) -> f64 {
        let printed = PI * self.seal_width_m * self.seal_modulus_pa;
        match self.strain {
            RadialStrain::OverOuterRadius => printed,
            RadialStrain::OverThickness => printed * self.shaft_radius_m / self.seal_thickness_m,
        }
    }

    /// Returns `k_L = z_r / F_L`: radial displacement at the seal per side load, m/N (eq. 14, solved).
    pub fn displacement_per_load_m_per_n(&self) -> f64 {
        self.load_compliance_m_per_n()
            / (1.0 + self.seal_stiffness_n_per_m() * self.seal_compliance_m_per_n())
    }

    /// Returns `eta3`, bristle travel per side load, rad/N (eq. 15-16).
    ///
    /// It is a starting value for [`crate::ParameterId::RadialForceRate`].
    pub fn radial_force_rate_rad_per_n(&self) -> f64 {
        self.radial_to_bristle_rad_per_m * self.displacement_per_load_m_per_n()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint() -> ShaftAndSeal {
        ShaftAndSeal {
            bearing_span_m: 0.04,
            seal_overhang_m: 0.012,
            load_overhang_m: 0.035,
            shaft_radius_m: 0.01,
            shaft_modulus_pa: 2.06e11,
            seal_width_m: 0.006,
            seal_thickness_m: 0.004,
            seal_modulus_pa: 1.0e7,
            radial_to_bristle_rad_per_m: 100.0,
            strain: RadialStrain::OverThickness,
        }
    }

    /// Returns the deflection at `x` of an overhanging beam loaded at `a`, m/N.
    ///
    /// It integrates `M/EI` twice from the outer bearing, independently of the closed forms above. The
    /// initial slope is that of the span between the bearings.
    fn integrated_deflection(shaft: &ShaftAndSeal, x: f64, a: f64) -> f64 {
        let stiffness = shaft.bending_stiffness_n_m2();
        let slope_at_bearing = a * shaft.bearing_span_m / (3.0 * stiffness);
        let steps = 20_000;
        let dx = x / f64::from(steps);
        let (mut slope, mut deflection) = (slope_at_bearing, 0.0);
        for step in 0..steps {
            let middle = (f64::from(step) + 0.5) * dx;
            let curvature = (a - middle) / stiffness;
            deflection += dx * (slope + 0.5 * dx * curvature);
            slope += dx * curvature;
        }
        deflection
    }

    #[test]
    fn shaft_compliances_match_numerical_integration() {
        let shaft = joint();
        let (seal, load) = (shaft.seal_overhang_m, shaft.load_overhang_m);
        let relative = |a: f64, b: f64| (a / b - 1.0).abs();
        let by_load = integrated_deflection(&shaft, seal, load);
        assert!(relative(shaft.load_compliance_m_per_n(), by_load) < 1e-6);
        let by_seal = integrated_deflection(&shaft, seal, seal);
        assert!(relative(shaft.seal_compliance_m_per_n(), by_seal) < 1e-6);
    }

    #[test]
    fn seal_stiffness_matches_numerical_integration_around_shaft() {
        let shaft = joint();
        let displacement = 1e-6;
        let steps = 3600;
        let force: f64 = (0..steps)
            .map(|step| {
                let theta = 2.0 * PI * (f64::from(step) + 0.5) / f64::from(steps);
                let (sin, cos) = theta.sin_cos();
                let r = shaft.shaft_radius_m;
                // eq. 12, second form, with the displacement along -cos.
                let surface =
                    (r * r - displacement * displacement * sin * sin).sqrt() + displacement * cos;
                let strain = (surface - r) / shaft.seal_thickness_m;
                let area = shaft.seal_width_m * r * 2.0 * PI / f64::from(steps);
                shaft.seal_modulus_pa * strain * area * cos
            })
            .sum();
        assert!((force / displacement / shaft.seal_stiffness_n_per_m() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn radial_force_rate_with_stiffer_seal_is_smaller() {
        let soft = joint();
        let stiff = ShaftAndSeal { seal_modulus_pa: 1e9, ..soft };
        let absent = ShaftAndSeal { seal_modulus_pa: 0.0, ..soft };
        assert!(stiff.radial_force_rate_rad_per_n() < soft.radial_force_rate_rad_per_n());
        assert_eq!(absent.displacement_per_load_m_per_n(), absent.load_compliance_m_per_n());
        let printed = ShaftAndSeal { strain: RadialStrain::OverOuterRadius, ..soft };
        assert_eq!(printed.seal_stiffness_n_per_m(), PI * 0.006 * 1.0e7);
    }
}
