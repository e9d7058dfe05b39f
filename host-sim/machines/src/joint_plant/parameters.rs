//! Constants of the plant in one table, each with its value, unit and source.
//!
//! The values come from physics and from the paper (Ding et al., Table I and its text). They are not fitted to a printed
//! result. "Assumed" marks a value without a source that is usual for such a part. [`Parameters::table`] returns the
//! table for a report page.

use serde_json::{Map, Value, json};

/// Angles of the eccentricity and the out-of-roundness of the joint in the published experiments, rad.
pub const PHASE_RAD: [f64; 2] = [0.7, 2.1];

/// A constant in the form of a report page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Name of the field of [`Parameters`].
    pub name: &'static str,
    /// Value.
    pub value: f64,
    /// Unit. Empty for a dimensionless number.
    pub unit: &'static str,
    /// Source of the value.
    pub source: &'static str,
}

macro_rules! parameters {
    ($($name:ident = $value:expr, $unit:literal, $source:literal;)*) => {
        /// The plant's constants, SI units.
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Parameters {
            $(#[doc = concat!("In ", $unit, " (1 where empty): ", $source, ".")] pub $name: f64,)*
        }

        impl Default for Parameters {
            fn default() -> Self {
                Self { $($name: $value,)* }
            }
        }

        impl Parameters {
            /// Returns every constant with its unit and source, in the order of the parts.
            pub fn table(&self) -> Vec<Entry> {
                vec![$(Entry { name: stringify!($name), value: self.$name, unit: $unit, source: $source },)*]
            }
        }
    };
}

parameters! {
    pole_pairs = 7.0, "", "the reference drive";
    gear_ratio = 51.0, "", "the reference drive: 26 Nm at 26 A (Table I: 26 Nm)";
    phase_resistance_ohm = 0.13, "ohm", "the reference drive, 8 % warmer";
    phase_inductance_h = 88e-6, "H", "the reference drive, 2 % off";
    motor_torque_constant_nm_per_a = 0.0196, "Nm/A", "the reference drive";
    torque_constant_error = -0.02, "", "assumed: tolerance of a magnet, unknown to the driver";
    bus_voltage_v = 48.0, "V", "the reference drive";
    bus_capacitance_f = 1.0e-3, "F", "assumed: electrolytics of a 26 A stage; at work where a plant is given its supply";
    supply_resistance_ohm = 0.05, "ohm", "assumed: cable and fuse of a bench supply, which takes nothing back";
    shunt_lag_s = 0.26e-6, "s", "assumed: amplifier of 600 kHz, one pole; seen where duties leave it little time";
    break_level_a = 44.0, "A", "the reference drive's comparators: 12-bit levels over shunts of 1 mohm, amplified by 20";
    break_error_a = 2.0, "A", "the reference drive: comparator 9 mV, level 10 counts, amplifier 0.3 A and 1 %, all on the high side";
    break_filter_s = 0.75e-6, "s", "the reference drive: 8 samples at 10.6 MHz";
    break_delay_s = 0.3e-6, "s", "assumed: comparator 31 ns, gate driver and switch";
    dead_time_s = 0.3e-6, "s", "assumed: usual of a MOSFET bridge";
    dead_time_ramp_a = 0.1, "A", "assumed: current below which the loss is proportional to it; at work where switch_capacitance_f is 0";
    switch_capacitance_f = 0.0, "F", "of a phase node, both switches; without it the loss is a ramp; scenarios set theirs";
    switch_resistance_ohm = 0.0, "ohm", "of the closed switch: part of the phase's; scenarios set theirs";
    diode_drop_v = 0.0, "V", "of the body diode at 10 A; scenarios set theirs";
    phase_spread = 0.0, "", "share by which dead time and capacitance of phases a and c differ from those of b; scenarios set theirs";
    current_noise_a = 0.05, "A", "assumed: shunt amplifier, one standard deviation";
    current_step_a = 0.0293, "A", "12 bits over +-60 A";
    encoder_counts = 16384.0, "1/turn", "14-bit magnetic encoder on the motor";
    encoder_zero_rad = 0.0, "rad", "what the encoder shows where the magnet lies along phase a: mounted so; scenarios set theirs";
    encoder_direction = 1.0, "", "-1 where it is mounted the other way round";
    magnet_eccentricity_rad = 0.0, "rad", "encoder's error once a turn of the motor: centred; scenarios set theirs";
    cogging_nm = 0.0, "Nm", "at the motor: taken smooth; scenarios set theirs";
    cogging_periods = 84.0, "1/turn", "14 poles in 12 slots";
    winding_heat_capacity_j_per_k = 58.0, "J/K", "assumed: 150 g of copper";
    winding_to_stator_k_per_w = 0.6, "K/W", "assumed: potted winding in its slots";
    stator_heat_capacity_j_per_k = 230.0, "J/K", "assumed: 500 g of iron";
    stator_to_water_k_per_w = 0.3, "K/W", "assumed: pressed into a flooded housing";
    copper_per_kelvin = 0.0039, "1/K", "copper, from 20 degC";
    rotor_inertia_kg_m2 = 4.0e-5, "kg m^2", "assumed: frameless motor of 70 mm";
    output_inertia_kg_m2 = 0.02, "kg m^2", "assumed: gear output, shaft and flange";
    gear_efficiency = 0.92, "", "assumed: planetary gear of two stages";
    gear_no_load_nm = 0.15, "Nm", "assumed: no-load torque of the gear at the joint";
    gear_stiffness_nm_per_rad = 2.0e4, "Nm/rad", "assumed: presliding of gear and bearings";
    output_stiffness_nm_per_rad = 0.0, "Nm/rad", "gear and coupling to the output; 0 is rigid; scenarios set theirs";
    output_damping_nm_s_per_rad = 2.0, "Nm s/rad", "assumed: loss in that coupling where it is not rigid";
    backlash_rad = 0.0, "rad", "play of that coupling from end to end; scenarios set theirs";
    shaft_radius_m = 0.0125, "m", "assumed: steel shaft for 26 Nm";
    shaft_modulus_pa = 1.93e11, "Pa", "stainless steel";
    bearing_span_m = 0.025, "m", "assumed: l_b of Fig. 5, a compact joint";
    seal_overhang_m = 0.030, "m", "assumed: l_O of Fig. 5";
    load_overhang_m = 0.150, "m", "assumed: l_L of Fig. 5, arm or propeller";
    seal_width_m = 0.008, "m", "assumed: HBTS ring (Table I), contact width";
    seal_thickness_m = 0.003, "m", "assumed: HBTS ring";
    seal_modulus_pa = 5.0e8, "Pa", "filled PTFE";
    seal_preload_pa = 1.6e6, "Pa", "assumed: contact pressure by the energising ring";
    pressure_share = 1.0, "", "a pressure-energised seal carries the whole difference";
    friction_kinetic = 0.12, "", "filled PTFE on wet steel";
    friction_static = 0.17, "", "filled PTFE on wet steel";
    load_exponent = 0.88, "", "PTFE: friction grows slower than the normal force";
    stribeck_velocity_rad_s = 0.12, "rad/s", "assumed: 1.5 mm/s at the shaft";
    presliding_stiffness_nm_per_rad = 4.0e3, "Nm/rad", "assumed: shear of ring and energiser, some 5 um";
    presliding_damping_nm_s_per_rad = 4.0, "Nm s/rad", "assumed: loss in the ring while it sticks";
    attraction_nm_per_s = 40.0, "Nm/s", "assumed: friction lag of 40 ms (generalised Maxwell slip)";
    film_viscous_nm_s_per_rad = 0.12, "Nm s/rad", "assumed: grease film at 20 degC";
    film_thinning_rad_s = 15.0, "rad/s", "assumed: shear thinning";
    film_per_kelvin = 0.025, "1/K", "grease: halves in 28 K";
    level_per_kelvin = 0.004, "1/K", "assumed: PTFE softens with heat";
    film_heat_capacity_j_per_k = 60.0, "J/K", "assumed: ring, film and 30 g of shaft";
    film_resistance_k_per_w = 0.5, "K/W", "assumed: to housing and water";
    thermometer_lag_s = 8.0, "s", "assumed: thermometer in the housing beside the seal";
    water_temperature_c = 18.0, "degC", "assumed: pool";
    relaxation_s = 0.3, "s", "assumed: creep of the energising ring under side load";
    relaxation_overshoot = 1.4, "", "assumed: stiffer for a fast load than for a slow one";
    radial_coupling_rad_per_m = 16.0, "rad/m", "assumed: a fifth of the radial motion shears the contact (eta2)";
    eccentricity = 0.03, "", "assumed: level over one turn";
    out_of_round = 0.015, "", "assumed: level twice a turn";
    torque_noise_nm = 0.1, "Nm", "Table I: +-0.2 Nm, taken as two standard deviations";
    force_noise_n = 0.015, "N", "Table I: +-0.03 N, likewise";
    pressure_noise_pa = 300.0, "Pa", "assumed: depth sensor";
    pool_pressure_pa = 34.3e3, "Pa", "3.5 m of water (III-B)";
    water_density_kg_m3 = 1000.0, "kg/m^3", "water";
    propeller_diameter_m = 0.25, "m", "assumed: 'small propellers'";
    propeller_torque_coefficient = 0.05, "", "assumed: bollard, usual of three blades";
    propeller_inertia_kg_m2 = 0.008, "kg m^2", "assumed: blades and the water they carry";
    propeller_weight_n = 6.0, "N", "assumed: in water, the side load at rest";
    propeller_ripple_n = 1.5, "N", "assumed: three times a turn, from the blades";
    leg_length_m = 0.30, "m", "assumed: drive rod of Fig. 8(b)";
    leg_weight_n = 19.6, "N", "2 kg in water (III-B)";
    leg_mass_kg = 2.3, "kg", "assumed: steel of that weight in water";
    leg_added_inertia_kg_m2 = 0.011, "kg m^2", "water carried by a rod of 40 mm";
    leg_drag_nm_s2_per_rad2 = 0.045, "Nm s^2/rad^2", "rod of 40 mm, drag coefficient 1.1";
    platform_mass_kg = 6.0, "kg", "assumed: jumping platform with the water it carries";
    platform_weight_n = 19.6, "N", "as the leg's: 2 kg in water";
    platform_drag_n_s2_per_m2 = 30.0, "N s^2/m^2", "assumed: plate of 0.05 m^2";
    ground_stiffness_n_per_m = 2.0e4, "N/m", "assumed: rubber foot on tiles";
    ground_damping_n_s_per_m = 150.0, "N s/m", "assumed: rubber foot";
}

impl Parameters {
    /// Returns the content of `truth.json` of a simulation of this joint: every constant.
    pub fn truth(&self, scenario: &str, seed: u64) -> Value {
        let constants = self.table().into_iter().map(|entry| {
            let about = json!({"value": entry.value, "unit": entry.unit, "source": entry.source});
            (entry.name.to_owned(), about)
        });
        json!({
            "schema": 1,
            "origin": "simulated",
            "scenario": scenario,
            "seed": seed,
            "hidden": [],
            "parameters": Map::from_iter(constants),
        })
    }
}
