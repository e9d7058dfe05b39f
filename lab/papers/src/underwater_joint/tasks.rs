//! The tasks of the joint with the shipped driver: follow a sine, lift slowly, jump.
//!
//! Velocity and position loops run above the driver at 1 kHz, as on a robot's own computer, on the velocity and position
//! that the driver sends. They are the same for every arm and designed by rule before any measurement. The velocity loop
//! crosses at [`VELOCITY_HZ`] for the nominal inertia and integrates slowly ([`INTEGRAL_S`]), so that it does not hide a wrong
//! compensation. The position loop is slower by [`POSITION_SHARE`]. Feedforward compensates the known rigid body (inertia, weight);
//! otherwise the lag of the loop would hide differences between good friction models.

use super::arms::DriverArm;
use crate::PaperError;
use firmware::supervisor::Code;
use joint_rig::{JointRig, RigFaults, run_armed};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters, load};
use std::f64::consts::TAU;

/// Crossover of the velocity loop, Hz.
const VELOCITY_HZ: f64 = 2.0;
/// Integral time of the velocity loop, s.
const INTEGRAL_S: f64 = 1.0;
/// Crossover of the position loop over that of the velocity loop.
const POSITION_SHARE: f64 = 0.5;
/// Period of the master, s.
const PERIOD_S: f64 = 1e-3;
/// Largest current command, A: the driver's own limit.
const MAX_CURRENT_A: f64 = 26.0;

/// One revolution per minute, rad/s.
pub const RPM: f64 = TAU / 60.0;

/// Recorded course of the plant, one row per millisecond from the start of the task.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    /// Time from the start of the task, s.
    pub time_s: Vec<f64>,
    /// Reference velocity, rad/s.
    pub reference_rad_s: Vec<f64>,
    /// Reference position, rad.
    pub reference_rad: Vec<f64>,
    /// True velocity, rad/s.
    pub velocity_rad_s: Vec<f64>,
    /// True position, rad.
    pub position_rad: Vec<f64>,
    /// Current reported by the driver, A.
    pub current_a: Vec<f64>,
    /// The driver stopped the joint.
    pub stopped: bool,
    /// Time from the start until the watch first reported "model out of band", s; 0 if it did so before the start.
    pub out_of_band_s: Option<f64>,
}

/// A task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// 65 to 95 rpm, a sine of 5 s, against a propeller.
    VelocityTracking,
    /// 6.6 rpm, lifting 2 kg.
    LowSpeed,
    /// A jump to a target position.
    Impact,
    /// Holding 2 kg after a small move, to detect limit cycles; not in the paper.
    Hold,
}

/// Speed of the low-speed task, rad/s.
pub const LOW_SPEED_RAD_S: f64 = 6.6 * RPM;
/// Target of the jump, rad, with its maximum speed, rad/s, and acceleration, rad/s^2; the same for all arms.
pub const TARGET_RAD: f64 = 1.0;
const JUMP_RAD_S: f64 = 8.0;
const JUMP_RAD_S2: f64 = 60.0;
/// Time for which the master controls the joint before a leg moves, s.
const HOLD_S: f64 = 0.5;
/// Time for the propeller to reach its speed, which is not evaluated, s.
const SPIN_UP_S: f64 = 1.5;

impl Task {
    /// Returns the heading of the task.
    pub fn title(self) -> &'static str {
        match self {
            Self::VelocityTracking => "Velocity tracking, 65 to 95 rpm",
            Self::LowSpeed => "Lifting 2 kg at 6.6 rpm",
            Self::Impact => "Jump with impact",
            Self::Hold => "Holding 2 kg",
        }
    }

    /// Returns the paper's figure.
    pub fn figure(self) -> &'static str {
        match self {
            Self::VelocityTracking => "Fig. 9",
            Self::LowSpeed => "Fig. 10",
            Self::Impact => "Fig. 11",
            Self::Hold => "holding",
        }
    }

    /// Returns the length, s.
    pub fn seconds(self) -> f64 {
        match self {
            Self::VelocityTracking => 25.0,
            Self::LowSpeed => 3.6,
            Self::Impact => 1.5,
            Self::Hold => 3.0,
        }
    }

    /// Returns the time before the start, s.
    fn lead_in_s(self) -> f64 {
        if self == Self::VelocityTracking { SPIN_UP_S } else { HOLD_S }
    }

    /// Returns the load on the output.
    pub fn load(self, p: &Parameters) -> Load {
        match self {
            Self::VelocityTracking => Load::Propeller,
            Self::LowSpeed | Self::Hold => Load::Leg,
            Self::Impact => Load::jump(p),
        }
    }

    /// Returns the reference at a time from the start.
    fn reference(self, t: f64) -> Reference {
        match self {
            Self::VelocityTracking => {
                let w = TAU / 5.0;
                let now = t.max(0.0);
                let (sine, cosine) = (w * now).sin_cos();
                let share = (t + SPIN_UP_S).clamp(0.0, 1.0);
                let velocity = (80.0 + 15.0 * sine) * RPM * share;
                let spinning = if share < 1.0 { 80.0 * RPM } else { 0.0 };
                let swinging = if t > 0.0 { 15.0 * RPM * w * cosine } else { 0.0 };
                Reference {
                    velocity_rad_s: velocity,
                    way_rad: 0.0,
                    acceleration_rad_s2: spinning + swinging,
                }
            }
            Self::LowSpeed => {
                const RAMP_S: f64 = 0.1;
                let share = (t / RAMP_S).clamp(0.0, 1.0);
                let rising = share > 0.0 && share < 1.0;
                Reference {
                    velocity_rad_s: LOW_SPEED_RAD_S * share,
                    way_rad: if rising {
                        LOW_SPEED_RAD_S * 0.5 * t * share
                    } else {
                        LOW_SPEED_RAD_S * (t - 0.5 * RAMP_S).max(0.0)
                    },
                    acceleration_rad_s2: if rising { LOW_SPEED_RAD_S / RAMP_S } else { 0.0 },
                }
            }
            // 0.05 rad in 0.1 s.
            Self::Hold if (0.0..0.1).contains(&t) => {
                Reference { velocity_rad_s: 0.5, way_rad: 0.5 * t, acceleration_rad_s2: 0.0 }
            }
            Self::Hold => {
                Reference { way_rad: if t < 0.0 { 0.0 } else { 0.05 }, ..Reference::default() }
            }
            Self::Impact => trapezoid(t, TARGET_RAD - load::JUMP_FROM_RAD),
        }
    }

    /// Feedforward torque of the known load, Nm: inertia and weight, without friction, water and motor.
    fn rigid_body_nm(
        self,
        p: &Parameters,
        inertia: f64,
        reference: &Reference,
        position: f64,
    ) -> f64 {
        let of_inertia = inertia * reference.acceleration_rad_s2;
        let arm = p.leg_length_m * position.cos();
        match self {
            Self::VelocityTracking => of_inertia,
            Self::LowSpeed | Self::Hold => of_inertia + p.leg_weight_n * arm,
            // The foot only pushes.
            Self::Impact => {
                let push =
                    p.platform_mass_kg * arm * reference.acceleration_rad_s2 + p.platform_weight_n;
                of_inertia + push.max(0.0) * arm
            }
        }
    }
}

/// Reference at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Reference {
    velocity_rad_s: f64,
    /// Position from the start, rad.
    way_rad: f64,
    acceleration_rad_s2: f64,
}

/// Returns the reference of a move over this distance, at the maximum speed and acceleration of the jump.
fn trapezoid(t: f64, way: f64) -> Reference {
    let rise = JUMP_RAD_S / JUMP_RAD_S2;
    let cruise = (way - JUMP_RAD_S * rise) / JUMP_RAD_S;
    let t = t.clamp(0.0, 2.0 * rise + cruise);
    let left = 2.0 * rise + cruise - t;
    if t <= 0.0 || left <= 0.0 {
        Reference { way_rad: if t <= 0.0 { 0.0 } else { way }, ..Reference::default() }
    } else if t < rise {
        let gone = 0.5 * JUMP_RAD_S2 * t * t;
        Reference {
            velocity_rad_s: JUMP_RAD_S2 * t,
            way_rad: gone,
            acceleration_rad_s2: JUMP_RAD_S2,
        }
    } else if left < rise {
        let missing = 0.5 * JUMP_RAD_S2 * left * left;
        Reference {
            velocity_rad_s: JUMP_RAD_S2 * left,
            way_rad: way - missing,
            acceleration_rad_s2: -JUMP_RAD_S2,
        }
    } else {
        let gone = 0.5 * JUMP_RAD_S * rise + JUMP_RAD_S * (t - rise);
        Reference { velocity_rad_s: JUMP_RAD_S, way_rad: gone, acceleration_rad_s2: 0.0 }
    }
}

/// A velocity loop: proportional with slow integration, which stops at the current limit.
struct VelocityLoop {
    gain: f64,
    integral_a: f64,
}

impl VelocityLoop {
    fn current_a(&mut self, error_rad_s: f64, known_a: f64) -> f64 {
        let reference = known_a + self.gain * error_rad_s + self.integral_a;
        if reference.abs() < MAX_CURRENT_A {
            self.integral_a += self.gain * error_rad_s * PERIOD_S / INTEGRAL_S;
        }
        reference.clamp(-MAX_CURRENT_A, MAX_CURRENT_A)
    }
}

/// Conditions of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Constants of the plant.
    pub parameters: Parameters,
    /// Angles of eccentricity and out-of-roundness, rad.
    pub phase_rad: [f64; 2],
    /// Faults around the joint.
    pub faults: RigFaults,
    /// Initial temperature of film and thermometer, deg C.
    pub temperature_c: f64,
    /// Friction level of the seal over that of a new one.
    pub wear: f64,
    /// Seed of the sensor noise.
    pub seed: u64,
    /// Maximum duration of the task, s.
    pub max_duration_s: f64,
}

/// Returns the joint under these conditions, held by a stand.
pub fn joint(task: Task, conditions: &Conditions) -> JointPlant {
    let p = &conditions.parameters;
    let load = task.load(p);
    let mut plant = JointPlant::with_phase(p, load, conditions.phase_rad, conditions.seed);
    plant.seal.set_temperature(conditions.temperature_c);
    plant.seal.set_wear(conditions.wear);
    plant.hold(true);
    plant
}

/// Runs a task.
///
/// # Errors
/// Returns one line if the driver rejects the arm's parameters or does not arm.
pub fn run(task: Task, arm: &DriverArm, conditions: &Conditions) -> Result<Course, PaperError> {
    let mut plant = joint(task, conditions);
    if let Some(share) = arm.perfect {
        // At the driver's current limit the perfect model has no current left either.
        let p = &conditions.parameters;
        let per_ampere =
            p.motor_torque_constant_nm_per_a * (1.0 + p.torque_constant_error) * p.gear_ratio;
        plant.cancel_friction(share, MAX_CURRENT_A * per_ampere);
    }
    let work = |rig: &mut JointRig| master(rig, task, conditions.max_duration_s);
    Ok(run_armed(&arm.set, plant, conditions.faults, work)?)
}

/// Returns the nominal inertia for the design of the loops, from the machine's table.
fn nominal_inertia(task: Task) -> f64 {
    let p = Parameters::default();
    JointPlant::with_phase(&p, task.load(&p), [0.0; 2], 0).inertia_kg_m2()
}

/// Acts as the master of an armed joint held by a stand: releases it and runs the first `max_duration_s` of the task.
pub fn master(rig: &mut JointRig, task: Task, max_duration_s: f64) -> Course {
    let p = Parameters::default();
    let inertia = nominal_inertia(task);
    let mut velocity_loop = VelocityLoop { gain: inertia * TAU * VELOCITY_HZ, integral_a: 0.0 };
    let start = rig.plant().position_rad();
    let mut course = Course::default();
    let lead_in = (task.lead_in_s() / PERIOD_S).round() as i64;
    let rows = (task.seconds().min(max_duration_s) / PERIOD_S).round() as i64;
    rig.plant_mut().hold(false);
    for row in -lead_in..rows {
        let t = row as f64 * PERIOD_S;
        let reference = task.reference(t);
        let view = *rig.master_view();
        let follow = match task {
            Task::VelocityTracking => reference.velocity_rad_s,
            // In the lifting task only velocity is controlled once the joint moves.
            Task::LowSpeed if t > 0.0 => reference.velocity_rad_s,
            Task::LowSpeed | Task::Impact | Task::Hold => {
                let behind = start + reference.way_rad - f64::from(view.position_rad);
                reference.velocity_rad_s + TAU * VELOCITY_HZ * POSITION_SHARE * behind
            }
        };
        // 1 Nm/A.
        let known = task.rigid_body_nm(&p, inertia, &reference, f64::from(view.position_rad));
        let error = follow - f64::from(view.velocity_rad_s);
        let current = velocity_loop.current_a(error, known);
        rig.step_with_command(current as f32, reference.velocity_rad_s as f32);
        if row >= 0 {
            course.time_s.push(t);
            course.reference_rad_s.push(reference.velocity_rad_s);
            course.reference_rad.push(start + reference.way_rad);
            course.velocity_rad_s.push(rig.plant().velocity_rad_s());
            course.position_rad.push(rig.plant().position_rad());
            course.current_a.push(f64::from(rig.master_view().current_a));
        }
        course.stopped |= !rig.is_armed();
        let limits = rig.active_limits();
        if course.out_of_band_s.is_none() && limits.contains(Code::ModelOutOfBand) {
            course.out_of_band_s = Some(t.max(0.0));
        }
    }
    course
}
