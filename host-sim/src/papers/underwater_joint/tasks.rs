//! What the joint has to do under the shipped driver: follow a sine, lift slowly, jump.
//!
//! The loops above the driver run at 1 kHz, as on a robot's own computer, on the velocity and position that the driver
//! sends. They are the same for every arm, and laid out by rule, before anything was measured: the velocity loop crosses at
//! [`VELOCITY_HZ`] for the nominal inertia and integrates slowly ([`INTEGRAL_S`]), so that a compensation that is
//! wrong is seen and not hidden; the position loop lies a factor [`POSITION_SHARE`] below.

use super::arms::Arm;
use crate::joint_rig::{Faults, JointRig, with_joint};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};
use std::f64::consts::TAU;

/// Crossover of the velocity loop, Hz.
const VELOCITY_HZ: f64 = 2.0;
/// Its integral time, s.
const INTEGRAL_S: f64 = 1.0;
/// The position loop's crossover over the velocity loop's.
const POSITION_SHARE: f64 = 0.5;
/// The master's period, s.
const PERIOD_S: f64 = 1e-3;
/// Current the master asks for at most, A: the driver's own limit.
const MOST_A: f64 = 26.0;

/// rad/s in a turn a minute.
pub const RPM: f64 = TAU / 60.0;

/// What was seen of the plant itself, once a millisecond from the task's start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    /// Time from the task's start, s.
    pub time_s: Vec<f64>,
    /// Velocity wanted, rad/s.
    pub wanted_rad_s: Vec<f64>,
    /// Position wanted, rad.
    pub wanted_rad: Vec<f64>,
    /// True velocity, rad/s.
    pub velocity_rad_s: Vec<f64>,
    /// True position, rad.
    pub position_rad: Vec<f64>,
    /// Current, A, as the driver tells it.
    pub current_a: Vec<f64>,
    /// The driver stopped by itself.
    pub stopped: bool,
    /// The watch said "model out of band" at some time.
    pub out_of_band: bool,
}

/// The task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// 65 to 95 rpm, a sine of 5 s, against a propeller.
    VelocityTracking,
    /// 6.6 rpm, lifting 2 kg.
    LowSpeed,
    /// A jump to a target position.
    Impact,
}

/// Speed of the low-speed task, rad/s.
pub const LOW_SPEED_RAD_S: f64 = 6.6 * RPM;
/// Target of the jump, rad, largest speed, rad/s, and acceleration, rad/s^2: the same for all arms.
pub const TARGET_RAD: f64 = 1.0;
const JUMP_RAD_S: f64 = 8.0;
const JUMP_RAD_S2: f64 = 60.0;
/// Time the master holds the joint under control before a leg moves, s.
const HOLD_S: f64 = 0.5;
/// Time in which the propeller comes to speed, which is not judged, s.
const SPIN_UP_S: f64 = 1.5;

impl Task {
    /// Length, s.
    pub fn seconds(self) -> f64 {
        match self {
            Self::VelocityTracking => 25.0,
            Self::LowSpeed => 3.6,
            Self::Impact => 1.5,
        }
    }

    /// Time before it starts, s.
    fn lead_in_s(self) -> f64 {
        if self == Self::VelocityTracking { SPIN_UP_S } else { HOLD_S }
    }

    /// What is on the output.
    pub fn load(self, p: &Parameters) -> Load {
        match self {
            Self::VelocityTracking => Load::Propeller,
            Self::LowSpeed => Load::Leg,
            Self::Impact => Load::jump(p),
        }
    }

    /// Velocity (rad/s) and position (rad, from the start) wanted at a time from the start.
    fn wanted(self, t: f64) -> (f64, f64) {
        match self {
            Self::VelocityTracking => {
                let sine = (80.0 + 15.0 * (TAU * t.max(0.0) / 5.0).sin()) * RPM;
                let share = ((t + SPIN_UP_S) / 1.0).clamp(0.0, 1.0);
                (sine * share, 0.0)
            }
            Self::LowSpeed => {
                let share = (t / 0.1).clamp(0.0, 1.0);
                (LOW_SPEED_RAD_S * share, LOW_SPEED_RAD_S * (t - 0.05).max(0.0))
            }
            Self::Impact => {
                trapezoid(t, TARGET_RAD - Load::Jump { height_m: 0.0, speed_m_s: 0.0 }.start_rad())
            }
        }
    }
}

/// Velocity and position on the way by so much, at the jump's largest speed and acceleration.
fn trapezoid(t: f64, way: f64) -> (f64, f64) {
    let rise = JUMP_RAD_S / JUMP_RAD_S2;
    let cruise = (way - JUMP_RAD_S * rise) / JUMP_RAD_S;
    let t = t.clamp(0.0, 2.0 * rise + cruise);
    let left = 2.0 * rise + cruise - t;
    if t < rise {
        (JUMP_RAD_S2 * t, 0.5 * JUMP_RAD_S2 * t * t)
    } else if left < rise {
        (JUMP_RAD_S2 * left, way - 0.5 * JUMP_RAD_S2 * left * left)
    } else {
        (JUMP_RAD_S, 0.5 * JUMP_RAD_S * rise + JUMP_RAD_S * (t - rise))
    }
}

/// A velocity loop: proportional and slowly integrating, held where the current is limited.
struct VelocityLoop {
    gain: f64,
    integral_a: f64,
}

impl VelocityLoop {
    fn current_a(&mut self, error_rad_s: f64) -> f64 {
        let wanted = self.gain * error_rad_s + self.integral_a;
        if wanted.abs() < MOST_A {
            self.integral_a += self.gain * error_rad_s * PERIOD_S / INTEGRAL_S;
        }
        wanted.clamp(-MOST_A, MOST_A)
    }
}

/// Conditions of a run.
#[derive(Clone, Copy, Debug)]
pub struct Conditions {
    /// The plant's constants.
    pub parameters: Parameters,
    /// Angle of its eccentricity and out-of-roundness, rad.
    pub phase_rad: [f64; 2],
    /// What is wrong around it.
    pub faults: Faults,
    /// Film and thermometer at the start, deg C.
    pub temperature_c: f64,
    /// The seal's level over the new one.
    pub wear: f64,
    /// Draws the sensors' noise.
    pub seed: u64,
}

/// Makes the joint do it.
///
/// # Errors
/// The driver refuses the arm's parameters, or does not arm; one line.
pub fn run(task: Task, arm: &Arm, conditions: &Conditions) -> Result<Course, String> {
    let p = &conditions.parameters;
    let load = task.load(p);
    let mut plant = JointPlant::with_phase(p, load, conditions.phase_rad, conditions.seed);
    plant.seal_mut().set_temperature(conditions.temperature_c);
    plant.seal_mut().set_wear(conditions.wear);
    if let Some(share) = arm.perfect {
        plant.cancel_friction(share);
    }
    plant.hold(true);
    let gain = nominal_inertia(task) * TAU * VELOCITY_HZ;
    with_joint(&arm.set, plant, conditions.faults, |rig| master(rig, task, gain))
}

/// What whoever lays out the loops takes for the inertia: the machine's own table.
fn nominal_inertia(task: Task) -> f64 {
    let p = Parameters::default();
    JointPlant::with_phase(&p, task.load(&p), [0.0; 2], 0).inertia_kg_m2()
}

fn master(rig: &mut JointRig, task: Task, gain: f64) -> Course {
    // The static load is known; at 1 Nm/A.
    let mut velocity_loop = VelocityLoop { gain, integral_a: rig.plant().around().load_torque_nm };
    let start = rig.plant().position_rad();
    let mut course = Course::default();
    let lead_in = (task.lead_in_s() / PERIOD_S).round() as i64;
    let rows = (task.seconds() / PERIOD_S).round() as i64;
    rig.plant_mut().hold(false);
    for row in -lead_in..rows {
        let t = row as f64 * PERIOD_S;
        let (wanted, way) = task.wanted(t);
        let heard = *rig.heard();
        let follow = match task {
            Task::VelocityTracking => wanted,
            Task::LowSpeed if t > 0.0 => wanted,
            Task::LowSpeed | Task::Impact => {
                let behind = start + way - f64::from(heard.position_rad);
                wanted + TAU * VELOCITY_HZ * POSITION_SHARE * behind
            }
        };
        let error = follow - f64::from(heard.velocity_rad_s);
        let current = velocity_loop.current_a(error);
        rig.millisecond(current as f32, wanted as f32);
        if row >= 0 {
            course.time_s.push(t);
            course.wanted_rad_s.push(wanted);
            course.wanted_rad.push(start + way);
            course.velocity_rad_s.push(rig.plant().velocity_rad_s());
            course.position_rad.push(rig.plant().position_rad());
            course.current_a.push(f64::from(rig.heard().current_a));
        }
        course.stopped |= !rig.is_armed();
        course.out_of_band |=
            rig.driver().supervisor().limits().contains(firmware::supervisor::Code::ModelOutOfBand);
    }
    course
}
