//! The joint: friction of a family that the law was not built from, an inertia, and what acts from outside.
//!
//! It is that of [`simulated_machines::joint_plant`] at an ideal current, with ten steps per period of the loop.

use simulated_machines::effects::Wave;
use simulated_machines::joint::Joint;
use simulated_machines::joint_plant::seal::Seal;
use simulated_machines::joint_plant::{FrictionFamily, JointPlant, Load, Parameters};
use simulated_machines::sampler::Sampler;
use std::f64::consts::TAU;

/// Period of the loop, s.
pub const PERIOD_S: f64 = 1e-3;

const SUBSTEPS: usize = 10;

/// Stiffness of the coupling between motor and output of a joint with slack, Nm/rad.
const COUPLING_NM_PER_RAD: f64 = 6e3;
/// Damping of this coupling, Nm s/rad.
const COUPLING_NM_S_PER_RAD: f64 = 3.0;
/// Noise of the pressure sensor, Pa.
const PRESSURE_NOISE_PA: f64 = 3e3;

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
    /// Load of the output.
    pub load: Load,
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
            load: Load::Free,
            slack_rad: 0.0,
        }
    }
}

/// The simulated joint.
#[derive(Clone, Debug)]
pub struct Plant {
    constants: Parameters,
    joint: JointPlant,
    sensors: Sampler,
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

impl Plant {
    /// Creates a joint at rest at position 0.
    pub fn new(
        family: FrictionFamily,
        constants: &Parameters,
        phase_rad: [f64; 2],
        has_coupling: bool,
        seed: u64,
    ) -> Self {
        let coupling = f64::from(u8::from(has_coupling));
        let constants = Parameters {
            output_stiffness_nm_per_rad: coupling * COUPLING_NM_PER_RAD,
            output_damping_nm_s_per_rad: coupling * COUPLING_NM_S_PER_RAD,
            backlash_rad: 0.0,
            ..*constants
        };
        let seal = Seal::of_family(family, &constants, phase_rad);
        let mut joint = JointPlant::with_seal(&constants, Load::Free, seal, seed);
        joint.set_substeps(SUBSTEPS);
        Self { constants, joint, sensors: sensors(seed) }
    }

    /// Returns the true inertia, kg m^2.
    pub fn inertia_kg_m2(&self) -> f64 {
        self.joint.inertia_kg_m2()
    }

    /// Returns the true position of the output, rad.
    pub fn position_rad(&self) -> f64 {
        self.joint.position_rad()
    }

    /// Returns the true velocity of the output, rad/s.
    pub fn velocity_rad_s(&self) -> f64 {
        self.joint.velocity_rad_s()
    }

    /// Returns the true friction torque, Nm.
    pub fn friction_nm(&self) -> f64 {
        self.joint.friction_nm()
    }

    /// Returns the true torque per torque that the driver knows.
    pub fn torque_gain(&self) -> f64 {
        1.0 + self.constants.torque_constant_error
    }

    /// Sets another source of the sensors' noise.
    pub fn reseed(&mut self, seed: u64) {
        self.sensors = sensors(seed);
    }

    /// Applies a torque for a period, and measures at its end.
    pub fn step(&mut self, world: &World, torque_nm: f64) -> Measured {
        let gravity = Wave { size: world.gravity_nm, order: 1.0, phase: 0.25 * TAU };
        let outside =
            Joint { offset_nm: world.constant_nm, gravity: Some(gravity), ..Joint::default() };
        let joint = &mut self.joint;
        joint.seal.set_wear(world.wear);
        joint.seal.set_water(world.water_c);
        joint.around.pressure_diff_pa = world.pressure_pa;
        joint.set_backlash(world.slack_rad);
        joint.load = world.load;
        joint.hidden = Some(outside);
        let p = &self.constants;
        let current_a = torque_nm / (p.motor_torque_constant_nm_per_a * p.gear_ratio);
        joint.period_at_current(PERIOD_S, current_a);
        let count_rad = TAU / p.encoder_counts / p.gear_ratio;
        let counts = joint.motor_position_rad() / count_rad + 0.5 * self.sensors.normal();
        // The noise of the current at 1 Nm/A, of a sample per period.
        let noise_nm = p.current_noise_a * self.sensors.normal();
        Measured {
            encoder_rad: counts.floor() * count_rad,
            torque_nm: torque_nm + noise_nm,
            pressure_pa: world.pressure_pa + PRESSURE_NOISE_PA * self.sensors.normal(),
        }
    }
}

fn sensors(seed: u64) -> Sampler {
    course_sampler(seed, Purpose::Sensors)
}

/// What random numbers are drawn for.
#[derive(Clone, Copy, Debug)]
pub enum Purpose {
    /// The motion in service.
    Motion = 0x11,
    /// The noise of the sensors.
    Sensors = 0x22,
    /// A joint and its habits.
    Joint = 0x33,
    /// The constants that a drift needs.
    Drift = 0x44,
    /// The time and the wear of a new seal.
    Seal = 0x55,
    /// The pressure that a joint with a term of it depends on.
    Pressure = 0x66,
    /// The lies of a course, with their times and sizes.
    Lies = 0x77,
    /// The noise that lies add.
    LieNoise = 0x88,
}

/// Returns an independent source of random numbers for each pair of a seed and a purpose.
pub fn course_sampler(seed: u64, purpose: Purpose) -> Sampler {
    Sampler::of(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ ((purpose as u64) << 40))
}
