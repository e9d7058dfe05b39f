//! Joints whose friction drifts, with the adaptation of their levels (2044h) on the image.
//!
//! The joints and their sets are those of `lab/adaptation`, here with motor, bridge and encoder. Each follows a drawn motion
//! in CSP, with its set alone and with the adaptation. Image and library do the same, and the error is that of the true
//! position of the output. The drifts take 80 s instead of the lab's 20 min, because emulated time is slow. The short form
//! learns a new seal on one joint; `LONG_TESTS=1` compares five joints with limits and writes `target/figures/adaptation.tsv`.

use crate::common::{image, write_figures};
use drifting_joints::joint::Joint;
use drifting_joints::motion::{Habits, Motion};
use emulated_board::BoardDriver;
use firmware::level_learner::{OFF, ON};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use joint_rig::{JointRig, MotorNode, RigFaults, run_from_power_up, service, stage_at_power_up};
use rayon::prelude::*;
use simulated_machines::joint_plant::surroundings::Course;
use simulated_machines::joint_plant::{DrawnJoint, FrictionFamily};
use std::collections::VecDeque;
use std::fmt::Write as _;

/// First seed of the joints: others than those of the tables of the lab.
const FIRST_SEED: u64 = 47_000;
/// Time at which a drift is complete, s, and its factor of the friction.
const DRIFT_S: f64 = 80.0;
const WEAR: f64 = 1.6;
const LOWER_WEAR: f64 = 0.65;
/// Time at which a joint rests for its new seal, and at which it moves again, s.
const STOP_S: [f64; 2] = [20.0, 28.0];
/// Time from which the error counts, and end of the course, s.
const SCORED_S: f64 = 90.0;
const END_S: f64 = 120.0;
/// Swing of the water temperature, K, and pressure difference, Pa, at the end of a drift.
const COOLING_K: f64 = 15.0;
const DEPTH_PA: f64 = 3e6;
/// Times of the short form, s: the seal is new from the start.
const SHORT_S: [f64; 2] = [20.0, 25.0];
/// Time from a target to the motion that it demands, ms: interpolation, and frames.
const TARGET_DELAY_MS: usize = 2;
/// Cyclic synchronous position.
const CSP: u8 = 8;
/// Controlwords that enable a drive.
const ENABLING: [u16; 3] = [0x06, 0x07, 0x0F];
/// Position in the units of 607Ah per rad.
const MICRO: f64 = 1e6;
/// Largest difference of image and library: of the gain of the level, and of the error as a share.
const LARGEST_GAIN_DIFFERENCE: f64 = 0.05;
const LARGEST_ERROR_SHARE: f64 = 0.15;

const HEAD: &str = "seed\tfamily\tdrift in 80 s\timage fixed, mrad\timage adaptive, mrad\tlibrary fixed, mrad\tlibrary adaptive, mrad\timage level gain\tlibrary level gain\n";

#[derive(Clone, Copy, Debug, PartialEq)]
enum Drift {
    /// The friction rises.
    Wears,
    /// The water becomes colder, without a thermometer.
    Cools,
    /// A dive without a pressure sensor.
    Dives,
    /// A new seal after a stop, with this factor of the friction.
    NewSeal(f64),
}

/// A joint that drifts.
#[derive(Clone, Copy, Debug)]
struct Case {
    family: FrictionFamily,
    drift: Drift,
    name: &'static str,
    /// Limits of the learnt gain of the level on the image, a tenth or more on both sides.
    level_gain: [f64; 2],
    /// Error with the adaptation over that with the set alone, at most.
    most_error: f64,
}

const CASES: [Case; 5] = [
    Case {
        family: FrictionFamily::MaxwellSlip,
        drift: Drift::Wears,
        name: "friction x1.6",
        level_gain: [1.25, 1.65],
        most_error: 0.5,
    },
    Case {
        family: FrictionFamily::RateAndState,
        drift: Drift::Cools,
        name: "15 K colder",
        level_gain: [1.02, 1.3],
        most_error: 0.8,
    },
    Case {
        family: FrictionFamily::Iwan,
        drift: Drift::Dives,
        name: "dive to 30 bar",
        level_gain: [1.3, 1.9],
        most_error: 0.4,
    },
    Case {
        family: FrictionFamily::Iwan,
        drift: Drift::NewSeal(WEAR),
        name: "new seal, x1.6",
        level_gain: [1.3, 1.8],
        most_error: 0.45,
    },
    Case {
        family: FrictionFamily::RateAndState,
        drift: Drift::NewSeal(LOWER_WEAR),
        name: "new seal, x0.65",
        level_gain: [0.6, 0.85],
        most_error: 0.97,
    },
];

impl Drift {
    /// Changes the constants and surroundings of a joint as the drift needs them.
    fn prepare(self, constants: &mut simulated_machines::joint_plant::Parameters) {
        match self {
            Self::Cools => (constants.level_per_kelvin, constants.film_per_kelvin) = (0.008, 0.03),
            Self::Dives => constants.pressure_share = 0.5,
            Self::Wears | Self::NewSeal(_) => {}
        }
    }

    /// Returns the course of a quantity that rises by `size` until the end of the drift.
    fn course(base: f64, size: f64) -> Course {
        Course { base, tide: size, tide_period_s: 4.0 * DRIFT_S, ..Course::default() }
    }

    fn wear(self, time_s: f64) -> f64 {
        match self {
            Self::Wears => 1.0 + (WEAR - 1.0) * (time_s / DRIFT_S).min(1.0),
            Self::NewSeal(wear) if time_s > 0.5 * (STOP_S[0] + STOP_S[1]) => wear,
            _ => 1.0,
        }
    }

    fn is_stopped(self, time_s: f64) -> bool {
        matches!(self, Self::NewSeal(_)) && (STOP_S[0]..STOP_S[1]).contains(&time_s)
    }
}

/// A joint of the lab with its motor, and its tuned set.
struct Drawn {
    joint: DrawnJoint,
    set: ParameterSet,
}

fn draw(at: u64, case: &Case) -> Drawn {
    // The seeds of the cases do not overlap.
    let seeds = (FIRST_SEED + 100 * at)..;
    let mut joints = seeds.map(|seed| Joint::draw(seed).expect("a joint"));
    let lab = joints.find(|joint| joint.family == case.family);
    let mut lab = lab.expect("a joint of each family");
    case.drift.prepare(&mut lab.constants);
    let tuned = lab.identify(&lab.plant(false), &lab.world(), None).expect("a set");
    let mut joint = DrawnJoint::draw(lab.seed, &[], None).expect("a joint");
    joint.constants = lab.constants;
    let water_c = joint.constants.water_temperature_c;
    joint.surroundings.water_c = Course::constant(water_c);
    match case.drift {
        Drift::Cools => joint.surroundings.water_c = Drift::course(water_c, -COOLING_K),
        Drift::Dives => joint.surroundings.pressure_pa = Drift::course(0.0, DEPTH_PA),
        Drift::Wears | Drift::NewSeal(_) => {}
    }
    let mut set = service::starting_set(&joint);
    set.friction.compensator.scale = 0.9;
    set.friction.compensator.torque_limit_nm = tuned.torque_limit_nm();
    set.watch.band_nm = tuned.noise_nm;
    set.friction.model = tuned.model;
    set.validate().expect("a legal set");
    Drawn { joint, set }
}

/// Where the driver runs.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    Image,
    Library,
}

/// Result of a course.
#[derive(Clone, Copy, Debug)]
struct Outcome {
    rms_rad: f64,
    level_gain: f64,
}

/// Runs a course from power-up, with the adaptation on or off.
fn run(place: Place, drawn: &Drawn, case: &Case, mode: u8, scored_s: [f64; 2]) -> Outcome {
    let mut start = MotorNode::power_up(&drawn.joint, &drawn.set);
    start.drive.adapt = mode;
    let (plant, faults) = (drawn.joint.plant(), RigFaults::default());
    let work = |rig: &mut JointRig| follow(rig, case, drawn.joint.seed, scored_s);
    match place {
        Place::Library => {
            run_from_power_up(&start, plant, faults, work).expect("the driver starts")
        }
        Place::Image => {
            let stage = stage_at_power_up(&start, plant, &faults);
            let driver = BoardDriver::start(image(), &start, stage).expect("the image starts");
            work(&mut JointRig::new(Box::new(driver), faults))
        }
    }
}

fn command(rig: &mut JointRig, controlword: u16) {
    let mut data = [0; 8];
    data[..2].copy_from_slice(&controlword.to_le_bytes());
    rig.send_immediately(0x201, &data);
    rig.step_idle();
}

fn write_target(rig: &mut JointRig, position_rad: f64) {
    let micro = (MICRO * position_rad).round() as i32;
    rig.write_object(index::TARGET_POSITION, 0, micro.to_le_bytes());
}

/// Makes the position known and enables CSP.
fn enable(rig: &mut JointRig) -> f64 {
    let at_rad = rig.plant().position_rad();
    rig.write_object(index::STATE, 6, (at_rad as f32).to_le_bytes());
    rig.step_idle();
    // Targets are written as objects, whose answers need room on a bus of 1 Mbit/s.
    for (at_index, base) in [(index::TRANSMIT_STATUS, 0x280), (index::TRANSMIT_TORQUE, 0x680)] {
        let unused = 1u32 << 31 | (base + 1);
        rig.write_object(at_index, 1, unused.to_le_bytes());
        rig.step_idle();
    }
    rig.send_immediately(0, &[1, 1]);
    rig.write_object_byte(index::MODE, 0, CSP);
    rig.step_idle();
    for word in ENABLING {
        (0..30).for_each(|_| command(rig, word));
    }
    assert!(rig.is_armed(), "{:?}", rig.latched_faults());
    at_rad
}

fn follow(rig: &mut JointRig, case: &Case, seed: u64, [from_s, to_s]: [f64; 2]) -> Outcome {
    let habits = Habits {
        range_rad: 0.7,
        speed_rad_s: [0.08, 1.2],
        stroke_rad: [0.05, 0.8],
        acceleration_rad_s2: 8.0,
        rest_probability: 0.3,
        longest_rest_s: 0.6,
        one_sided_probability: 0.05,
    };
    let mut motion = Motion::everyday(habits, seed, enable(rig));
    let mut late = VecDeque::new();
    let (mut sum_rad2, mut scored) = (0.0, 0u32);
    let is_short = to_s < END_S;
    for ms in 0..(1e3 * to_s) as u32 {
        let time_s = 1e-3 * f64::from(ms);
        // The short form has no time for a stop.
        let wear = if is_short { WEAR } else { case.drift.wear(time_s) };
        rig.plant_mut().seal.set_wear(wear);
        motion.set_stopped(!is_short && case.drift.is_stopped(time_s));
        let demand_rad = motion.step(1e-3).position_rad;
        write_target(rig, demand_rad);
        command(rig, 0x0F);
        late.push_back(demand_rad);
        if late.len() > TARGET_DELAY_MS
            && let Some(demanded_rad) = late.pop_front()
            && time_s >= from_s
        {
            sum_rad2 += (demanded_rad - rig.plant().position_rad()).powi(2);
            scored += 1;
        }
    }
    assert!(rig.is_armed(), "{case:?}: {:?}", rig.latched_faults());
    let gain = rig.read_object(index::LEARNT_GAINS, 1).map_or(f32::NAN, f32::from_bits);
    Outcome { rms_rad: (sum_rad2 / f64::from(scored)).sqrt(), level_gain: f64::from(gain) }
}

/// Outcomes of a joint: image fixed and adaptive, library fixed and adaptive.
fn outcomes(drawn: &Drawn, case: &Case) -> [Outcome; 4] {
    let arms =
        [(Place::Image, OFF), (Place::Image, ON), (Place::Library, OFF), (Place::Library, ON)];
    arms.map(|(place, mode)| run(place, drawn, case, mode, [SCORED_S, END_S]))
}

fn emit(drawn: &Drawn, case: &Case, outcomes: &[Outcome; 4]) -> String {
    let mut text = format!("{}\t{}\t{}", drawn.joint.seed, case.family.name(), case.name);
    for outcome in outcomes {
        let _ = write!(text, "\t{:.3}", 1e3 * outcome.rms_rad);
    }
    let _ = writeln!(text, "\t{:.3}\t{:.3}", outcomes[1].level_gain, outcomes[3].level_gain);
    text
}

/// Requires that the adaptation helps, and that image and library agree.
fn check(case: &Case, outcomes: &[Outcome; 4]) {
    let [fixed, adaptive, library_fixed, library_adaptive] = *outcomes;
    assert!(adaptive.rms_rad < case.most_error * fixed.rms_rad, "{case:?}: {outcomes:?}");
    let [least, most] = case.level_gain;
    assert!((least..=most).contains(&adaptive.level_gain), "{case:?}: {outcomes:?}");
    for (image, library) in [(fixed, library_fixed), (adaptive, library_adaptive)] {
        let share = image.rms_rad / library.rms_rad - 1.0;
        assert!(share.abs() < LARGEST_ERROR_SHARE, "{case:?}: {outcomes:?}");
        let gain = image.level_gain - library.level_gain;
        assert!(gain.abs() < LARGEST_GAIN_DIFFERENCE, "{case:?}: {outcomes:?}");
    }
}

#[test]
fn joint_with_new_seal_learns_on_image_what_it_learns_on_library() {
    let case = CASES[3];
    let drawn = draw(3, &case);
    let [image, library] = [Place::Image, Place::Library]
        .map(|place| run(place, &drawn, &case, ON, SHORT_S).level_gain);
    println!("measured: gain of the level {image:.3} on the image, {library:.3} on the library");
    assert!(image > 1.2 && (image - library).abs() < LARGEST_GAIN_DIFFERENCE);
}

#[test]
fn joints_that_drift_adapt_on_image_as_on_library() {
    if std::env::var_os("LONG_TESTS").is_none() {
        return;
    }
    let rows: Vec<String> = CASES
        .par_iter()
        .enumerate()
        .map(|(at, case)| {
            let drawn = draw(at as u64, case);
            let outcomes = outcomes(&drawn, case);
            let row = emit(&drawn, case, &outcomes);
            print!("{row}");
            check(case, &outcomes);
            row
        })
        .collect();
    write_figures("adaptation.tsv", &(HEAD.to_owned() + &rows.concat()));
}
