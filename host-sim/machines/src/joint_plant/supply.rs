//! DC bus: a capacitor and a unidirectional supply.
//!
//! A bench supply or a rectifier can charge the bus but not discharge it. The braking energy of the joint stays in the
//! capacitor, `C/2 (u^2 - u0^2)`, so the bus voltage rises. The bridge current follows from the power balance: the sum
//! of phase voltages times phase currents, divided by the bus voltage. This includes the diodes of an open bridge.

use super::parameters::Parameters;

/// State of capacitor and supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Voltage the supply is set to, V.
    pub set_v: f64,
    /// Voltage of the capacitor, V.
    pub bus_v: f64,
    /// Capacitance, F, and resistance between supply and capacitor, ohm.
    capacitance_f: f64,
    resistance_ohm: f64,
}

impl Supply {
    /// Creates a charged bus without current.
    pub fn of(p: &Parameters) -> Self {
        Self {
            set_v: p.bus_voltage_v,
            bus_v: p.bus_voltage_v,
            capacitance_f: p.bus_capacitance_f,
            resistance_ohm: p.supply_resistance_ohm,
        }
    }

    /// Integrates by `dt` (s) while the bridge draws `drawn_a` (A).
    pub fn step(&mut self, drawn_a: f64, dt: f64) {
        // Exact for a constant current, because the time constant of capacitor and cable is only 50 us.
        let left = self.set_v - drawn_a * self.resistance_ohm;
        let settled = (-dt / (self.resistance_ohm * self.capacitance_f)).exp();
        if self.bus_v <= self.set_v {
            let charged = left + (self.bus_v - left) * settled;
            // Above its set voltage the supply is inactive.
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
    fn step_with_recovered_energy_raises_the_bus_until_current_is_drawn() {
        let p = Parameters::default();
        let mut supply = Supply::of(&p);
        // 1 J at constant power.
        let dt = 1e-5;
        for _ in 0..1000 {
            let power_w = 100.0;
            supply.step(-power_w / supply.bus_v, dt);
        }
        let wanted = (48f64.powi(2) + 2.0 / p.bus_capacitance_f).sqrt();
        assert!((supply.bus_v - wanted).abs() < 0.05, "{} of {wanted}", supply.bus_v);
        // The voltage stays constant until current is drawn.
        (0..1000).for_each(|_| supply.step(0.0, dt));
        assert!((supply.bus_v - wanted).abs() < 0.05);
        (0..10_000).for_each(|_| supply.step(10.0, dt));
        assert!((supply.bus_v - 47.5).abs() < 1e-3, "{}", supply.bus_v);
    }
}
