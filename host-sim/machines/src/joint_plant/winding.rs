//! Heat of the motor: a winding in a stator in water.
//!
//! ```text
//! copper loss -> winding -- K/W --> stator -- K/W --> water        thermistor: on the stator
//! ```
//! A winding has little copper and its time is its own: at stall it is far hotter than the iron around it, the more the colder
//! the water holds the stator. What a thermistor on the stator shows then says little of the copper.

use super::parameters::Parameters;

/// Temperatures of the two nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Winding {
    /// Copper, deg C.
    pub winding_c: f64,
    /// Iron, and the thermistor on it, deg C.
    pub stator_c: f64,
}

impl Winding {
    /// As cold as the water.
    pub fn of(p: &Parameters) -> Self {
        Self { winding_c: p.water_temperature_c, stator_c: p.water_temperature_c }
    }

    /// Resistance over that in the table.
    pub fn resistance_gain(&self, p: &Parameters) -> f64 {
        1.0 + p.copper_per_kelvin * (self.winding_c - 20.0)
    }

    /// A step of `dt` (s) with this loss in the copper, W.
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
    fn it_settles_at_loss_times_both_resistances() {
        let p = Parameters::default();
        let mut winding = Winding::of(&p);
        (0..600_000).for_each(|_| winding.step(&p, 50.0, 1e-3));
        let stator = p.water_temperature_c + 50.0 * p.stator_to_water_k_per_w;
        assert!((winding.stator_c - stator).abs() < 0.1, "{winding:?}");
        let copper = stator + 50.0 * p.winding_to_stator_k_per_w;
        assert!((winding.winding_c - copper).abs() < 0.1, "{winding:?}");
    }
}
