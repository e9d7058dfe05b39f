//! The bus: a capacitor, and a supply that charges it and takes nothing back.
//!
//! A bench supply or a rectifier holds its voltage from below alone. What a joint gives back while it brakes stays in the
//! capacitor, `C/2 (u^2 - u0^2)`, until it is used up; so the bus rises. What the bridge draws is power by power: the sum of phase
//! voltages times currents over the bus voltage, open diodes included.

use super::parameters::Parameters;

/// Capacitor and supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Voltage the supply is set to, V.
    pub set_v: f64,
    /// At the capacitor, V.
    bus_v: f64,
    /// Charge of a volt, F, and what is between supply and capacitor, ohm.
    capacitance_f: f64,
    resistance_ohm: f64,
}

impl Supply {
    /// Charged, at rest.
    pub fn of(p: &Parameters) -> Self {
        Self {
            set_v: p.bus_voltage_v,
            bus_v: p.bus_voltage_v,
            capacitance_f: p.bus_capacitance_f,
            resistance_ohm: p.supply_resistance_ohm,
        }
    }

    /// At the capacitor, V.
    pub fn bus_v(&self) -> f64 {
        self.bus_v
    }

    /// A step of `dt` (s) in which the bridge draws so many ampere.
    pub fn step(&mut self, drawn_a: f64, dt: f64) {
        // Exact for a constant draw: 50 us are a time constant of capacitor and cable.
        let left = self.set_v - drawn_a * self.resistance_ohm;
        let settled = (-dt / (self.resistance_ohm * self.capacitance_f)).exp();
        if self.bus_v <= self.set_v {
            let charged = left + (self.bus_v - left) * settled;
            // Beyond its voltage the supply does nothing.
            if charged <= self.set_v {
                self.bus_v = charged;
                return;
            }
        }
        self.bus_v = (self.bus_v - drawn_a * dt / self.capacitance_f).max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_given_back_stays_and_a_load_pulls_it_down() {
        let p = Parameters::default();
        let mut supply = Supply::of(&p);
        // 1 J at constant power.
        let dt = 1e-5;
        for _ in 0..1000 {
            let power_w = 100.0;
            supply.step(-power_w / supply.bus_v(), dt);
        }
        let wanted = (48f64.powi(2) + 2.0 / p.bus_capacitance_f).sqrt();
        assert!((supply.bus_v() - wanted).abs() < 0.05, "{} of {wanted}", supply.bus_v());
        // It stays there until somebody draws.
        (0..1000).for_each(|_| supply.step(0.0, dt));
        assert!((supply.bus_v() - wanted).abs() < 0.05);
        (0..10_000).for_each(|_| supply.step(10.0, dt));
        assert!((supply.bus_v() - 47.5).abs() < 1e-3, "{}", supply.bus_v());
    }
}
