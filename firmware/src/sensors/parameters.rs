//! Constants of the sensors of a joint, as parameters: strain gauge, shunts, thermistors, and the dry side.
//!
//! A joint with other weights, another thermistor or turned amplifiers needs no other image. The defaults are those of
//! the STM32G474 board.

use super::biss::MAX_DATA_BITS;
use super::strain_gauge::StrainGauge;
use super::thermistor::Thermistor;
use crate::setting_error::check_either;
use compensator_core::parameters::{Bound, ParameterError, check_ranges, refuse};
use compensator_core::text;

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
        /// 1 if a leak probe is connected to the board.
        leak_connected: f32 = 0.0, 0.0..=1.0, "0 or 1";
        /// Share of the converter's range below which the leak probe is wet.
        leak_wet_share: f32 = 0.6, 0.0..=1.0, "a share of the range";
        /// Share of the converter's range from which the wire of the leak probe is broken.
        leak_open_share: f32 = 0.97, 0.0..=1.0, "a share of the range";
        /// 1 if a leak stops the joint; with 0 it is only reported.
        leak_stops: f32 = 1.0, 0.0..=1.0, "0 or 1";
        /// 1 if a sensor of humidity and pressure (BME280) is in the housing.
        air_connected: f32 = 0.0, 0.0..=1.0, "0 or 1";
        /// Relative humidity of the housing that is reported, percent.
        humidity_max_percent: f32 = 60.0, 1.0..=100.0, "below condensation at the coldest wall";
        /// Lowest pressure of the housing that is not reported, Pa.
        housing_pressure_min_pa: f32 = 7e4, 0.0..=1e6, "the pressure at closing, less what cooling explains";
        /// Highest pressure of the housing that is not reported, Pa.
        housing_pressure_max_pa: f32 = 1.3e5, 0.0..=1e6, "the pressure at closing, plus what heating explains";
        /// 1 if the two channels of safe torque off are connected to the board.
        sto_connected: f32 = 0.0, 0.0..=1.0, "0 or 1";
        /// Encoder of the motor: 0 AS5047P, 1 AS5048A, 2 ABZ, 3 ABZ and Hall sensors, 4 Hall sensors alone, 5 BiSS C; used
        /// from the next start on.
        encoder_kind: f32 = 0.0, 0.0..=5.0, "a kind of encoder";
        /// Lines per turn of an ABZ encoder; a line has four counts.
        abz_lines: f32 = 1024.0, 100.0..=16384.0, "lines of an encoder";
        /// 1, or -1 if the sectors of the Hall sensors fall while the ABZ encoder counts up.
        hall_order: f32 = 1.0, -1.0..=1.0, "1 or -1";
        /// Electrical angle of the ABZ encoder, from its index, at which the sector 001 of the Hall sensors begins, rad.
        hall_offset_rad: f32 = 0.0, -6.3..=6.3, "within a turn";
        /// Bits of the position within a turn of a BiSS encoder.
        biss_bits: f32 = 18.0, 10.0..=32.0, "from the data sheet of the encoder";
        /// Bits of the number of turns of a BiSS encoder, before the position; 0 without.
        biss_turn_bits: f32 = 0.0, 0.0..=24.0, "from the data sheet of the encoder";
        /// Encoder at the joint's side of the gear: 0 none, 1 BiSS C; used from the next start on.
        joint_encoder_kind: f32 = 0.0, 0.0..=1.0, "0 or 1";
        /// Bits of the position within a turn of the joint's encoder.
        joint_encoder_bits: f32 = 18.0, 10.0..=32.0, "from the data sheet of the encoder";
        /// Bits of the number of turns of the joint's encoder, before the position; 0 without.
        joint_encoder_turn_bits: f32 = 0.0, 0.0..=24.0, "from the data sheet of the encoder";
        /// 1, or -1 if the joint's encoder falls while the joint moves in its positive direction.
        joint_encoder_direction: f32 = 1.0, -1.0..=1.0, "1 or -1";
        /// Joint position at the zero of the joint's encoder, rad.
        joint_encoder_offset_rad: f32 = 0.0, -6.3..=6.3, "within a turn";
        /// Largest difference of the two sides of the gear since the joint was armed, rad; 0 does not compare them.
        joint_encoder_window_rad: f32 = 0.05, 0.0..=3.0, "more than play and torsion of the gear";
    }
    /// Defaults: a strain gauge of 2000 N, low-side shunts, thermistors of 10 k (B 3435) below 10 k, and nothing on the
    /// dry side.
}

impl SensorParameters {
    /// Checks every field.
    ///
    /// # Errors
    /// Names the first field refused, its value, the bound it broke and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::TEXTS, &self.to_array(), &Self::RANGES)?;
        for (field, switch) in [
            (text!("strain_connected"), self.strain_connected),
            (text!("leak_connected"), self.leak_connected),
            (text!("leak_stops"), self.leak_stops),
            (text!("air_connected"), self.air_connected),
            (text!("sto_connected"), self.sto_connected),
        ] {
            check_either(field, switch, [0.0, 1.0], text!("0 or 1"))?;
        }
        for (field, sign) in [
            (text!("shunt_sign"), self.shunt_sign),
            (text!("hall_order"), self.hall_order),
            (text!("joint_encoder_direction"), self.joint_encoder_direction),
        ] {
            check_either(field, sign, [-1.0, 1.0], text!("1 or -1"))?;
        }
        if self.leak_open_share <= self.leak_wet_share {
            let (open, bound) = (self.leak_open_share, Bound::MoreThan(self.leak_wet_share));
            let why = text!("a broken wire is drier than a dry probe");
            refuse(text!("leak_open_share"), open, bound, why)?;
        }
        if self.housing_pressure_max_pa <= self.housing_pressure_min_pa {
            let (low, high) = (self.housing_pressure_min_pa, self.housing_pressure_max_pa);
            let why = text!("there must be a range between the two");
            refuse(text!("housing_pressure_max_pa"), high, Bound::MoreThan(low), why)?;
        }
        if self.strain_range_n == 0.0 {
            let why = text!("a gauge answers to a force; a negative range is permitted too");
            refuse(text!("strain_range_n"), 0.0, Bound::MoreThan(0.0), why)?;
        }
        self.validate_encoders()
    }

    /// Checks that kinds and numbers are whole, and that each frame fits into a word of the receiver.
    fn validate_encoders(&self) -> Result<(), ParameterError> {
        for (field, value) in [
            (text!("encoder_kind"), self.encoder_kind),
            (text!("abz_lines"), self.abz_lines),
            (text!("biss_bits"), self.biss_bits),
            (text!("biss_turn_bits"), self.biss_turn_bits),
            (text!("joint_encoder_kind"), self.joint_encoder_kind),
            (text!("joint_encoder_bits"), self.joint_encoder_bits),
            (text!("joint_encoder_turn_bits"), self.joint_encoder_turn_bits),
        ] {
            if value != value as u32 as f32 {
                refuse(field, value, Bound::Whole, text!("a kind or a number is whole"))?;
            }
        }
        let motor = (text!("biss_turn_bits"), self.biss_turn_bits, self.biss_bits);
        let joint_turn_bits = self.joint_encoder_turn_bits;
        let joint = (text!("joint_encoder_turn_bits"), joint_turn_bits, self.joint_encoder_bits);
        for (field, turn_bits, bits) in [motor, joint] {
            let most = MAX_DATA_BITS as f32 - bits;
            if turn_bits > most {
                let why = text!("a frame has 40 bits of turns and position");
                refuse(field, turn_bits, Bound::AtMost(most), why)?;
            }
        }
        Ok(())
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
    fn validate_with_illegal_value_names_field_and_nearest_bound() {
        use Bound::{AtLeast, AtMost, MoreThan, Whole};
        let cases: &[(&str, f32, Bound)] = &[
            ("shunt_sign", 0.5, AtLeast(1.0)),
            ("shunt_sign", -0.9, AtMost(-1.0)),
            ("hall_order", 0.0, AtLeast(1.0)),
            ("joint_encoder_direction", -0.5, AtMost(-1.0)),
            ("strain_connected", 0.2, AtMost(0.0)),
            ("strain_connected", 0.5, AtLeast(1.0)),
            ("leak_connected", 0.2, AtMost(0.0)),
            ("leak_stops", 0.7, AtLeast(1.0)),
            ("air_connected", 0.7, AtLeast(1.0)),
            ("sto_connected", 0.2, AtMost(0.0)),
            ("strain_range_n", 0.0, MoreThan(0.0)),
            ("motor_beta_k", 10.0, AtLeast(500.0)),
            ("encoder_kind", 1.5, Whole),
            ("encoder_kind", 9.0, AtMost(5.0)),
            ("abz_lines", 1000.5, Whole),
            ("biss_bits", 18.5, Whole),
            ("biss_turn_bits", 24.0, AtMost(22.0)),
            ("joint_encoder_kind", 0.5, Whole),
            ("joint_encoder_bits", 18.5, Whole),
            ("joint_encoder_turn_bits", 24.0, AtMost(22.0)),
            ("leak_open_share", 0.5, MoreThan(0.6)),
            ("housing_pressure_max_pa", 6e4, MoreThan(7e4)),
        ];
        for (field, value, bound) in cases {
            let place = SensorParameters::NAMES.iter().position(|name| name == field);
            let mut values = SensorParameters::default().to_array();
            values[place.expect("a field")] = *value;
            let refused = SensorParameters::from_array(values).validate().expect_err("refused");
            assert_eq!(refused.field, *field);
            assert_eq!((refused.value, refused.bound), (*value, *bound), "{field}");
        }
        let falling = SensorParameters { strain_range_n: -2000.0, ..SensorParameters::default() };
        assert_eq!(falling.validate(), Ok(()), "the voltage falls with the load");
    }
}
