//! Levels and times of the supervisor.
//!
//! Users write them in SI units; [`Thresholds::validate`] names the field it refuses. Delays that depend on
//! the physics of a cause, not on the joint, are in the table of [`super::codes`].

use compensator_core::parameters::{Bound, ParameterError, Text, check_ranges, refuse};
use compensator_core::text;

compensator_core::named_fields! {
    /// Levels and times of the supervisor.
    pub struct Thresholds {
        /// Maximum age of a set-point, us.
        command_timeout_us: u32 = 100_000, 1e3..=1e5, "a joint without commands stops within 0.1 s";
        /// Maximum age of a converter sample, us.
        sample_timeout_us: u32 = 1000, 50.0..=1e4, "from a period of the loop to a few observations";
        /// Number of consecutive loop overruns that is a fault.
        overruns_in_a_row: u32 = 3, 1.0..=100.0, "one overrun disables the compensation, several in a row open the bridge";
        /// Phase current that trips an overcurrent fault, A.
        overcurrent_a: f32 = 40.0, 0.1..=1e3, "rating of the bridge and of the motor's magnets";
        /// Maximum phase current with the bridge off, A.
        current_offset_a: f32 = 1.0, 1e-3..=100.0, "an offset causes an unwanted torque";
        /// Set-point from which each phase is checked for an open circuit, A.
        phase_check_a: f32 = 3.0, 1e-2..=1e3, "below it an open phase cannot be distinguished from a small current";
        /// Phase current below which a phase counts as open, A.
        phase_dead_a: f32 = 0.3, 1e-3..=100.0, "noise of a current measurement";
        /// Bus voltage that trips an overvoltage fault, V.
        bus_overvoltage_v: f32 = 60.0, 6.0..=1e3, "rating of the bridge";
        /// Bus voltage at which the overvoltage fault may clear, V.
        bus_overvoltage_clear_v: f32 = 56.0, 6.0..=1e3, "rating of the bridge";
        /// Bus voltage that trips an undervoltage fault, V.
        bus_undervoltage_v: f32 = 36.0, 5.0..=1e3, "supply range of the gate driver";
        /// Bus voltage at which the undervoltage fault may clear, V.
        bus_undervoltage_clear_v: f32 = 40.0, 5.0..=1e3, "supply range of the gate driver";
        /// Bridge temperature from which the current limit is reduced, deg C.
        bridge_derate_c: f32 = 80.0, -20.0..=175.0, "rating of the silicon";
        /// Bridge temperature that trips a fault; the current limit reaches 0 here, deg C.
        bridge_trip_c: f32 = 100.0, -20.0..=175.0, "rating of the silicon";
        /// Motor temperature from which the current limit is reduced, deg C.
        motor_derate_c: f32 = 100.0, -20.0..=250.0, "rating of the winding";
        /// Motor temperature that trips a fault; the current limit reaches 0 here, deg C.
        motor_trip_c: f32 = 120.0, -20.0..=250.0, "rating of the winding";
        /// Hysteresis of the temperature levels, K.
        temperature_hysteresis_c: f32 = 5.0, 0.5..=50.0, "without it noise raises and clears the fault repeatedly";
        /// Thermal resistance from the copper to the stator with its thermistor, K/W of copper loss; 0
        /// disables the model.
        winding_k_per_w: f32 = 0.8, 0.0..=100.0, "from the data sheet, or a stall with the resistance watched";
        /// Thermal time constant of the copper, s.
        winding_time_s: f32 = 30.0, 0.1..=1e4, "heat capacity of the copper times the K/W";
        /// Winding temperature (from the model) from which the current limit is reduced, deg C.
        winding_derate_c: f32 = 125.0, -20.0..=300.0, "rating of the insulation: class F 155 deg C";
        /// Winding temperature at which the current limit reaches 0, deg C.
        winding_max_c: f32 = 155.0, -20.0..=300.0, "rating of the insulation: class F 155 deg C";
        /// Current from which a joint that has not moved since it was armed, and never before, is stopped, A.
        stall_current_a: f32 = 5.0, 0.1..=1e4, "must exceed the breakaway current of the friction";
        /// Joint speed that trips an overspeed fault, rad/s.
        overspeed_rad_s: f32 = 14.0, 1e-2..=1e3, "maximum speed of the joint";
        /// 1: arming is refused while the position is unknown, except in homing mode.
        position_required: u32 = 0, 0.0..=1.0, "0 or 1";
    }
    /// Defaults for a joint on 48 V with the default current limit of 26 A.
}

impl Thresholds {
    /// Checks the range of every field and the order of related fields.
    ///
    /// # Errors
    /// Returns the refused field, its value, the violated bound and the reason for the bound.
    pub fn validate(&self) -> Result<(), ParameterError> {
        check_ranges(&Self::TEXTS, &self.to_array(), &Self::RANGES)?;
        let clears = text!("the clear level must be on the safe side of the trip level");
        let derates = text!("derating must begin before the trip");
        let between = text!("there must be an operating voltage between the two");
        let open = text!("a phase that carries its share must not count as open");
        let offset = text!("the offset limit must be below the overcurrent level");
        let (over, over_clear) = (self.bus_overvoltage_v, self.bus_overvoltage_clear_v);
        let (under, under_clear) = (self.bus_undervoltage_v, self.bus_undervoltage_clear_v);
        let bridge_c = self.bridge_derate_c + self.temperature_hysteresis_c;
        let motor_c = self.motor_derate_c + self.temperature_hysteresis_c;
        let winding_c = self.winding_derate_c + self.temperature_hysteresis_c;
        check_above(text!("bus_overvoltage_v"), over, over_clear, clears)?;
        check_above(text!("bus_undervoltage_clear_v"), under_clear, under, clears)?;
        check_above(text!("bus_overvoltage_clear_v"), over_clear, under_clear, between)?;
        check_above(text!("bridge_trip_c"), self.bridge_trip_c, bridge_c, derates)?;
        check_above(text!("motor_trip_c"), self.motor_trip_c, motor_c, derates)?;
        check_above(text!("winding_max_c"), self.winding_max_c, winding_c, derates)?;
        check_above(text!("phase_check_a"), self.phase_check_a, 2.0 * self.phase_dead_a, open)?;
        check_above(text!("overcurrent_a"), self.overcurrent_a, self.current_offset_a, offset)
    }
}

/// Checks that a level is above another one.
#[inline(never)]
fn check_above(field: Text, value: f32, other: f32, why: Text) -> Result<(), ParameterError> {
    if value <= other { refuse(field, value, Bound::MoreThan(other), why) } else { Ok(()) }
}
