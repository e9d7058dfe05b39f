//! Friction between motor and output: the seal and the gear.
//!
//! The model is not LuGre. It contains:
//!
//! - a contact with presliding and memory, of one of three families ([`super::contact`]).
//! - a viscous film that thins with speed and is heated by its losses.
//! - a level that grows less than proportionally with the normal force.
//! - a side load that reaches the ring through the bent shaft ([`super::shaft`]), with creep.
//! - an eccentric and out-of-round ring.
//! - a gear that loses a share of the transmitted torque.
//!
//! The integration is semi-implicit Euler.

pub use super::around::Around;
use super::contact::{Contact, FrictionFamily, Pressing};
use super::effects::{LevelChange, LevelEffects};
use super::parameters::Parameters;
use super::shaft::Shaft;
use crate::joint::Joint;

/// Number of steps per update of the thermal states.
const THERMAL_DIVIDER: u32 = 20;

/// State of seal and gear.
#[derive(Clone, Debug)]
pub struct Seal {
    p: Parameters,
    shaft: Shaft,
    contact: Contact,
    gear: f64,
    /// Temperature of the film and reading of the thermometer, deg C.
    film_c: f64,
    shown_c: f64,
    /// Side load after creep, N, and the last side load, N.
    crept_n: f64,
    last_n: f64,
    /// Normal force for which the level was last computed, N, and the gain relative to the unloaded level.
    normal_n: f64,
    gain: f64,
    /// Viscosity and level relative to those at 20 deg C.
    viscosity: f64,
    softness: f64,
    lost_j: f64,
    steps: u32,
    /// Level relative to that of a new seal.
    wear: f64,
    /// Angle of the eccentricity, rad; sine and cosine of that of the out-of-roundness.
    eccentric_rad: f64,
    round: (f64, f64),
    effects: Option<Box<LevelEffects>>,
    torque_nm: f64,
}

impl Seal {
    /// Creates an unloaded seal at rest at the water temperature.
    ///
    /// `phase_rad` holds the angles of the eccentricity and the out-of-roundness, rad.
    pub fn new(p: &Parameters, phase_rad: [f64; 2]) -> Self {
        Self::of_family(FrictionFamily::default(), p, phase_rad)
    }

    /// Creates a seal as [`Seal::new`] with friction of this family.
    pub fn of_family(family: FrictionFamily, p: &Parameters, phase_rad: [f64; 2]) -> Self {
        let shaft = Shaft::of(p);
        let unit_nm = p.seal_preload_pa * shaft.contact_area_m2 * p.shaft_radius_m;
        let mut seal = Self {
            p: *p,
            shaft,
            contact: Contact::new(family, p, unit_nm),
            gear: 0.0,
            film_c: p.water_temperature_c,
            shown_c: p.water_temperature_c,
            crept_n: 0.0,
            last_n: 0.0,
            normal_n: 0.0,
            gain: 1.0,
            viscosity: 1.0,
            softness: 1.0,
            lost_j: 0.0,
            steps: 0,
            wear: 1.0,
            eccentric_rad: phase_rad[0],
            round: phase_rad[1].sin_cos(),
            effects: None,
            torque_nm: 0.0,
        };
        seal.update_temperature_factors();
        seal
    }

    /// Sets the temperature of film and thermometer, deg C.
    pub fn set_temperature(&mut self, celsius: f64) {
        (self.film_c, self.shown_c) = (celsius, celsius);
        self.update_temperature_factors();
    }

    /// Sets the creep state to the steady state of the present side load.
    pub fn settle(&mut self, around: &Around) {
        (self.crept_n, self.last_n) = (around.radial_force_n, around.radial_force_n);
    }

    /// Sets the wear: the level relative to that of a new seal.
    pub fn set_wear(&mut self, wear: f64) {
        self.wear = wear;
    }

    /// Sets the exponent of the Stribeck curve; 1 by default. Only [`FrictionFamily::MaxwellSlip`] has one.
    pub fn set_stribeck_exponent(&mut self, exponent: f64) {
        self.contact.set_stribeck_exponent(exponent);
    }

    /// Adds the effects of a joint to the friction, or replaces those added before.
    pub fn hide(&mut self, joint: Joint) {
        self.effects = Some(Box::new(LevelEffects::of(joint)));
    }

    /// Sets the temperature of the water, deg C.
    pub fn set_water(&mut self, celsius: f64) {
        self.p.water_temperature_c = celsius;
    }

    /// Returns the reading of the thermometer near the seal, deg C.
    pub fn shown_temperature_c(&self) -> f64 {
        self.shown_c
    }

    /// Returns the friction torque of seal and gear, Nm, positive against positive motion.
    pub fn torque_nm(&self) -> f64 {
        self.torque_nm
    }

    /// Integrates by `dt` (s) at a velocity (rad/s) and position (rad). Returns the friction torque, Nm.
    pub fn step(&mut self, velocity: f64, position: f64, around: &Around, dt: f64) -> f64 {
        let p = &self.p;
        let speed = velocity.abs();
        // The energiser, the water and the bent shaft press the ring. The force of the shaft creeps.
        let load = around.radial_force_n;
        let rate = (load - self.last_n) / dt;
        self.last_n = load;
        self.crept_n += dt / p.relaxation_s * (load - self.crept_n);
        let pressing = self.crept_n + p.relaxation_overshoot * (load - self.crept_n);
        let area = self.shaft.contact_area_m2;
        let unloaded = p.seal_preload_pa * area;
        let normal = unloaded
            + p.pressure_share * around.pressure_diff_pa * area
            + self.shaft.normal_per_load * pressing.abs();
        if (normal - self.normal_n).abs() > 1e-5 * unloaded {
            self.normal_n = normal;
            self.gain = (normal / unloaded).powf(p.load_exponent);
        }
        let (sine, cosine) = (position + self.eccentric_rad).sin_cos();
        let (twice_sine, twice_cosine) = (2.0 * sine * cosine, 1.0 - 2.0 * sine * sine);
        let (s2, c2) = self.round;
        let round =
            1.0 + p.eccentricity * sine + p.out_of_round * (twice_sine * c2 + twice_cosine * s2);
        let new = unloaded * p.shaft_radius_m * self.gain * self.wear * self.softness * round;
        let change = match &mut self.effects {
            Some(effects) => effects.step(velocity, position, around, rate, dt),
            None => LevelChange::NONE,
        };
        let pressing = Pressing {
            unit_nm: new,
            factor: change.factor,
            raised_nm: change.raised_nm,
            viscosity: self.viscosity,
        };
        // Radial motion also shears the contact.
        let sheared = velocity
            + p.radial_coupling_rad_per_m * self.shaft.displacement_per_load_m_per_n * rate
            + change.sheared_rad_s;
        let held = self.contact.step(p, &pressing, velocity, sheared, dt);
        let viscous = p.film_viscous_nm_s_per_rad * self.viscosity * velocity
            / (1.0 + speed / p.film_thinning_rad_s)
            * change.viscous_factor;
        let seal = held + viscous;
        let transmitted = (seal + around.load_torque_nm).abs();
        let most = p.gear_no_load_nm + (1.0 - p.gear_efficiency) * transmitted;
        self.gear = (self.gear + p.gear_stiffness_nm_per_rad * velocity * dt).max(-most).min(most);
        self.lost_j += (seal * velocity * dt).max(0.0);
        self.steps += 1;
        if self.steps >= THERMAL_DIVIDER {
            self.heat(dt * f64::from(THERMAL_DIVIDER));
        }
        self.torque_nm = seal + self.gear;
        self.torque_nm
    }

    /// Advances the thermal states by `dt` (s).
    fn heat(&mut self, dt: f64) {
        let p = &self.p;
        let power = self.lost_j / dt;
        if let Some(effects) = &mut self.effects {
            effects.advance(power, dt);
        }
        let lost = (self.film_c - p.water_temperature_c) / p.film_resistance_k_per_w;
        self.film_c += dt * (power - lost) / p.film_heat_capacity_j_per_k;
        self.shown_c += dt / p.thermometer_lag_s * (self.film_c - self.shown_c);
        (self.lost_j, self.steps) = (0.0, 0);
        self.update_temperature_factors();
    }

    /// Updates viscosity and level for the film temperature.
    fn update_temperature_factors(&mut self) {
        let above = self.film_c - 20.0;
        self.viscosity = (-self.p.film_per_kelvin * above).exp();
        self.softness = (-self.p.level_per_kelvin * above).exp();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f64 = 25e-6;

    fn sliding(velocity: f64, around: Around) -> f64 {
        let mut seal = Seal::new(&Parameters::default(), [0.0; 2]);
        seal.settle(&around);
        let steps = 20_000;
        let torques = (0..steps).map(|_| seal.step(velocity, 0.0, &around, DT));
        torques.last().unwrap_or_default()
    }

    #[test]
    fn step_when_sliding_returns_torque_of_the_paper_that_grows_with_load_and_pressure() {
        let rpm = std::f64::consts::TAU / 60.0;
        let low = Around { radial_force_n: 30.0, pressure_diff_pa: 0.02e6, load_torque_nm: 0.0 };
        let high = Around { radial_force_n: 50.0, pressure_diff_pa: 0.28e6, load_torque_nm: 0.0 };
        let plain = sliding(35.0 * rpm, Around::default());
        let (least, most) = (sliding(35.0 * rpm, low), sliding(100.0 * rpm, high));
        assert!(plain < least && least < most, "{plain}, {least}, {most}");
        // The paper's 2 to 3.5 Nm (II-B).
        assert!(least > 1.8 && most < 3.7, "{least}, {most}");
        assert!((sliding(-35.0 * rpm, low) + least).abs() < 1e-9, "the friction is symmetric");
    }

    #[test]
    fn step_with_small_stroke_behaves_as_spring() {
        let mut seal = Seal::new(&Parameters::default(), [0.0; 2]);
        let around = Around::default();
        // A stroke of 1e-4 rad on a spring of about 4000 Nm/rad and the gear with 2e4 Nm/rad.
        let there = (0..1000).map(|_| seal.step(0.004, 0.0, &around, DT)).last().unwrap();
        assert!((0.4..2.4).contains(&there), "{there}");
        let back = (0..1000).map(|_| seal.step(-0.004, 0.0, &around, DT)).last().unwrap();
        assert!(back.abs() < 0.6 * there, "{back} of {there}: mostly recovered");
    }

    #[test]
    fn step_after_warm_up_returns_smaller_torque() {
        let mut seal = Seal::new(&Parameters::default(), [0.0; 2]);
        let run = |seal: &mut Seal, seconds: f64| {
            let steps = (seconds / DT) as usize;
            (0..steps).map(|_| seal.step(8.0, 0.0, &Around::default(), DT)).last().unwrap()
        };
        let (cold, warm) = (run(&mut seal, 1.0), run(&mut seal, 60.0));
        assert!(warm < 0.97 * cold && warm > 0.7 * cold, "{cold} -> {warm}");
        assert!(seal.shown_temperature_c() > 20.0);
    }
}
