//! A random joint in service: its plant, what it hides, its sensors, and what its builder knows of it.
//!
//! The constants are drawn around those of the reference joint (26 Nm). A hidden effect without a given size is drawn so
//! that it changes the friction by 15 to 60 % of its level within a session of some minutes. Side load, pressure and
//! temperature vary only if an effect needs them.

mod hidden;

use super::contact::FrictionFamily;
use super::load::Load;
use super::machine::JointPlant;
use super::parameters::Parameters;
use super::seal::Seal;
use super::surroundings::{Course, Surroundings};
use crate::joint::Joint;
use crate::sampler::Sampler;
use crate::scenarios::drawn_cause::DrawnCause;
use crate::scenarios::{HiddenCause, Hide, HideError};
use std::f64::consts::{PI, TAU};

/// What the builder of a joint knows about it, from data sheets and commissioning.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownConstants {
    /// Torque constant of the motor's data sheet, Nm/A.
    pub torque_constant_nm_per_a: f64,
    /// Inertia at the joint, rotor included, kg m^2: within 20 % of that of the drawn parts, without a hidden one.
    pub inertia_kg_m2: f64,
    /// Measured phase resistance, ohm.
    pub resistance_ohm: f64,
    /// Measured phase inductance, H.
    pub inductance_h: f64,
    /// Gain of the velocity loop that a person chose, per gain of the usual rule: 0.7 to 1.3.
    pub velocity_gain_factor: f64,
    /// Gain of the position loop, likewise.
    pub position_gain_factor: f64,
}

/// Sensors around a joint that send their readings on its bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointSensors {
    /// Side load and pressure difference.
    pub has_seal_sensors: bool,
    /// Temperature near the seal.
    pub has_thermometer: bool,
}

/// A drawn joint. Equal seeds and effects give equal joints.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnJoint {
    /// Seed of the draw, and of the noise of its sensors.
    pub seed: u64,
    /// Family of its friction.
    pub family: FrictionFamily,
    /// Constants of the plant.
    pub constants: Parameters,
    /// Angles of the eccentricity and the out-of-roundness, rad.
    pub phase_rad: [f64; 2],
    /// Exponent of the Stribeck curve of [`FrictionFamily::MaxwellSlip`].
    pub stribeck_exponent: f64,
    /// Level of the sliding friction at low speed, gear included, Nm.
    pub friction_nm: f64,
    /// Position at the start, rad.
    pub start_rad: f64,
    /// Effects that the joint hides.
    pub hidden: Vec<DrawnCause>,
    /// Course of its surroundings.
    pub surroundings: Surroundings,
    /// Its sensors.
    pub sensors: JointSensors,
    /// What its builder knows.
    pub known: KnownConstants,
}

/// Purposes of the samplers: a joint with another effect is otherwise the same joint.
const JOINT_PURPOSE: u64 = 0x4a01;
const EFFECT_PURPOSE: u64 = 0x4a02;

/// Coupling of a drawn joint that needs one, Nm/rad, and range of the drawn ones.
const COUPLING_NM_PER_RAD: (f64, f64) = (3e3, 2e4);
/// Damping ratio of the coupling.
const COUPLING_DAMPING_RATIO: f64 = 0.06;

impl DrawnJoint {
    /// Draws a joint that hides these effects. Without a family, it is drawn too.
    ///
    /// # Errors
    /// Returns an error if the plant does not have an effect, or has it only in another family, or an effect is given
    /// twice.
    pub fn draw(
        seed: u64,
        hide: &[Hide],
        family: Option<FrictionFamily>,
    ) -> Result<Self, HideError> {
        let effects = hidden::requested(hide)?;
        let mut sampler = Sampler::new(seed, JOINT_PURPOSE);
        let drawn = sampler.pick(&FrictionFamily::ALL).unwrap_or_default();
        let family = hidden::family(&effects, family, drawn)?;
        let mut joint = Self::draw_clean(seed, &mut sampler, family);
        for (at, (cause, size)) in effects.into_iter().enumerate() {
            let mut sampler = Sampler::new(seed, EFFECT_PURPOSE + at as u64);
            let effect = hidden::draw(&mut sampler, cause, size, &joint)?;
            joint.add(effect, &mut sampler);
        }
        Ok(joint)
    }

    /// Draws a joint without hidden effects.
    fn draw_clean(seed: u64, sampler: &mut Sampler, family: FrictionFamily) -> Self {
        let friction_nm = sampler.log_between(0.6, 3.0);
        let constants = draw_constants(sampler, friction_nm);
        let known = draw_known(sampler, &constants);
        let surroundings = Surroundings {
            side_load_n: Course::constant(sampler.between(2.0, 40.0)),
            pressure_pa: Course::constant(sampler.between(1e4, 1.5e5)),
            water_c: Course::constant(constants.water_temperature_c),
        };
        Self {
            seed,
            family,
            constants,
            phase_rad: [sampler.between(0.0, TAU), sampler.between(0.0, TAU)],
            stribeck_exponent: HiddenCause::StribeckShape.neutral(),
            friction_nm,
            start_rad: sampler.between(-1.5, 1.5),
            hidden: Vec::new(),
            surroundings,
            sensors: JointSensors {
                has_seal_sensors: sampler.chance(0.5),
                has_thermometer: sampler.chance(0.5),
            },
            known,
        }
    }

    /// Adds an effect, and what it needs to be seen.
    fn add(&mut self, effect: DrawnCause, sampler: &mut Sampler) {
        let constants = &mut self.constants;
        match effect.effect {
            HiddenCause::UnmodelledInertia => constants.output_inertia_kg_m2 += effect.size,
            HiddenCause::Backlash => {
                constants.backlash_rad = effect.size;
                if constants.output_stiffness_nm_per_rad == 0.0 {
                    let (least, most) = COUPLING_NM_PER_RAD;
                    let stiffness = sampler.log_between(least, most);
                    constants.output_stiffness_nm_per_rad = stiffness;
                    constants.output_damping_nm_s_per_rad =
                        coupling_damping(stiffness, constants.output_inertia_kg_m2);
                }
            }
            HiddenCause::StribeckShape => self.stribeck_exponent = effect.size,
            HiddenCause::TemperatureViscous => {
                constants.film_per_kelvin = effect.size;
                constants.film_viscous_nm_s_per_rad =
                    hidden::viscous_nm_s_per_rad(self.friction_nm);
            }
            HiddenCause::TemperatureCoulomb => constants.level_per_kelvin = effect.size,
            _ => {}
        }
        match effect.effect.column() {
            Some("radial_force_n") => {
                self.sensors.has_seal_sensors = true;
                self.surroundings.side_load_n = hidden::side_load(sampler, effect.effect);
            }
            Some("pressure_diff_pa") => {
                self.sensors.has_seal_sensors = true;
                self.surroundings.pressure_pa = hidden::vary(sampler, hidden::PRESSURE_PA);
            }
            Some("temperature_c") => {
                self.sensors.has_thermometer = true;
                self.surroundings.water_c = hidden::vary(sampler, hidden::WATER_C);
            }
            _ => {}
        }
        // Without a thermometer, the effect is that of the heat alone.
        if effect.effect == HiddenCause::WarmUp {
            self.sensors.has_thermometer = false;
        }
        self.hidden.push(effect);
    }

    /// Returns the plant at its start: at rest at [`Self::start_rad`], with its effects and surroundings.
    pub fn plant(&self) -> JointPlant {
        let mut seal = Seal::of_family(self.family, &self.constants, self.phase_rad);
        seal.set_stribeck_exponent(self.stribeck_exponent);
        let mut joint = Joint::default();
        self.hidden.iter().for_each(|effect| effect.apply_to(&mut joint));
        let mut plant = JointPlant::with_seal(&self.constants, Load::Free, seal, self.seed);
        if !self.hidden.is_empty() {
            plant.seal.hide(joint.clone());
            plant.hidden = Some(joint);
        }
        plant.surround(self.surroundings);
        plant.place(self.start_rad);
        plant.watch_overcurrent();
        plant
    }
}

/// Draws the constants of a joint with this level of sliding friction, gear included, Nm.
fn draw_constants(sampler: &mut Sampler, friction_nm: f64) -> Parameters {
    let reference = Parameters::default();
    let gear_nm = friction_nm * sampler.between(0.08, 0.2);
    // Level of the reference seal per unit of its coefficient, Nm.
    let area_m2 = TAU * reference.shaft_radius_m * reference.seal_width_m;
    let pressed_nm = reference.seal_preload_pa * area_m2 * reference.shaft_radius_m;
    let friction_kinetic = (friction_nm - gear_nm) / pressed_nm;
    let gear_ratio = sampler.between(42.0, 62.0).round();
    let output_inertia_kg_m2 = sampler.log_between(0.015, 0.08);
    let is_flexible = sampler.chance(0.4);
    let stiffness = sampler.log_between(COUPLING_NM_PER_RAD.0, COUPLING_NM_PER_RAD.1);
    let water_temperature_c = sampler.between(6.0, 24.0);
    Parameters {
        gear_ratio,
        phase_resistance_ohm: reference.phase_resistance_ohm * sampler.between(0.92, 1.08),
        phase_inductance_h: reference.phase_inductance_h * sampler.between(0.92, 1.08),
        torque_constant_error: sampler.between(-0.06, 0.06),
        dead_time_s: sampler.between(0.2e-6, 0.5e-6),
        current_noise_a: sampler.between(0.02, 0.08),
        // The board's converter quantises.
        current_step_a: 1e-9,
        encoder_zero_rad: sampler.between(-PI, PI),
        encoder_direction: sampler.sign(),
        magnet_eccentricity_rad: sampler.between(0.0, 0.01),
        cogging_nm: sampler.log_between(2e-4, 2e-3),
        rotor_inertia_kg_m2: reference.rotor_inertia_kg_m2 * sampler.between(0.6, 1.4),
        output_inertia_kg_m2,
        gear_no_load_nm: gear_nm,
        // The losses of the gear belong to its constant share, unless load-torque-coulomb is hidden.
        gear_efficiency: 1.0,
        output_stiffness_nm_per_rad: if is_flexible { stiffness } else { 0.0 },
        output_damping_nm_s_per_rad: coupling_damping(stiffness, output_inertia_kg_m2),
        // Side load and pressure reach the level only as hidden effects, and so does the temperature.
        seal_overhang_m: 0.0,
        pressure_share: 0.0,
        film_per_kelvin: 0.0,
        level_per_kelvin: 0.0,
        friction_kinetic,
        friction_static: friction_kinetic * sampler.between(1.1, 1.6),
        stribeck_velocity_rad_s: sampler.log_between(0.03, 0.3),
        presliding_stiffness_nm_per_rad: friction_nm / sampler.log_between(2e-4, 1.2e-3),
        film_viscous_nm_s_per_rad: friction_nm * sampler.between(0.03, 0.2),
        eccentricity: sampler.between(0.0, 0.02),
        out_of_round: sampler.between(0.0, 0.01),
        water_temperature_c,
        ..reference
    }
}

/// Draws what the builder of a joint knows of its constants.
fn draw_known(sampler: &mut Sampler, constants: &Parameters) -> KnownConstants {
    let geared = constants.rotor_inertia_kg_m2 * constants.gear_ratio * constants.gear_ratio;
    let inertia = geared + constants.output_inertia_kg_m2;
    KnownConstants {
        torque_constant_nm_per_a: constants.motor_torque_constant_nm_per_a,
        inertia_kg_m2: inertia * sampler.between(0.8, 1.2),
        resistance_ohm: constants.phase_resistance_ohm * sampler.between(0.97, 1.03),
        inductance_h: constants.phase_inductance_h * sampler.between(0.95, 1.05),
        velocity_gain_factor: sampler.between(0.7, 1.3),
        position_gain_factor: sampler.between(0.7, 1.3),
    }
}

fn coupling_damping(stiffness: f64, inertia: f64) -> f64 {
    2.0 * COUPLING_DAMPING_RATIO * (stiffness * inertia).sqrt()
}

#[cfg(test)]
#[path = "drawn_tests.rs"]
mod tests;
