//! Measures each guard of the compensator where it acts: step and sum of the improved LuGre.
//!
//! A joint turns steadily with valid readings. Then one situation occurs, and the most expensive of the
//! next updates counts.

use super::{Arguments, Clock, address, joint_f32, joint_fixed, print_line};
use compensator_core::compensator::{CompensatorParameters, Reading};
use compensator_core::{Compensator, Fixed, Inputs, LawKind, Real};
use firmware::control::PERIOD_S;
use firmware::reference_joint::configuration;

/// Updates until friction and slew limit have settled.
const SETTLING_UPDATES: usize = 2000;
/// Number of updates measured. The readings keep the age that the situation states.
const MEASURED_UPDATES: usize = 20;

/// Inputs of the compensator, for every number type.
#[derive(Clone, Copy)]
struct GuardInputs {
    velocity: TimedReading,
    reference: TimedReading,
    force: TimedReading,
    pressure: TimedReading,
    command_a: f32,
}

/// A value and its age, s.
type TimedReading = (f32, f32);

const MISSING: TimedReading = (0.0, -1.0);
const VELOCITY_RAD_S: f32 = 1.0;
const VALID_INPUTS: GuardInputs = GuardInputs {
    velocity: (VELOCITY_RAD_S, 0.0),
    reference: (VELOCITY_RAD_S, 1e-3),
    force: (40.0, 1e-3),
    pressure: (0.2, 1e-3),
    command_a: 0.5,
};
/// A joint without side load, pressure and reference.
const VELOCITY_ONLY: GuardInputs =
    GuardInputs { reference: MISSING, force: MISSING, pressure: MISSING, ..VALID_INPUTS };
/// An age, s, at which a reading fades: beyond its hold time, before it is dropped.
const FADING_S: f32 = 0.2;

struct Situation {
    name: &'static str,
    before: GuardInputs,
    then: GuardInputs,
    limits: fn(&mut CompensatorParameters),
    enabled: bool,
    /// True if the situation also exists in fixed point.
    in_fixed: bool,
}

const BASE_SITUATION: Situation = Situation {
    name: "nothing: all is well",
    before: VALID_INPUTS,
    then: VALID_INPUTS,
    limits: |_| {},
    enabled: true,
    in_fixed: true,
};

const SITUATIONS: &[Situation] = &[
    BASE_SITUATION,
    Situation { name: "compensator off", enabled: false, ..BASE_SITUATION },
    Situation {
        name: "near standstill: the reference counts",
        then: GuardInputs { velocity: (0.01, 0.0), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "no reference",
        then: GuardInputs { reference: MISSING, ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "no sensor but the velocity's, ever",
        before: VELOCITY_ONLY,
        then: VELOCITY_ONLY,
        ..BASE_SITUATION
    },
    Situation {
        name: "velocity beyond the envelope",
        then: GuardInputs { velocity: (1e3, 0.0), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "velocity and reference too old",
        then: GuardInputs { velocity: (1.0, 1.0), reference: (1.0, 1.0), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "side load missing",
        then: GuardInputs { force: MISSING, ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "side load beyond the envelope",
        then: GuardInputs { force: (1e3, 0.0), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "side load old: fades",
        then: GuardInputs { force: (40.0, FADING_S), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "side load jumps",
        then: GuardInputs { force: (90.0, 0.0), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "pressure a little below 0",
        then: GuardInputs { pressure: (-0.001, 0.0), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "pressure old: fades",
        then: GuardInputs { pressure: (0.2, FADING_S), ..VALID_INPUTS },
        ..BASE_SITUATION
    },
    Situation {
        name: "torque limit",
        limits: |limits| limits.torque_limit_nm = 0.5,
        ..BASE_SITUATION
    },
    Situation {
        name: "slew limit",
        then: GuardInputs { velocity: (-1.0, 0.0), reference: (-1.0, 0.0), ..VALID_INPUTS },
        limits: |limits| limits.slew_limit_nm_per_s = 10.0,
        ..BASE_SITUATION
    },
    Situation {
        name: "current limit",
        limits: |limits| limits.current_limit_a = 0.3,
        ..BASE_SITUATION
    },
    Situation {
        name: "command not a number",
        then: GuardInputs { command_a: f32::NAN, ..VALID_INPUTS },
        in_fixed: false,
        ..BASE_SITUATION
    },
    Situation {
        name: "everything at once",
        then: GuardInputs {
            velocity: (f32::NAN, 1.0),
            reference: (-5.0, 0.0),
            force: (90.0, FADING_S),
            pressure: (-1.0, FADING_S),
            command_a: f32::NAN,
        },
        limits: |limits| {
            limits.torque_limit_nm = 0.5;
            limits.slew_limit_nm_per_s = 10.0;
            limits.current_limit_a = 0.3;
        },
        ..BASE_SITUATION
    },
];

impl GuardInputs {
    fn inputs<T: Real>(&self) -> Inputs<T> {
        let number = |value: f32| T::from_f64(value.into());
        let reading = |(value, age_s)| Reading { value: number(value), age_s: number(age_s) };
        Inputs {
            velocity_reference_rad_s: reading(self.reference),
            radial_force_n: reading(self.force),
            pressure_diff_mpa: reading(self.pressure),
            velocity_rad_s: reading(self.velocity),
            ..Inputs::velocity(T::zero())
        }
    }
}

/// Returns the largest count of a situation.
fn largest_count<T: Real<Setting = f32>>(
    clock: &mut Clock,
    situation: &Situation,
    function: *const (),
) -> u32 {
    let mut written = configuration(LawKind::ImprovedLugre, &[]);
    (situation.limits)(&mut written.compensator);
    let mut joint = match Compensator::<T>::build(&written, PERIOD_S) {
        Ok(joint) => joint,
        Err(refused) => panic!("{refused}"),
    };
    joint.set_enabled(situation.enabled);
    for _ in 0..SETTLING_UPDATES {
        joint.step(&situation.before.inputs());
    }
    let mut flags = 0u32;
    let inputs = situation.then.inputs::<T>();
    let mut max = 0;
    for _ in 0..MEASURED_UPDATES {
        let before = joint.clone();
        let count = clock.count(function, || {
            joint = before.clone();
            let words = [address(&joint), address(&inputs), &raw mut flags as usize];
            Arguments { words, float: situation.then.command_a }
        });
        max = max.max(count);
    }
    max
}

/// Prints a line for each situation and number type.
pub fn measure_guards(clock: &mut Clock) {
    for situation in SITUATIONS {
        let count = largest_count::<f32>(clock, situation, joint_f32 as *const ());
        print_line!("guard | {}, f32 | {count}", situation.name);
    }
    for situation in SITUATIONS.iter().filter(|situation| situation.in_fixed) {
        let count = largest_count::<Fixed>(clock, situation, joint_fixed as *const ());
        print_line!("guard | {}, Fixed | {count}", situation.name);
    }
}
