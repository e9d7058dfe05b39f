//! The levels and times the supervisor goes by.
//!
//! As a person writes them, in SI units; [`Thresholds::validate`] names what it refuses. Delays that
//! belong to the physics of a cause and not to a joint are in the table of [`super::codes`].

use compensator_core::parameters::{Bound, ParameterError, check_ranges};

/// Levels and times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thresholds {
    /// A set-point older than this is missing, us.
    pub command_timeout_us: u32,
    /// A conversion older than this is missing, us.
    pub sample_timeout_us: u32,
    /// Loop overruns in a row that are a fault.
    pub overruns_in_a_row: u32,
    /// Phase current that trips, A.
    pub overcurrent_a: f32,
    /// Phase current that is too much with the bridge off, A.
    pub current_offset_a: f32,
    /// Set-point from which phases are watched, A.
    pub phase_check_a: f32,
    /// A phase below this carries nothing, A.
    pub phase_dead_a: f32,
    /// Bus voltage that trips, V.
    pub bus_overvoltage_v: f32,
    /// Bus voltage at which that is over, V.
    pub bus_overvoltage_clear_v: f32,
    /// Bus voltage too low to drive with, V.
    pub bus_undervoltage_v: f32,
    /// Bus voltage at which that is over, V.
    pub bus_undervoltage_clear_v: f32,
    /// Bridge temperature from which current is taken back, deg C.
    pub bridge_derate_c: f32,
    /// Bridge temperature that trips, and where nothing is left, deg C.
    pub bridge_trip_c: f32,
    /// Motor temperature from which current is taken back, deg C.
    pub motor_derate_c: f32,
    /// Motor temperature that trips, and where nothing is left, deg C.
    pub motor_trip_c: f32,
    /// How far below its level a temperature has to fall, K.
    pub temperature_hysteresis_c: f32,
    /// Joint speed that trips, rad/s.
    pub overspeed_rad_s: f32,
}

impl Default for Thresholds {
    /// For a joint on 48 V with the current limit of the default compensator, 26 A.
    fn default() -> Self {
        Self {
            command_timeout_us: 100_000,
            sample_timeout_us: 1000,
            overruns_in_a_row: 3,
            overcurrent_a: 40.0,
            current_offset_a: 1.0,
            phase_check_a: 3.0,
            phase_dead_a: 0.3,
            bus_overvoltage_v: 60.0,
            bus_overvoltage_clear_v: 56.0,
            bus_undervoltage_v: 36.0,
            bus_undervoltage_clear_v: 40.0,
            bridge_derate_c: 80.0,
            bridge_trip_c: 100.0,
            motor_derate_c: 100.0,
            motor_trip_c: 120.0,
            temperature_hysteresis_c: 5.0,
            overspeed_rad_s: 14.0,
        }
    }
}

impl Thresholds {
    /// How many fields there are.
    pub const FIELDS: usize = 17;

    /// Names of the fields, in their order.
    pub const NAMES: [&'static str; Self::FIELDS] = [
        "command_timeout_us",
        "sample_timeout_us",
        "overruns_in_a_row",
        "overcurrent_a",
        "current_offset_a",
        "phase_check_a",
        "phase_dead_a",
        "bus_overvoltage_v",
        "bus_overvoltage_clear_v",
        "bus_undervoltage_v",
        "bus_undervoltage_clear_v",
        "bridge_derate_c",
        "bridge_trip_c",
        "motor_derate_c",
        "motor_trip_c",
        "temperature_hysteresis_c",
        "overspeed_rad_s",
    ];

    /// The fields, in their order.
    pub const fn to_array(self) -> [f32; Self::FIELDS] {
        [
            self.command_timeout_us as f32,
            self.sample_timeout_us as f32,
            self.overruns_in_a_row as f32,
            self.overcurrent_a,
            self.current_offset_a,
            self.phase_check_a,
            self.phase_dead_a,
            self.bus_overvoltage_v,
            self.bus_overvoltage_clear_v,
            self.bus_undervoltage_v,
            self.bus_undervoltage_clear_v,
            self.bridge_derate_c,
            self.bridge_trip_c,
            self.motor_derate_c,
            self.motor_trip_c,
            self.temperature_hysteresis_c,
            self.overspeed_rad_s,
        ]
    }

    /// The parameters with these fields, in their order.
    pub const fn from_array(fields: [f32; Self::FIELDS]) -> Self {
        let [
            command_timeout_us,
            sample_timeout_us,
            overruns_in_a_row,
            overcurrent_a,
            current_offset_a,
            phase_check_a,
            phase_dead_a,
            bus_overvoltage_v,
            bus_overvoltage_clear_v,
            bus_undervoltage_v,
            bus_undervoltage_clear_v,
            bridge_derate_c,
            bridge_trip_c,
            motor_derate_c,
            motor_trip_c,
            temperature_hysteresis_c,
            overspeed_rad_s,
        ] = fields;
        Self {
            command_timeout_us: command_timeout_us as u32,
            sample_timeout_us: sample_timeout_us as u32,
            overruns_in_a_row: overruns_in_a_row as u32,
            overcurrent_a,
            current_offset_a,
            phase_check_a,
            phase_dead_a,
            bus_overvoltage_v,
            bus_overvoltage_clear_v,
            bus_undervoltage_v,
            bus_undervoltage_clear_v,
            bridge_derate_c,
            bridge_trip_c,
            motor_derate_c,
            motor_trip_c,
            temperature_hysteresis_c,
            overspeed_rad_s,
        }
    }

    /// Smallest and largest legal value of each field, in their order, and why.
    const RANGES: [(f32, f32, &'static str); Self::FIELDS] = [
        (1e3, 1e5, "a joint nobody commands stops within 0.1 s"),
        (50.0, 1e4, "from a period of the loop to a few observations"),
        (1.0, 100.0, "one overrun takes the compensation, a row of them the bridge"),
        (0.1, 1e3, "what the bridge and the motor's magnets bear"),
        (1e-3, 100.0, "an offset is a torque nobody asked for"),
        (1e-2, 1e3, "below it a dead phase cannot be told from a small current"),
        (1e-3, 100.0, "noise of a current measurement"),
        (6.0, 1e3, "what the bridge bears"),
        (6.0, 1e3, "what the bridge bears"),
        (5.0, 1e3, "what the gate driver needs"),
        (5.0, 1e3, "what the gate driver needs"),
        (-20.0, 175.0, "what silicon bears"),
        (-20.0, 175.0, "what silicon bears"),
        (-20.0, 250.0, "what a winding bears"),
        (-20.0, 250.0, "what a winding bears"),
        (0.5, 50.0, "without it a fault comes and goes with noise"),
        (1e-2, 1e3, "a speed"),
    ];

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
