//! Temperature from a thermistor in a divider with a fixed resistor.
//!
//! The resistance falls with temperature; over a working range `R = R25 exp(B (1/T - 1/T25))` with T in
//! kelvin. The converter's reference supplies the divider, so only ratios matter. At a rail the sensor is
//! broken or shorted; the result is then NaN, which means measured but invalid.

/// A thermistor from the converter's input to ground, with a resistor up to its reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thermistor {
    /// Resistance at 25 deg C divided by that of the resistor.
    pub ratio_at_25: f32,
    /// Material constant B, K.
    pub beta_k: f32,
}

const ZERO_CELSIUS_K: f32 = 273.15;
const RAIL_SHARE: f32 = 0.01;

impl Thermistor {
    /// Returns the temperature, deg C, for a share of the converter's range; NaN at a rail.
    #[inline(never)]
    pub fn temperature_c(&self, share: f32) -> f32 {
        if !(share > RAIL_SHARE && share < 1.0 - RAIL_SHARE) {
            return f32::NAN;
        }
        let ratio = share / (1.0 - share);
        let inverse =
            1.0 / (ZERO_CELSIUS_K + 25.0) + libm::logf(ratio / self.ratio_at_25) / self.beta_k;
        1.0 / inverse - ZERO_CELSIUS_K
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn temperature_of_a_10k_thermistor_matches_its_table() {
        // B 3435: 10 kohm at 25, 4.16 at 50, 1.45 at 85, 27.2 at 0 deg C.
        let thermistor = Thermistor { ratio_at_25: 1.0, beta_k: 3435.0 };
        for (kohm, expected) in [(10.0, 25.0), (4.16, 50.0), (1.45, 85.0), (27.2, 0.0)] {
            let found = thermistor.temperature_c(kohm / (kohm + 10.0));
            assert!((found - expected).abs() < 1.5, "{found} for {expected}");
        }
        for broken in [0.0, 0.01, 0.99, 1.0, f32::NAN] {
            assert!(thermistor.temperature_c(broken).is_nan());
        }
    }
}
