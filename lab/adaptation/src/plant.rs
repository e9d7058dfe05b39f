//! The joint: friction of a family that the law was not built from, an inertia, and what acts from outside.
//!
//! The integrator is this package's own: semi-implicit Euler with ten steps per period of the loop.

use crate::random::Random;
use simulated_machines::joint_plant::seal::{Around, Seal};
use simulated_machines::joint_plant::{DrawnJoint, FrictionFamily, Parameters};
use std::f64::consts::TAU;

/// Period of the loop, s.
pub const PERIOD_S: f64 = 1e-3;

const SUBSTEPS: usize = 10;

/// Coupling between motor and output of a joint with slack, Nm/rad and Nm s/rad.
const COUPLING: [f64; 2] = [6e3, 3.0];

/// What acts on the joint at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct World {
    /// Level of the seal relative to that at the start.
    pub wear: f64,
    /// Temperature of the water, deg C.
    pub water_c: f64,
    /// Pressure difference, Pa.
    pub pressure_pa: f64,
    /// Constant torque against positive motion, Nm.
    pub constant_nm: f64,
    /// Torque of gravity at the horizontal, Nm.
    pub gravity_nm: f64,
    /// Position of a wall, rad, and its stiffness, Nm/rad.
    pub wall: Option<[f64; 2]>,
    /// Slack between motor and output, rad.
    pub slack_rad: f64,
}

impl World {
    /// Returns the surroundings at the start: nothing acts.
    pub fn calm(water_c: f64) -> Self {
        Self {
            wear: 1.0,
            water_c,
            pressure_pa: 0.0,
            constant_nm: 0.0,
            gravity_nm: 0.0,
            wall: None,
            slack_rad: 0.0,
        }
    }
}

/// Position and velocity of a body.
#[derive(Clone, Copy, Debug, Default)]
struct Body {
    position_rad: f64,
    velocity_rad_s: f64,
}

/// The simulated joint.
#[derive(Clone, Debug)]
pub struct Plant {
    constants: Parameters,
    seal: Seal,
    rotor: Body,
    output: Body,
    rotor_inertia_kg_m2: f64,
    /// Motor and output are two bodies.
    has_coupling: bool,
    sensors: Random,
}

/// Measurements of a period.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// Position by the encoder on the motor, rad of the joint.
    pub encoder_rad: f64,
    /// Torque by the measured current, Nm.
    pub torque_nm: f64,
    /// Pressure difference, Pa.
    pub pressure_pa: f64,
}

/// Draws the constants of a joint. The temperature acts only if a drift needs it.
pub fn draw_constants(seed: u64) -> Option<(FrictionFamily, Parameters, [f64; 2])> {
    let joint = DrawnJoint::draw(seed, &[], None).ok()?;
    Some((joint.family, joint.constants, joint.phase_rad))
}

impl Plant {
    /// Creates a joint at rest at position 0.
    pub fn new(
        family: FrictionFamily,
        constants: &Parameters,
        phase_rad: [f64; 2],
        has_coupling: bool,
        seed: u64,
    ) -> Self {
        let mut seal = Seal::of_family(family, constants, phase_rad);
        seal.settle(&Around::default());
        Self {
            constants: *constants,
            seal,
            rotor: Body::default(),
            output: Body::default(),
            rotor_inertia_kg_m2: constants.rotor_inertia_kg_m2 * constants.gear_ratio.powi(2),
            has_coupling,
            sensors: Random::new(seed, 0x22),
        }
    }

    /// Returns the true inertia, kg m^2.
    pub fn inertia_kg_m2(&self) -> f64 {
        self.rotor_inertia_kg_m2 + self.constants.output_inertia_kg_m2
    }

    /// Returns the true position of the output, rad.
    pub fn position_rad(&self) -> f64 {
        self.output.position_rad
    }

    /// Returns the true velocity of the output, rad/s.
    pub fn velocity_rad_s(&self) -> f64 {
        self.output.velocity_rad_s
    }

    /// Returns the true friction torque, Nm.
    pub fn friction_nm(&self) -> f64 {
        self.seal.torque_nm()
    }

    /// Returns the true torque per torque that the driver knows.
    pub fn torque_gain(&self) -> f64 {
        1.0 + self.constants.torque_constant_error
    }

    /// Sets another source of the sensors' noise.
    pub fn reseed(&mut self, seed: u64) {
        self.sensors = Random::new(seed, 0x22);
    }

    /// Applies a torque for a period, and measures at its end.
    pub fn step(&mut self, world: &World, torque_nm: f64) -> Measured {
        self.seal.set_wear(world.wear);
        self.seal.set_water(world.water_c);
        let around = Around { pressure_diff_pa: world.pressure_pa, ..Around::default() };
        let dt = PERIOD_S / SUBSTEPS as f64;
        for _ in 0..SUBSTEPS {
            self.substep(world, &around, self.torque_gain() * torque_nm, dt);
        }
        let p = &self.constants;
        let count_rad = TAU / p.encoder_counts / p.gear_ratio;
        let counts = self.rotor.position_rad / count_rad + 0.5 * self.sensors.normal();
        // The noise of the current at 1 Nm/A, of a sample per period.
        let noise_nm = p.current_noise_a * self.sensors.normal();
        Measured {
            encoder_rad: counts.floor() * count_rad,
            torque_nm: torque_nm + noise_nm,
            pressure_pa: world.pressure_pa + 3e3 * self.sensors.normal(),
        }
    }

    fn substep(&mut self, world: &World, around: &Around, motor_nm: f64, dt: f64) {
        let p = &self.constants;
        let angle = p.cogging_periods * self.rotor.position_rad * p.gear_ratio;
        let motor_nm = motor_nm - p.cogging_nm * p.gear_ratio * angle.sin();
        let Body { position_rad, velocity_rad_s } = self.output;
        let mut outside_nm = world.constant_nm + world.gravity_nm * position_rad.cos();
        if let Some([at_rad, stiffness]) = world.wall {
            let pressed_rad = position_rad - at_rad;
            // A wall damps little, and does not pull.
            let push_nm = stiffness * pressed_rad + 1e-3 * stiffness * velocity_rad_s;
            outside_nm += if pressed_rad > 0.0 { push_nm.max(0.0) } else { 0.0 };
        }
        let friction_nm = self.seal.step(velocity_rad_s, position_rad, around, dt);
        let (driving_nm, inertia) = if self.has_coupling {
            let twist_rad = self.rotor.position_rad - position_rad;
            let half_rad = 0.5 * world.slack_rad;
            let strained_rad = twist_rad - twist_rad.clamp(-half_rad, half_rad);
            let is_engaged = strained_rad != 0.0;
            let rate = self.rotor.velocity_rad_s - velocity_rad_s;
            let coupled_nm =
                if is_engaged { COUPLING[0] * strained_rad + COUPLING[1] * rate } else { 0.0 };
            self.rotor.velocity_rad_s += dt * (motor_nm - coupled_nm) / self.rotor_inertia_kg_m2;
            self.rotor.position_rad += dt * self.rotor.velocity_rad_s;
            (coupled_nm, p.output_inertia_kg_m2)
        } else {
            (motor_nm, self.inertia_kg_m2())
        };
        self.output.velocity_rad_s += dt * (driving_nm - friction_nm - outside_nm) / inertia;
        self.output.position_rad += dt * self.output.velocity_rad_s;
        if !self.has_coupling {
            self.rotor = self.output;
        }
    }
}
