//! Drawn joints that a master gives no torque: friction family, level, wear, inertia, coupling, temperature, and what moves them
//! from outside. Each runs in CST, CSV or CSP, with compensation and without (see [`super::self_drive`]).

use super::rig::{Joint, compute_in_parallel, set};
use super::self_drive::{
    AFTER_MS, CST, CSV, ENABLED, EXCESS_RAD_S, drag_nm, enable, rest, set_outside, speed,
};
use super::velocity::drive;
use compensator_core::ParameterId as Id;
use firmware::parameter_set::ParameterSet;
use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64;
use simulated_machines::joint_plant::FrictionFamily;
use simulated_machines::joint_plant::parameters::PHASE_RAD;
use simulated_machines::joint_plant::seal::Seal;
use std::f64::consts::TAU;

const CSP: u8 = 8;
/// Gain of the position loop by default (60FBh:1), 1/s.
const POSITION_GAIN: f64 = 10.0;
/// Lag of the velocity loop behind the position loop, ms.
const LAG_MS: usize = 100;

/// A drawn joint, what changes, and what moves it.
struct Course {
    seed: u64,
    mode: u8,
    set: ParameterSet,
    family: FrictionFamily,
    wear: f64,
    /// Wear after the event: the seal loosens.
    later_wear: f64,
    water_c: f64,
    inertia: f64,
    stiffness: f64,
    play: f64,
    hand: Hand,
    drags: bool,
    event_ms: usize,
}

/// What moves the joint from outside until the event.
#[derive(Clone, Copy)]
enum Hand {
    /// Pulls at this speed with this impedance, rad/s and Nm s/rad, up to 6 Nm.
    Pull(f64, f64),
    /// Pushes with this torque, Nm.
    Push(f64),
    /// Moves back and forth with this speed and frequency, rad/s and Hz.
    Stroke(f64, f64),
    /// Presses against a contact: a spring in the direction of motion, Nm/rad.
    Contact(f64),
}

impl Hand {
    fn torque_nm(self, since_s: f64, position_rad: f64, velocity_rad_s: f64) -> f64 {
        match self {
            Self::Pull(speed, impedance) => {
                (impedance * (speed * (since_s / 0.1).min(1.0) - velocity_rad_s)).clamp(-6.0, 6.0)
            }
            Self::Push(torque) => torque,
            Self::Stroke(speed, hz) => {
                let wanted = speed * (TAU * hz * since_s).sin();
                (8.0 * (wanted - velocity_rad_s)).clamp(-6.0, 6.0)
            }
            Self::Contact(stiffness) => {
                // A hand presses with 3 Nm against a stop at 0.1 rad.
                3.0 - stiffness * (position_rad - 0.1).max(0.0)
            }
        }
    }
}

impl Course {
    fn draw(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut uniform = |least: f64, most: f64| random.random_range(least..most);
        let mut set = set(uniform(0.7, 1.0) as f32);
        let levels = uniform(0.8, 1.5) as f32;
        let model = &mut set.friction.model;
        for id in [Id::CoulombTorque, Id::StaticTorque, Id::ViscousFriction] {
            model.set(id, model.get(id) * levels);
        }
        set.motor.inertia_kg_m2 *= uniform(0.5, 2.0) as f32;
        let wear = uniform(0.5, 1.3);
        let way = if uniform(0.0, 1.0) < 0.5 { -1.0 } else { 1.0 };
        let hand = match uniform(0.0, 4.0) as u8 {
            0 => Hand::Pull(way * uniform(0.1, 4.0), uniform(2.0, 20.0)),
            1 => Hand::Push(way * uniform(1.0, 4.0)),
            2 => Hand::Stroke(uniform(0.1, 2.0), uniform(0.2, 2.0)),
            _ => Hand::Contact(uniform(20.0, 400.0)),
        };
        Self {
            seed,
            mode: [CST, CST, CSV, CSP][uniform(0.0, 4.0) as usize],
            set,
            family: FrictionFamily::ALL[uniform(0.0, 3.0) as usize],
            wear,
            later_wear: if uniform(0.0, 1.0) < 0.3 { wear * uniform(0.5, 1.0) } else { wear },
            water_c: uniform(2.0, 35.0),
            inertia: uniform(0.6, 2.0),
            stiffness: if uniform(0.0, 1.0) < 0.7 { 0.0 } else { uniform(500.0, 4000.0) },
            play: if uniform(0.0, 1.0) < 0.8 { 0.0 } else { uniform(0.0, 3e-3) },
            hand,
            drags: uniform(0.0, 1.0) < 0.4,
            event_ms: uniform(100.0, 1200.0) as usize,
        }
    }

    /// Returns the speed 0.5 s after the event, rad/s. In CSP the speed does not count with which the position loop returned to
    /// its target within the last 0.1 s.
    fn run(&self, is_compensated: bool) -> f64 {
        let mut set = self.set.clone();
        if !is_compensated {
            set.friction.compensator.scale = 0.0;
        }
        let mut joint = Joint::with(set);
        joint.constants.rotor_inertia_kg_m2 *= self.inertia;
        joint.constants.output_inertia_kg_m2 *= self.inertia;
        joint.constants.output_stiffness_nm_per_rad = self.stiffness;
        joint.constants.backlash_rad = self.play;
        joint.constants.water_temperature_c = self.water_c;
        joint.run_plant(
            |plant| {
                plant.seal = Seal::of_family(self.family, &joint.constants, PHASE_RAD);
                plant.seal.set_wear(self.wear);
            },
            |master| {
                enable(master, self.mode);
                let from_rad = master.rig.plant().position_rad();
                for ms in 0..self.event_ms {
                    let plant = master.rig.plant();
                    let (position, velocity) =
                        (plant.position_rad() - from_rad, plant.velocity_rad_s());
                    let drag = if self.drags { drag_nm(velocity) } else { 0.0 };
                    let hand = self.hand.torque_nm(1e-3 * ms as f64, position, velocity);
                    set_outside(master.rig.plant_mut(), hand + drag);
                    drive(master, ENABLED, 0.0);
                }
                master.rig.plant_mut().seal.set_wear(self.later_wear);
                rest(master, AFTER_MS - LAG_MS, |_| 0.0);
                let mut commanded = 0.0f64;
                for _ in 0..LAG_MS {
                    rest(master, 1, |_| 0.0);
                    let way_rad = (master.rig.plant().position_rad() - from_rad).abs();
                    commanded = commanded.max(POSITION_GAIN * way_rad);
                }
                let commanded = if self.mode == CSP { commanded } else { 0.0 };
                (speed(master) - commanded).max(0.0)
            },
        )
    }
}

/// The short form draws a fifth.
#[test]
fn drawn_joints_without_a_command_are_hardly_faster_than_without_compensation() {
    let count = if std::env::var_os("LONG_TESTS").is_some() { 1000 } else { 200 };
    let first: u64 = std::env::var("SEED").ok().and_then(|seed| seed.parse().ok()).unwrap_or(1);
    let seeds: Vec<u64> = (0..count).map(|k| first * 100_000 + k).collect();
    let excesses = compute_in_parallel(&seeds, |seed| {
        let course = Course::draw(*seed);
        (course.seed, course.mode, course.run(true) - course.run(false))
    });
    for mode in [CST, CSV, CSP] {
        let of_mode = excesses.iter().filter(|(_, case_mode, _)| *case_mode == mode);
        let worst = of_mode.clone().map(|(_, _, excess)| *excess).fold(f64::NEG_INFINITY, f64::max);
        println!("mode {mode}: {} courses, largest excess {worst:.3} rad/s", of_mode.count());
    }
    let faster: Vec<_> = excesses.iter().filter(|(_, _, excess)| *excess > EXCESS_RAD_S).collect();
    assert!(faster.is_empty(), "{} of {count}: {faster:?}", faster.len());
}
