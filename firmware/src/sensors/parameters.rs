//! Constants of the sensors of a joint, as parameters: strain gauge, shunts and thermistors.
//!
//! A joint with other weights, another thermistor or turned amplifiers needs no other image. The defaults are those of
//! the STM32G474 board.

use super::strain_gauge::StrainGauge;
use super::thermistor::Thermistor;
use compensator_core::parameters::{Bound, ParameterError, check_ranges};

compensator_core::named_fields! {
    /// Constants of the sensors of a joint.
    pub struct SensorParameters {
        /// 1 if strain gauges are connected to the board; with 0 the side load is received over the bus.
        strain_connected: f32 = 1.0, 0.0..=1.0, "0 or 1";
        /// Share of the converter's range at zero side load.
        strain_zero: f32 = 0.5, 0.0..=1.0, "a share of the range";
        /// Side load that corresponds to the whole range, N; negative if the voltage falls with the load.
        strain_range_n: f32 = 2000.0, -1e6..=1e6, "a force";
        /// 1, or -1 if a current into the motor lowers the voltage of the shunt amplifiers; used from the next start
        /// on.
        shunt_sign: f32 = -1.0, -1.0..=1.0, "1 or -1";
        /// Resistance of the bridge's thermistor at 25 deg C, per resistance of its divider.
        bridge_ratio_at_25: f32 = 1.0, 1e-3..=1e3, "a ratio of resistances";
        /// Material constant B of the bridge's thermistor, K.
        bridge_beta_k: f32 = 3435.0, 500.0..=1e4, "from the data sheet of a thermistor";
        /// Resistance of the motor's thermistor at 25 deg C, per resistance of its divider.
        motor_ratio_at_25: f32 = 1.0, 1e-3..=1e3, "a ratio of resistances";
        /// Material constant B of the motor's thermistor, K.
        motor_beta_k: f32 = 3435.0, 500.0..=1e4, "from the data sheet of a thermistor";
    }
    /// Defaults: a strain gauge of 2000 N, low-side shunts, and thermistors of 10 k (B 3435) below 10 k.
}

impl SensorParameters {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field refused, its value, the bound it broke and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::NAMES, &self.to_array(), &Self::RANGES)?;
        let switch = self.strain_connected;
        let refused = if switch != 0.0 && switch != 1.0 {
            Some(("strain_connected", switch, Bound::AtLeast(1.0), "0 or 1"))
        } else if self.shunt_sign.abs() != 1.0 {
            Some(("shunt_sign", self.shunt_sign, Bound::AtLeast(1.0), "1 or -1"))
        } else if self.strain_range_n == 0.0 {
            Some(("strain_range_n", 0.0, Bound::MoreThan(0.0), "a gauge answers to a force"))
        } else {
            None
        };
        match refused {
            Some((field, value, bound, why)) => {
                Err(ParameterError { field, value: value.into(), bound, why })
            }
            None => Ok(()),
        }
    }

    /// Returns the strain gauge; `None` if none is connected.
    pub fn strain_gauge(&self) -> Option<StrainGauge> {
        let gauge = StrainGauge { zero: self.strain_zero, range_n: self.strain_range_n };
        (self.strain_connected != 0.0).then_some(gauge)
    }

    /// Returns the thermistor at the bridge.
    pub fn bridge_thermistor(&self) -> Thermistor {
        Thermistor { ratio_at_25: self.bridge_ratio_at_25, beta_k: self.bridge_beta_k }
    }

    /// Returns the thermistor in the motor.
    pub fn motor_thermistor(&self) -> Thermistor {
        Thermistor { ratio_at_25: self.motor_ratio_at_25, beta_k: self.motor_beta_k }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_sensors_are_those_of_the_board() {
        let sensors = SensorParameters::default();
        assert_eq!(sensors.validate(), Ok(()));
        let gauge = sensors.strain_gauge().expect("one is connected");
        assert_eq!(gauge.force_n(0.75), Some(500.0));
        assert!((sensors.bridge_thermistor().temperature_c(0.5) - 25.0).abs() < 0.01);
        let without = SensorParameters { strain_connected: 0.0, ..sensors };
        assert_eq!(without.strain_gauge(), None);
    }

    #[test]
    fn sensors_that_are_neither_of_two_values_are_refused() {
        let sensors = SensorParameters::default();
        for (changed, field) in [
            (SensorParameters { shunt_sign: 0.5, ..sensors }, "shunt_sign"),
            (SensorParameters { strain_connected: 0.5, ..sensors }, "strain_connected"),
            (SensorParameters { strain_range_n: 0.0, ..sensors }, "strain_range_n"),
            (SensorParameters { motor_beta_k: 10.0, ..sensors }, "motor_beta_k"),
        ] {
            assert_eq!(changed.validate().expect_err("refused").field, field);
        }
    }
}
