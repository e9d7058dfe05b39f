//! Thermal model of the motor: a winding in a stator in water.
//!
//! ```text
//! copper loss -> winding -- K/W --> stator -- K/W --> water        thermistor: on the stator
//! ```
//!
//! The winding has a small heat capacity. At stall it is much hotter than the stator, especially if cold water cools the
//! stator. A thermistor on the stator then underestimates the temperature of the copper.

use super::parameters::Parameters;

/// Temperatures of the two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winding {
    /// Temperature of the copper, deg C.
    pub winding_c: f64,
    /// Temperature of the iron and of the thermistor on it, deg C.
    pub stator_c: f64,
}

impl Winding {
    /// Creates a motor at the water temperature.
    pub fn of(p: &Parameters) -> Self {
        Self { winding_c: p.water_temperature_c, stator_c: p.water_temperature_c }
    }

    /// Returns the resistance relative to that of the parameters.
    pub fn resistance_gain(&self, p: &Parameters) -> f64 {
        1.0 + p.copper_per_kelvin * (self.winding_c - 20.0)
    }

    /// Integrates by `dt` (s) with this copper loss, W.
    pub fn step(&mut self, p: &Parameters, loss_w: f64, dt: f64) {
        let into_stator = (self.winding_c - self.stator_c) / p.winding_to_stator_k_per_w;
        let into_water = (self.stator_c - p.water_temperature_c) / p.stator_to_water_k_per_w;
        self.winding_c += dt * (loss_w - into_stator) / p.winding_heat_capacity_j_per_k;
        self.stator_c += dt * (into_stator - into_water) / p.stator_heat_capacity_j_per_k;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn step_with_constant_loss_settles_at_loss_times_resistances() {
        let p = Parameters::default();
        let mut winding = Winding::of(&p);
        (0..600_000).for_each(|_| winding.step(&p, 50.0, 1e-3));
        let stator = p.water_temperature_c + 50.0 * p.stator_to_water_k_per_w;
        assert!((winding.stator_c - stator).abs() < 0.1, "{winding:?}");
        let copper = stator + 50.0 * p.winding_to_stator_k_per_w;
        assert!((winding.winding_c - copper).abs() < 0.1, "{winding:?}");
    }
}
