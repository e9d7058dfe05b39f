//! What each guard of the compensator costs where it acts: step and sum of the improved LuGre.
//!
//! A joint turns steadily with readings that are all well; then one thing happens, and the dearest of the next
//! updates counts.

use super::{Arguments, Clock, address, joint_f32, joint_fixed, print_line};
use compensator_core::compensator::{CompensatorParameters, Reading};
use compensator_core::{Compensator, Fixed, Inputs, LawKind, Real};
use firmware::control::PERIOD_S;
use firmware::reference_joint::configuration;

/// Updates until friction and slew limit have settled.
const SETTLE: usize = 2000;
/// Updates that are counted. Longer than `hold_s` at none: a situation says itself how old its readings are.
const COUNTED: usize = 20;

/// What a joint is told, in numbers of every kind.
#[derive(Clone, Copy)]
struct Told {
    velocity: Heard,
    reference: Heard,
    force: Heard,
    pressure: Heard,
    command_a: f32,
}

/// A value and its age, s.
type Heard = (f32, f32);

const MISSING: Heard = (0.0, -1.0);
const VELOCITY_RAD_S: f32 = 1.0;
const WELL: Told = Told {
    velocity: (VELOCITY_RAD_S, 0.0),
    reference: (VELOCITY_RAD_S, 1e-3),
    force: (40.0, 1e-3),
    pressure: (0.2, 1e-3),
    command_a: 0.5,
};
/// A joint without side load, pressure and reference.
const VELOCITY_ALONE: Told = Told { reference: MISSING, force: MISSING, pressure: MISSING, ..WELL };
/// Older than the reading is held, younger than it is forgotten: it fades.
const FADING_S: f32 = 0.2;

struct Situation {
    name: &'static str,
    before: Told,
    then: Told,
    limits: fn(&mut CompensatorParameters),
    enabled: bool,
    /// Whether fixed point can meet it.
    in_fixed: bool,
}

const NOTHING: Situation = Situation {
    name: "nothing: all is well",
    before: WELL,
    then: WELL,
    limits: |_| {},
    enabled: true,
    in_fixed: true,
};

const SITUATIONS: &[Situation] = &[
    NOTHING,
    Situation { name: "compensator off", enabled: false, ..NOTHING },
    Situation {
        name: "near standstill: the reference counts",
        then: Told { velocity: (0.01, 0.0), ..WELL },
        ..NOTHING
    },
    Situation { name: "no reference", then: Told { reference: MISSING, ..WELL }, ..NOTHING },
    Situation {
        name: "no sensor but the velocity's, ever",
        before: VELOCITY_ALONE,
        then: VELOCITY_ALONE,
        ..NOTHING
    },
    Situation {
        name: "velocity beyond the envelope",
        then: Told { velocity: (1e3, 0.0), ..WELL },
        ..NOTHING
    },
    Situation {
        name: "velocity and reference too old",
        then: Told { velocity: (1.0, 1.0), reference: (1.0, 1.0), ..WELL },
        ..NOTHING
    },
    Situation { name: "side load not heard", then: Told { force: MISSING, ..WELL }, ..NOTHING },
    Situation {
        name: "side load beyond the envelope",
        then: Told { force: (1e3, 0.0), ..WELL },
        ..NOTHING
    },
    Situation {
        name: "side load old: fades",
        then: Told { force: (40.0, FADING_S), ..WELL },
        ..NOTHING
    },
    Situation { name: "side load jumps", then: Told { force: (90.0, 0.0), ..WELL }, ..NOTHING },
    Situation {
        name: "pressure a little below 0",
        then: Told { pressure: (-0.001, 0.0), ..WELL },
        ..NOTHING
    },
    Situation {
        name: "pressure old: fades",
        then: Told { pressure: (0.2, FADING_S), ..WELL },
        ..NOTHING
    },
    Situation { name: "torque limit", limits: |limits| limits.torque_limit_nm = 0.5, ..NOTHING },
    Situation {
        name: "slew limit",
        then: Told { velocity: (-1.0, 0.0), reference: (-1.0, 0.0), ..WELL },
        limits: |limits| limits.slew_limit_nm_per_s = 10.0,
        ..NOTHING
    },
    Situation { name: "current limit", limits: |limits| limits.current_limit_a = 0.3, ..NOTHING },
    Situation {
        name: "command not a number",
        then: Told { command_a: f32::NAN, ..WELL },
        in_fixed: false,
        ..NOTHING
    },
    Situation {
        name: "everything at once",
        then: Told {
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
        ..NOTHING
    },
];

impl Told {
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

/// The dearest update of a situation.
fn dearest<T: Real<Setting = f32>>(
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
    for _ in 0..SETTLE {
        joint.step(&situation.before.inputs());
    }
    let mut flags = 0u32;
    let inputs = situation.then.inputs::<T>();
    let mut most = 0;
    for _ in 0..COUNTED {
        let before = joint.clone();
        let count = clock.count(function, || {
            joint = before.clone();
            let words = [address(&joint), address(&inputs), &raw mut flags as usize];
            Arguments { words, float: situation.then.command_a }
        });
        most = most.max(count);
    }
    most
}

/// Prints a line for each situation and kind of number.
pub fn measure_guards(clock: &mut Clock) {
    for situation in SITUATIONS {
        let count = dearest::<f32>(clock, situation, joint_f32 as *const ());
        print_line!("guard | {}, f32 | {count}", situation.name);
    }
    for situation in SITUATIONS.iter().filter(|situation| situation.in_fixed) {
        let count = dearest::<Fixed>(clock, situation, joint_fixed as *const ());
        print_line!("guard | {}, Fixed | {count}", situation.name);
    }
}
