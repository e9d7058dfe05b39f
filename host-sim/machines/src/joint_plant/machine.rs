//! Motor, bridge, shaft and load in motion: what a current loop is connected to.
//!
//! Winding currents are integrated in the stationary frame, exactly over a sub-step for constant voltage and
//! back-EMF; the bridge gives each phase its mean voltage less what the dead time takes, and open its diodes drive
//! the currents to 0. Gear and shaft are one inertia. Two sub-steps of semi-implicit Euler in a period of 50 us; a test holds
//! them against twenty.

use super::load::{Acting, Load};
use super::parameters::Parameters;
use super::seal::{Around, Seal};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Sub-steps of a period.
const SUBSTEPS: usize = 2;

/// Currents below this are not told apart by the dead time: the bridge's output is a ramp there, A.
const DEAD_TIME_RAMP_A: f64 = 0.1;

/// What a power stage and its encoder measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Currents of phases a, b, c, A, with noise, rounded to the converter's steps.
    pub currents_a: [f64; 3],
    /// Bus voltage, V.
    pub bus_v: f64,
    /// Encoder on the motor, counts of a turn.
    pub encoder: u32,
}

/// What sensors at the joint show, beside the drive's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Side load, N.
    pub radial_force_n: f64,
    /// Pressure difference, Pa.
    pub pressure_diff_pa: f64,
    /// Housing beside the seal, deg C.
    pub temperature_c: f64,
    /// Torque on the load, Nm, as a model of the load knows it: without noise.
    pub load_torque_nm: f64,
}

/// The machine.
#[derive(Clone, Debug)]
pub struct JointPlant {
    p: Parameters,
    load: Load,
    seal: Seal,
    around: Around,
    acting: Acting,
    /// Currents along and across phase a, A.
    current: [f64; 2],
    position: f64,
    velocity: f64,
    inertia: f64,
    substeps: usize,
    /// Sub-step the next two are for, s; what a winding keeps of its current in it; its share of a new one, 1/ohm.
    step_s: f64,
    kept: f64,
    admittance: f64,
    /// Share of its own friction that an ideal actuator gives back: the perfect model.
    cancelled: f64,
    /// A stand holds the output.
    held: bool,
    random: Pcg64,
}

impl JointPlant {
    /// A machine at rest with this load on it, under water; the seed draws its sensors' noise and where the
    /// eccentricity lies.
    pub fn new(p: &Parameters, load: Load, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let phase = [random.random_range(0.0..TAU), random.random_range(0.0..TAU)];
        Self::with_phase(p, load, phase, seed)
    }

    /// As [`JointPlant::new`], with a known angle of the eccentricity and the out-of-roundness, rad: the same
    /// machine again.
    pub fn with_phase(p: &Parameters, load: Load, phase_rad: [f64; 2], seed: u64) -> Self {
        let around = Around { pressure_diff_pa: p.pool_pressure_pa, ..Around::default() };
        let mut seal = Seal::new(p, phase_rad);
        let mut load = load;
        let position = load.start_rad();
        let acting = load.act(p, position, 0.0, 0.0);
        let around = Around {
            radial_force_n: acting.radial_force_n,
            load_torque_nm: acting.torque_nm,
            ..around
        };
        seal.settle(&around);
        let geared = p.rotor_inertia_kg_m2 * p.gear_ratio * p.gear_ratio;
        Self {
            inertia: geared + p.output_inertia_kg_m2 + load.inertia_kg_m2(p),
            p: *p,
            load,
            seal,
            around,
            acting,
            current: [0.0; 2],
            position,
            velocity: 0.0,
            substeps: SUBSTEPS,
            step_s: 0.0,
            kept: 0.0,
            admittance: 0.0,
            cancelled: 0.0,
            held: false,
            random: Pcg64::seed_from_u64(seed ^ 0x5eed),
        }
    }

    /// Takes so many sub-steps a period.
    pub fn set_substeps(&mut self, substeps: usize) {
        self.substeps = substeps.max(1);
        self.step_s = 0.0;
    }

    /// Lets an ideal actuator give back this share of the friction, a sub-step late: what no model can beat.
    pub fn cancel_friction(&mut self, share: f64) {
        self.cancelled = share;
    }

    /// A stand holds the output, or lets go of it.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Pressure from now on, Pa.
    pub fn set_pressure(&mut self, pressure_diff_pa: f64) {
        self.around.pressure_diff_pa = pressure_diff_pa;
    }

    /// The seal, to be warmed or worn.
    pub fn seal_mut(&mut self) -> &mut Seal {
        &mut self.seal
    }

    /// The seal.
    pub fn seal(&self) -> &Seal {
        &self.seal
    }

    /// The load.
    pub fn load(&self) -> &Load {
        &self.load
    }

    /// Joint position, rad.
    pub fn position_rad(&self) -> f64 {
        self.position
    }

    /// Joint velocity, rad/s.
    pub fn velocity_rad_s(&self) -> f64 {
        self.velocity
    }

    /// What acts on the seal.
    pub fn around(&self) -> Around {
        self.around
    }

    /// Inertia at the joint, kg m^2.
    pub fn inertia_kg_m2(&self) -> f64 {
        self.inertia
    }

    /// What its stage measures now.
    pub fn measure(&mut self) -> Measured {
        let [along, across] = self.current;
        let root = 0.75f64.sqrt();
        let phases = [along, -0.5 * along + root * across, -0.5 * along - root * across];
        let step = self.p.current_step_a;
        let currents_a = phases.map(|current| {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            ((current + self.p.current_noise_a * noise) / step).round() * step
        });
        let turns = self.position * self.p.gear_ratio / TAU;
        let encoder = ((turns - turns.floor()) * self.p.encoder_counts) as u32;
        Measured { currents_a, bus_v: self.p.bus_voltage_v, encoder }
    }

    /// What the joint's other sensors show now.
    pub fn show(&mut self) -> Shown {
        let mut noisy = |value: f64, deviation: f64| {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            value + deviation * noise
        };
        Shown {
            radial_force_n: noisy(self.around.radial_force_n, self.p.force_noise_n),
            pressure_diff_pa: noisy(self.around.pressure_diff_pa, self.p.pressure_noise_pa),
            temperature_c: self.seal.shown_temperature_c(),
            load_torque_nm: self.acting.torque_nm,
        }
    }

    /// One period (s) under these duties, or with the bridge open.
    pub fn period(&mut self, period_s: f64, duty: Option<[f64; 3]>) {
        let dt = period_s / self.substeps as f64;
        if self.step_s != dt {
            let decay = self.p.phase_resistance_ohm / self.p.phase_inductance_h * dt;
            (self.step_s, self.kept) = (dt, (-decay).exp());
            self.admittance = (1.0 - self.kept) / self.p.phase_resistance_ohm;
        }
        let poles = self.p.gear_ratio * self.p.pole_pairs;
        let constant = self.p.motor_torque_constant_nm_per_a * (1.0 + self.p.torque_constant_error);
        let flux = constant / (1.5 * self.p.pole_pairs);
        for _ in 0..self.substeps {
            let voltage = self.voltage(period_s, duty);
            // Half a sub-step on: the field turns under the voltage.
            let angle = poles * (self.position + 0.5 * dt * self.velocity);
            let (sine, cosine) = angle.sin_cos();
            let induced = flux * poles * self.velocity;
            let [along, across] = self.current;
            self.current = [
                self.kept * along + self.admittance * (voltage[0] + induced * sine),
                self.kept * across + self.admittance * (voltage[1] - induced * cosine),
            ];
            let turning = self.current[1] * cosine - self.current[0] * sine;
            self.move_on(constant * self.p.gear_ratio * turning, dt);
        }
    }

    /// One period (s) with an ideal current loop that makes so many ampere, gear and magnet as they are.
    pub fn period_at_current(&mut self, period_s: f64, current_a: f64) {
        let dt = period_s / self.substeps as f64;
        let constant = self.p.motor_torque_constant_nm_per_a * (1.0 + self.p.torque_constant_error);
        for _ in 0..self.substeps {
            self.move_on(constant * self.p.gear_ratio * current_a, dt);
        }
    }

    /// Mean voltage of the bridge along and across phase a, V.
    fn voltage(&self, period_s: f64, duty: Option<[f64; 3]>) -> [f64; 2] {
        let [along, across] = self.current;
        let root = 0.75f64.sqrt();
        let currents = [along, -0.5 * along + root * across, -0.5 * along - root * across];
        let bus = self.p.bus_voltage_v;
        let lost = bus * self.p.dead_time_s / period_s;
        let ramp = |current: f64| (current / DEAD_TIME_RAMP_A).clamp(-1.0, 1.0);
        let [a, b, c]: [f64; 3] = std::array::from_fn(|phase| match duty {
            Some(duty) => duty[phase] * bus - lost * ramp(currents[phase]),
            None => -0.5 * bus * ramp(0.2 * currents[phase]),
        });
        [(2.0 * a - b - c) / 3.0, (b - c) / 3f64.sqrt()]
    }

    fn move_on(&mut self, motor_nm: f64, dt: f64) {
        if self.held {
            return;
        }
        self.acting = self.load.act(&self.p, self.position, self.velocity, dt);
        self.around.radial_force_n = self.acting.radial_force_n;
        self.around.load_torque_nm = self.acting.torque_nm;
        let given_back = self.cancelled * self.seal.torque_nm();
        let friction = self.seal.step(self.velocity, self.position, &self.around, dt);
        let torque = motor_nm + given_back - friction - self.acting.torque_nm;
        self.velocity += dt * torque / self.inertia;
        self.position += dt * self.velocity;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: f64 = 50e-6;

    /// Position and velocity after a push of so many ampere there and back.
    fn pushed(substeps: usize, load: Load) -> (f64, f64) {
        let mut plant = JointPlant::new(&Parameters::default(), load, 1);
        plant.set_substeps(substeps);
        for k in 0..10_000 {
            let t = f64::from(k) * PERIOD;
            plant.period_at_current(PERIOD, 9.0 * (TAU * 2.0 * t).sin());
        }
        (plant.position_rad(), plant.velocity_rad_s())
    }

    #[test]
    fn two_substeps_do_as_twenty() {
        for load in [Load::Free, Load::Propeller, Load::Leg, Load::jump(&Parameters::default())] {
            let (coarse, fine) = (pushed(2, load), pushed(20, load));
            assert!((coarse.0 - fine.0).abs() < 3e-3, "{load:?}: {coarse:?}, {fine:?}");
            assert!((coarse.1 - fine.1).abs() < 3e-2, "{load:?}: {coarse:?}, {fine:?}");
        }
    }

    #[test]
    fn it_sticks_below_the_breakaway_and_turns_above() {
        let turned = |current: f64| {
            let mut plant = JointPlant::new(&Parameters::default(), Load::Free, 1);
            (0..20_000).for_each(|_| plant.period_at_current(PERIOD, current));
            plant.position_rad()
        };
        assert!(turned(1.5) < 0.01, "{}", turned(1.5));
        assert!(turned(3.5) > 0.5, "{}", turned(3.5));
    }

    #[test]
    fn the_winding_settles_at_voltage_over_resistance() {
        let p = Parameters { dead_time_s: 0.0, ..Parameters::default() };
        let mut plant = JointPlant::new(&p, Load::Free, 1);
        // 0.13 V along phase a: 1 A along it, at 0 rad no torque.
        let part = 0.13 / p.bus_voltage_v;
        let duty = [0.5 + part, 0.5 - 0.5 * part, 0.5 - 0.5 * part];
        (0..400).for_each(|_| plant.period(PERIOD, Some(duty)));
        assert!((plant.current[0] - 1.0).abs() < 1e-3, "{:?}", plant.current);
        assert!(plant.current[1].abs() < 1e-3 && plant.velocity_rad_s().abs() < 1e-3);
    }

    #[test]
    fn a_platform_pushed_fast_flies_and_lands() {
        let p = Parameters::default();
        let mut plant = JointPlant::new(&p, Load::jump(&p), 1);
        let (mut flew, mut hit) = (false, 0.0f64);
        for k in 0..30_000 {
            // Hard up, then limp: a leg that is held gives way as softly as it is held.
            plant.period_at_current(PERIOD, if k < 1600 { 24.0 } else { 0.0 });
            flew |= plant.around().radial_force_n == 0.0;
            if flew {
                hit = hit.max(plant.around().radial_force_n);
            }
        }
        assert!(flew && hit > 2.0 * p.platform_weight_n, "flew {flew}, landed with {hit} N");
    }
}
