//! The seal of the published model (Ding et al., eq. 16 with the corrections).
//!
//! ```text
//! z' = v - k0 |v| z / g(v) + eta3 dF_L/dt
//! F  = k0 z + k1 z' + k2 v
//! g  = F_C' + (F_S' - F_C') exp(-(v/v_s)^2)
//! ```
//!
//! Side load and pressure raise both levels equally. In the paper, the absolute value is missing and only `F_C` depends
//! on the load. `tests/seal_equation.rs` integrates the equation by Runge-Kutta steps, for comparison.

use serde_json::{Value, json};

/// True parameters of the seal, SI units, with the names of the paper.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seal {
    /// Bristle stiffness, Nm/rad.
    pub k0: f64,
    /// Bristle damping, Nm s/rad.
    pub k1: f64,
    /// Viscous coefficient, Nm s/rad.
    pub k2: f64,
    /// Coulomb torque, Nm.
    pub coulomb_nm: f64,
    /// Static torque, Nm.
    pub static_nm: f64,
    /// Stribeck velocity, rad/s.
    pub stribeck_rad_s: f64,
    /// Levels per pressure difference, Nm/Pa.
    pub per_pressure: f64,
    /// Levels per side load, Nm/N.
    pub per_force: f64,
    /// Bristle travel per side load, rad/N.
    pub eta3: f64,
}

impl Seal {
    /// Returns the parameters without the effects of load and pressure, for `truth.json`.
    pub(crate) fn json(&self) -> Value {
        let quantity = |value: f64, unit: &str| json!({"value": value, "unit": unit});
        json!({
            "coulomb_torque": quantity(self.coulomb_nm, "Nm"),
            "static_torque": quantity(self.static_nm, "Nm"),
            "stribeck_velocity": quantity(self.stribeck_rad_s, "rad/s"),
            "bristle_stiffness": quantity(self.k0, "Nm/rad"),
            "bristle_damping": quantity(self.k1, "Nm s/rad"),
            "viscous_friction": quantity(self.k2, "Nm s/rad"),
        })
    }
}
