//! The levels and times the supervisor goes by.
//!
//! As a person writes them, in SI units; [`Thresholds::validate`] names what it refuses. Delays that
//! belong to the physics of a cause and not to a joint are in the table of [`super::codes`].

use compensator_core::parameters::{Bound, ParameterError, check_ranges};

compensator_core::named_fields! {
    /// Levels and times.
    pub struct Thresholds {
        /// A set-point older than this is missing, us.
        command_timeout_us: u32 = 100_000, 1e3..=1e5, "a joint nobody commands stops within 0.1 s";
        /// A conversion older than this is missing, us.
        sample_timeout_us: u32 = 1000, 50.0..=1e4, "from a period of the loop to a few observations";
        /// Loop overruns in a row that are a fault.
        overruns_in_a_row: u32 = 3, 1.0..=100.0, "one overrun takes the compensation, a row of them the bridge";
        /// Phase current that trips, A.
        overcurrent_a: f32 = 40.0, 0.1..=1e3, "what the bridge and the motor's magnets bear";
        /// Phase current that is too much with the bridge off, A.
        current_offset_a: f32 = 1.0, 1e-3..=100.0, "an offset is a torque nobody asked for";
        /// Set-point from which phases are watched, A.
        phase_check_a: f32 = 3.0, 1e-2..=1e3, "below it a dead phase cannot be told from a small current";
        /// A phase below this carries nothing, A.
        phase_dead_a: f32 = 0.3, 1e-3..=100.0, "noise of a current measurement";
        /// Bus voltage that trips, V.
        bus_overvoltage_v: f32 = 60.0, 6.0..=1e3, "what the bridge bears";
        /// Bus voltage at which that is over, V.
        bus_overvoltage_clear_v: f32 = 56.0, 6.0..=1e3, "what the bridge bears";
        /// Bus voltage too low to drive with, V.
        bus_undervoltage_v: f32 = 36.0, 5.0..=1e3, "what the gate driver needs";
        /// Bus voltage at which that is over, V.
        bus_undervoltage_clear_v: f32 = 40.0, 5.0..=1e3, "what the gate driver needs";
        /// Bridge temperature from which current is taken back, deg C.
        bridge_derate_c: f32 = 80.0, -20.0..=175.0, "what silicon bears";
        /// Bridge temperature that trips, and where nothing is left, deg C.
        bridge_trip_c: f32 = 100.0, -20.0..=175.0, "what silicon bears";
        /// Motor temperature from which current is taken back, deg C.
        motor_derate_c: f32 = 100.0, -20.0..=250.0, "what a winding bears";
        /// Motor temperature that trips, and where nothing is left, deg C.
        motor_trip_c: f32 = 120.0, -20.0..=250.0, "what a winding bears";
        /// How far below its level a temperature has to fall, K.
        temperature_hysteresis_c: f32 = 5.0, 0.5..=50.0, "without it a fault comes and goes with noise";
        /// How much warmer the copper is than the stator with its thermistor, K/W of copper loss; 0 for no model.
        winding_k_per_w: f32 = 0.8, 0.0..=100.0, "from the data sheet, or a stall with the resistance watched";
        /// Time constant of that, s.
        winding_time_s: f32 = 30.0, 0.1..=1e4, "heat capacity of the copper times the K/W";
        /// Copper temperature, by that model, from which current is taken back, deg C.
        winding_derate_c: f32 = 125.0, -20.0..=300.0, "what insulation bears: class F 155 deg C";
        /// Copper temperature where nothing is left, deg C.
        winding_max_c: f32 = 155.0, -20.0..=300.0, "what insulation bears: class F 155 deg C";
        /// Current at which a joint that stands is stopped, where it has not moved since it was armed, A.
        stall_current_a: f32 = 5.0, 0.1..=1e4, "more than friction takes to break away";
        /// Joint speed that trips, rad/s.
        overspeed_rad_s: f32 = 14.0, 1e-2..=1e3, "a speed";
    }
    /// For a joint on 48 V with the current limit of the default compensator, 26 A.
}

impl Thresholds {
    /// Checks every field, and those that must be in order.
    ///
    /// # Errors
    /// Names the field refused, its value, the bound it broke and why there is one.
    pub fn validate(&self) -> Result<(), ParameterError> {
        let refuse = |field, value: f32, bound, why| {
            Err(ParameterError { field, value: value.into(), bound, why })
        };
        check_ranges(&Self::NAMES, &self.to_array(), &Self::RANGES)?;
        let clears = "a level is left again on its safe side";
        let derates = "current is taken back before the trip";
        let hysteresis = self.temperature_hysteresis_c;
        for (field, value, least, why) in [
            ("bus_overvoltage_v", self.bus_overvoltage_v, self.bus_overvoltage_clear_v, clears),
            (
                "bus_undervoltage_clear_v",
                self.bus_undervoltage_clear_v,
                self.bus_undervoltage_v,
                clears,
            ),
            (
                "bus_overvoltage_clear_v",
                self.bus_overvoltage_clear_v,
                self.bus_undervoltage_clear_v,
                "between the two there must be a voltage to drive with",
            ),
            ("bridge_trip_c", self.bridge_trip_c, self.bridge_derate_c + hysteresis, derates),
            ("motor_trip_c", self.motor_trip_c, self.motor_derate_c + hysteresis, derates),
            ("winding_max_c", self.winding_max_c, self.winding_derate_c + hysteresis, derates),
            (
                "phase_check_a",
                self.phase_check_a,
                2.0 * self.phase_dead_a,
                "a phase that carries its share must not look dead",
            ),
            (
                "overcurrent_a",
                self.overcurrent_a,
                self.current_offset_a,
                "an offset is no overcurrent",
            ),
        ] {
            if value <= least {
                return refuse(field, value, Bound::MoreThan(least.into()), why);
            }
        }
        Ok(())
    }
}
