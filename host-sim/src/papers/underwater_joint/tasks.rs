//! What the joint has to do under the shipped driver: follow a sine, lift slowly, jump.
//!
//! The loops above the driver run at 1 kHz, as on a robot's own computer, on the velocity and position that the driver
//! sends. They are the same for every arm, and laid out by rule, before anything was measured: the velocity loop crosses at
//! [`VELOCITY_HZ`] for the nominal inertia and integrates slowly ([`INTEGRAL_S`]), so that a compensation that is
//! wrong is seen and not hidden; the position loop lies a factor [`POSITION_SHARE`] below. What a robot's computer knows of the
//! rigid body (inertia, weight) is fed forward: without it even a perfect friction model is judged by the lag of the loop.

use super::arms::Arm;
use crate::joint_rig::{Faults, JointRig, with_joint};
use firmware::supervisor::Code;
use simulated_machines::joint_plant::{JointPlant, Load, Parameters, load};
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
    /// When the watch first said "model out of band", s from the task's start; at 0 where it said so before.
    pub out_of_band_s: Option<f64>,
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
    /// Holding 2 kg after a small move: not of the paper, for limit cycles.
    Hold,
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
    /// What it is, as a heading.
    pub fn title(self) -> &'static str {
        match self {
            Self::VelocityTracking => "Velocity tracking, 65 to 95 rpm",
            Self::LowSpeed => "Lifting 2 kg at 6.6 rpm",
            Self::Impact => "Jump with impact",
            Self::Hold => "Holding 2 kg",
        }
    }

    /// The paper's figure.
    pub fn figure(self) -> &'static str {
        match self {
            Self::VelocityTracking => "Fig. 9",
            Self::LowSpeed => "Fig. 10",
            Self::Impact => "Fig. 11",
            Self::Hold => "holding",
        }
    }

    /// Length, s.
    pub fn seconds(self) -> f64 {
        match self {
            Self::VelocityTracking => 25.0,
            Self::LowSpeed => 3.6,
            Self::Impact => 1.5,
            Self::Hold => 3.0,
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
            Self::LowSpeed | Self::Hold => Load::Leg,
            Self::Impact => Load::jump(p),
        }
    }

    /// What is wanted at a time from the start.
    fn wanted(self, t: f64) -> Wanted {
        match self {
            Self::VelocityTracking => {
                let w = TAU / 5.0;
                let now = t.max(0.0);
                let (sine, cosine) = (w * now).sin_cos();
                let share = (t + SPIN_UP_S).clamp(0.0, 1.0);
                let velocity = (80.0 + 15.0 * sine) * RPM * share;
                let spinning = if share < 1.0 { 80.0 * RPM } else { 0.0 };
                let swinging = if t > 0.0 { 15.0 * RPM * w * cosine } else { 0.0 };
                Wanted { velocity, way: 0.0, acceleration: spinning + swinging }
            }
            Self::LowSpeed => {
                const RAMP_S: f64 = 0.1;
                let share = (t / RAMP_S).clamp(0.0, 1.0);
                let rising = share > 0.0 && share < 1.0;
                Wanted {
                    velocity: LOW_SPEED_RAD_S * share,
                    way: if rising {
                        LOW_SPEED_RAD_S * 0.5 * t * share
                    } else {
                        LOW_SPEED_RAD_S * (t - 0.5 * RAMP_S).max(0.0)
                    },
                    acceleration: if rising { LOW_SPEED_RAD_S / RAMP_S } else { 0.0 },
                }
            }
            // A twentieth of a radian in a tenth of a second.
            Self::Hold if (0.0..0.1).contains(&t) => {
                Wanted { velocity: 0.5, way: 0.5 * t, acceleration: 0.0 }
            }
            Self::Hold => Wanted { way: if t < 0.0 { 0.0 } else { 0.05 }, ..Wanted::default() },
            Self::Impact => trapezoid(t, TARGET_RAD - load::JUMP_FROM_RAD),
        }
    }

    /// What the master knows of the load, Nm: inertia and weight; nothing of friction, water and motor.
    fn rigid_body_nm(self, p: &Parameters, inertia: f64, wanted: &Wanted, position: f64) -> f64 {
        let own = inertia * wanted.acceleration;
        let arm = p.leg_length_m * position.cos();
        match self {
            Self::VelocityTracking => own,
            Self::LowSpeed | Self::Hold => own + p.leg_weight_n * arm,
            // The foot only pushes.
            Self::Impact => {
                let push = p.platform_mass_kg * arm * wanted.acceleration + p.platform_weight_n;
                own + push.max(0.0) * arm
            }
        }
    }
}

/// What the joint is to do at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Wanted {
    /// rad/s.
    velocity: f64,
    /// From the start, rad.
    way: f64,
    /// rad/s^2.
    acceleration: f64,
}

/// On the way by so much, at the jump's largest speed and acceleration.
fn trapezoid(t: f64, way: f64) -> Wanted {
    let rise = JUMP_RAD_S / JUMP_RAD_S2;
    let cruise = (way - JUMP_RAD_S * rise) / JUMP_RAD_S;
    let t = t.clamp(0.0, 2.0 * rise + cruise);
    let left = 2.0 * rise + cruise - t;
    if t <= 0.0 || left <= 0.0 {
        Wanted { velocity: 0.0, way: if t <= 0.0 { 0.0 } else { way }, acceleration: 0.0 }
    } else if t < rise {
        let gone = 0.5 * JUMP_RAD_S2 * t * t;
        Wanted { velocity: JUMP_RAD_S2 * t, way: gone, acceleration: JUMP_RAD_S2 }
    } else if left < rise {
        let missing = 0.5 * JUMP_RAD_S2 * left * left;
        Wanted { velocity: JUMP_RAD_S2 * left, way: way - missing, acceleration: -JUMP_RAD_S2 }
    } else {
        let gone = 0.5 * JUMP_RAD_S * rise + JUMP_RAD_S * (t - rise);
        Wanted { velocity: JUMP_RAD_S, way: gone, acceleration: 0.0 }
    }
}

/// A velocity loop: proportional and slowly integrating, held where the current is limited.
struct VelocityLoop {
    gain: f64,
    integral_a: f64,
}

impl VelocityLoop {
    fn current_a(&mut self, error_rad_s: f64, known_a: f64) -> f64 {
        let wanted = known_a + self.gain * error_rad_s + self.integral_a;
        if wanted.abs() < MOST_A {
            self.integral_a += self.gain * error_rad_s * PERIOD_S / INTEGRAL_S;
        }
        wanted.clamp(-MOST_A, MOST_A)
    }
}

/// Conditions of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// The task ends after so long at the latest, s.
    pub most_s: f64,
}

/// The joint under these conditions, held by a stand.
pub fn joint(task: Task, conditions: &Conditions) -> JointPlant {
    let p = &conditions.parameters;
    let load = task.load(p);
    let mut plant = JointPlant::with_phase(p, load, conditions.phase_rad, conditions.seed);
    plant.seal_mut().set_temperature(conditions.temperature_c);
    plant.seal_mut().set_wear(conditions.wear);
    plant.hold(true);
    plant
}

/// Makes the joint do it.
///
/// # Errors
/// The driver refuses the arm's parameters, or does not arm; one line.
pub fn run(task: Task, arm: &Arm, conditions: &Conditions) -> Result<Course, String> {
    let mut plant = joint(task, conditions);
    if let Some(share) = arm.perfect {
        // Where the driver's current is at its limit, a perfect model has nothing to give back either.
        let p = &conditions.parameters;
        let per_ampere =
            p.motor_torque_constant_nm_per_a * (1.0 + p.torque_constant_error) * p.gear_ratio;
        plant.cancel_friction(share, MOST_A * per_ampere);
    }
    with_joint(&arm.set, plant, conditions.faults, |rig| master(rig, task, conditions.most_s))
}

/// What whoever lays out the loops takes for the inertia: the machine's own table.
fn nominal_inertia(task: Task) -> f64 {
    let p = Parameters::default();
    JointPlant::with_phase(&p, task.load(&p), [0.0; 2], 0).inertia_kg_m2()
}

/// Is the master of an armed joint that a stand holds: lets go of it, and makes it do the task, or the first `most_s` of it.
pub fn master(rig: &mut JointRig, task: Task, most_s: f64) -> Course {
    let p = Parameters::default();
    let inertia = nominal_inertia(task);
    let mut velocity_loop = VelocityLoop { gain: inertia * TAU * VELOCITY_HZ, integral_a: 0.0 };
    let start = rig.plant().position_rad();
    let mut course = Course::default();
    let lead_in = (task.lead_in_s() / PERIOD_S).round() as i64;
    let rows = (task.seconds().min(most_s) / PERIOD_S).round() as i64;
    rig.plant_mut().hold(false);
    for row in -lead_in..rows {
        let t = row as f64 * PERIOD_S;
        let wanted = task.wanted(t);
        let heard = *rig.heard();
        let follow = match task {
            Task::VelocityTracking => wanted.velocity,
            // Once it moves, the lifting task is one of velocity alone.
            Task::LowSpeed if t > 0.0 => wanted.velocity,
            Task::LowSpeed | Task::Impact | Task::Hold => {
                let behind = start + wanted.way - f64::from(heard.position_rad);
                wanted.velocity + TAU * VELOCITY_HZ * POSITION_SHARE * behind
            }
        };
        // 1 Nm/A.
        let known = task.rigid_body_nm(&p, inertia, &wanted, f64::from(heard.position_rad));
        let error = follow - f64::from(heard.velocity_rad_s);
        let current = velocity_loop.current_a(error, known);
        rig.millisecond(current as f32, wanted.velocity as f32);
        if row >= 0 {
            course.time_s.push(t);
            course.wanted_rad_s.push(wanted.velocity);
            course.wanted_rad.push(start + wanted.way);
            course.velocity_rad_s.push(rig.plant().velocity_rad_s());
            course.position_rad.push(rig.plant().position_rad());
            course.current_a.push(f64::from(rig.heard().current_a));
        }
        course.stopped |= !rig.is_armed();
        let limits = rig.driver().supervisor().limits();
        if course.out_of_band_s.is_none() && limits.contains(Code::ModelOutOfBand) {
            course.out_of_band_s = Some(t.max(0.0));
        }
    }
    course
}
