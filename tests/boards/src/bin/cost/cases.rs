//! The measured updates and their inputs.
//!
//! Each update is a separate function, called as firmware would call it: state and parameters behind
//! pointers, a velocity in a register or inputs behind a pointer. The input sequences visit rest,
//! presliding, sliding in both directions, reversals, speeds beyond the Stribeck range and beyond the
//! envelope, infinities and NaN. For the whole compensator they also contain missing, stale and illegal
//! readings. *Every single* update is counted; the smallest and the largest count are printed. If the two
//! are equal, the step has one path. `current_loop` measures the whole current loop, `interrupt` the
//! interrupt around it.

mod current_loop;
mod guards;
mod interrupt;

use super::clock::{Arguments, Clock};
use super::print_line;
use compensator_core::compensator::Reading;
use compensator_core::effect::NoEffect;
use compensator_core::law::bristle::Bristles;
use compensator_core::model::{FrictionModel, Law, ModelState, Sample};
use compensator_core::network::reference::{self as reference_network, CELLS, INPUTS};
use compensator_core::network::{AugmentedLugre, Factors, Network, NetworkState};
use compensator_core::{Compensator, Fixed, Inputs, LawKind, Real, TermKind};
#[cfg(feature = "terms")]
use compensator_core::{ParameterId as Id, term::LookupFormula};
use firmware::control::PERIOD_S;
use firmware::reference_joint::configuration;

/// Velocities of every class. In fixed point NaN and infinity become 0 and the limit.
const VELOCITIES: [f32; 24] = [
    0.0,
    0.0,
    1e-6,
    1e-3,
    0.01,
    -0.01,
    0.05,
    0.1,
    0.2,
    0.39,
    0.4,
    3.0,
    11.9,
    12.1,
    1e9,
    -1e9,
    -3.0,
    -0.1,
    -1e-5,
    -0.0,
    f32::NAN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    1e-42,
];

#[cfg(feature = "terms")]
const LOOKUP_TERM: &[TermKind] = &[TermKind::LookupTable];

#[cfg(feature = "terms")]
const TWO_TERMS: &[TermKind] = &[TermKind::TemperatureViscous, TermKind::PositionRipple];

/// Updates at one velocity: enough to preslide, to slip and to settle.
const UPDATES_PER_VELOCITY: usize = 20;

fn velocities() -> impl Iterator<Item = f32> {
    VELOCITIES.into_iter().flat_map(|velocity| core::iter::repeat_n(velocity, UPDATES_PER_VELOCITY))
}

fn model<T: Real<Setting = f32>>(law: LawKind, terms: &[TermKind]) -> FrictionModel<T> {
    match configuration(law, terms).model.build(PERIOD_S) {
        Ok(model) => model,
        Err(refused) => panic!("{refused}"),
    }
}

/// Counts each update of a sequence and prints the smallest and the largest count.
fn measure<S: Clone, I>(
    clock: &mut Clock,
    name: &str,
    function: *const (),
    mut state: S,
    inputs: impl Iterator<Item = I>,
    mut call: impl FnMut(&mut S, &I) -> Arguments,
) {
    let (mut min, mut max) = (u32::MAX, 0);
    for input in inputs {
        let before = state.clone();
        let count = clock.count(function, || {
            state = before.clone();
            call(&mut state, &input)
        });
        min = min.min(count);
        max = max.max(count);
    }
    print_line!("cost | {name} | {min} | {max}");
}

fn address<T>(of: &T) -> usize {
    core::ptr::from_ref(of) as usize
}

extern "C" fn lugre_f32(law: &Bristles<f32>, state: &mut f32, _: usize, velocity: f32) -> f32 {
    law.step(state, velocity, &NoEffect)
}

extern "C" fn lugre_fixed(law: &Bristles<Fixed>, state: &mut Fixed, velocity: i32) -> i32 {
    law.step(state, Fixed::from_bits(velocity), &NoEffect).to_bits()
}

/// Step and sum: from a commanded current to the limited current.
extern "C" fn joint_f32(
    joint: &mut Compensator<f32>,
    inputs: &Inputs<f32>,
    flags: &mut u32,
    command: f32,
) -> f32 {
    let output = joint.step(inputs);
    let (current, raised) = joint.sum(command, &output);
    *flags = raised.bits();
    current
}

extern "C" fn joint_fixed(
    joint: &mut Compensator<Fixed>,
    inputs: &Inputs<Fixed>,
    flags: &mut u32,
) -> i32 {
    let output = joint.step(inputs);
    let (current, raised) = joint.sum(Fixed::from_bits(1 << 19), &output);
    *flags = raised.bits();
    current.to_bits()
}

fn law<T: Real>(model: &FrictionModel<T>) -> &Bristles<T> {
    match model.law() {
        Law::Lugre(law) => &law.0,
        Law::ImprovedLugre(law) => &law.bristles,
        _ => panic!("only bristle laws are measured"),
    }
}

fn sample<T: Real>(velocity: f32) -> Sample<T> {
    Sample {
        velocity_rad_s: T::from_f64(velocity.into()),
        radial_force_n: T::from_f64(40.0),
        radial_force_change_n: T::from_f64(f64::from(velocity.clamp(-0.5, 0.5))),
        pressure_diff_mpa: T::from_f64(0.2),
        position_rad: T::from_f64(f64::from(velocity)),
        temperature_c: T::from_f64(30.0),
        auxiliary: T::from_f64(f64::from(velocity)),
        ..Sample::default()
    }
}

/// ValidChannels readings, with some that are missing, stale, illegal or NaN in every 20 updates.
fn inputs<T: Real>(update: usize, velocity: f32) -> Inputs<T> {
    let number = |value: f32| T::from_f64(value.into());
    let fresh = |value| Reading::fresh(number(value));
    let aged = |value, age_s| Reading { value: number(value), age_s: number(age_s) };
    let mut inputs = Inputs {
        velocity_rad_s: fresh(velocity),
        velocity_reference_rad_s: fresh(velocity.clamp(-5.0, 5.0)),
        position_rad: fresh(1.0),
        acceleration_rad_s2: fresh(0.0),
        radial_force_n: fresh(40.0),
        pressure_diff_mpa: fresh(0.2),
        temperature_c: fresh(30.0),
        load_torque_nm: fresh(1.0),
        auxiliary: fresh(0.4),
        campaign_time_h: number(1.0),
    };
    match update % UPDATES_PER_VELOCITY {
        3 => inputs.radial_force_n = aged(50.0, 0.2),
        4 => inputs.radial_force_n = fresh(f32::NAN),
        5 => inputs.radial_force_n = fresh(-1.0),
        6 => inputs.radial_force_n = Reading::missing(),
        7 => inputs.pressure_diff_mpa = aged(0.1, 10.0),
        8 => inputs.pressure_diff_mpa = fresh(1e3),
        9 => inputs.pressure_diff_mpa = fresh(-0.01),
        10 => inputs.velocity_reference_rad_s = Reading::missing(),
        11 => inputs.velocity_reference_rad_s = fresh(f32::NAN),
        12 => inputs.velocity_rad_s = Reading::missing(),
        13 => inputs = Inputs::velocity(number(velocity)),
        14 => inputs = Inputs::velocity(number(f32::NAN)),
        15 => inputs.temperature_c = fresh(f32::NAN),
        16 => inputs.position_rad = aged(2.0, 0.3),
        17 => inputs.campaign_time_h = number(-1.0),
        _ => {}
    }
    inputs
}

fn measure_model<T: Real>(
    clock: &mut Clock,
    name: &str,
    model: &FrictionModel<T>,
    samples: impl Iterator<Item = Sample<T>>,
) {
    let function = FrictionModel::<T>::step as *const ();
    measure(clock, name, function, ModelState::<T>::default(), samples, |state, sample| {
        Arguments { words: [address(model), address(state), address(sample)], float: 0.0 }
    });
}

/// The friction damper's model with named causes: backlash, asymmetric levels, and a level that saturates
/// with a column.
#[cfg(feature = "terms")]
fn damper() -> FrictionModel<f32> {
    let terms = [TermKind::Backlash, TermKind::DirectionAsymmetry, TermKind::LookupTable];
    let model = configuration(LawKind::Lugre, &terms).model;
    let model = model
        .with(Id::BacklashTravel, 0.01)
        .with(Id::BacklashUnloaded, 1.0)
        .with(Id::LookupFormula, LookupFormula::Saturating as u8 as f32)
        .with(Id::LookupRise, 0.5)
        .with(Id::LookupScale, 0.2);
    match model.build(PERIOD_S) {
        Ok(model) => model,
        Err(refused) => panic!("{refused}"),
    }
}

fn measure_f32(clock: &mut Clock) {
    let plain = model::<f32>(LawKind::Lugre, &[]);
    measure(clock, "plain LuGre, f32", lugre_f32 as *const (), 0.0f32, velocities(), |state, v| {
        Arguments { words: [address(law(&plain)), address(state), 0], float: *v }
    });
    let improved = model::<f32>(LawKind::ImprovedLugre, &[]);
    let samples = || velocities().map(sample::<f32>);
    for (name, model) in
        [("plain LuGre as a model, f32", &plain), ("improved LuGre, f32", &improved)]
    {
        measure_model(clock, name, model, samples());
    }
    #[cfg(feature = "terms")]
    {
        let with_terms = model::<f32>(LawKind::ImprovedLugre, TWO_TERMS);
        measure_model(clock, "improved LuGre + temperature + ripple, f32", &with_terms, samples());
        let with_unknown = model::<f32>(LawKind::ImprovedLugre, LOOKUP_TERM);
        measure_model(clock, "improved LuGre + unknown, f32", &with_unknown, samples());
        measure_model(
            clock,
            "LuGre + backlash + directions + a level's formula, f32",
            &damper(),
            samples(),
        );
    }
    for (name, law, terms) in [
        ("compensator, plain LuGre, f32", LawKind::Lugre, &[][..]),
        ("compensator, improved LuGre, f32", LawKind::ImprovedLugre, &[]),
        #[cfg(feature = "terms")]
        (
            "compensator, improved LuGre + temperature + ripple, f32",
            LawKind::ImprovedLugre,
            TWO_TERMS,
        ),
    ] {
        let mut flags = 0u32;
        let commands = [0.5f32, 100.0, f32::NAN];
        let inputs = velocities().enumerate().map(|(i, v)| (inputs::<f32>(i, v), commands[i % 3]));
        let call = |joint: &mut Compensator<f32>, (inputs, command): &(Inputs<f32>, f32)| {
            let words = [address(joint), address(inputs), &raw mut flags as usize];
            Arguments { words, float: *command }
        };
        measure(clock, name, joint_f32 as *const (), joint(law, terms), inputs, call);
    }
}

fn measure_fixed(clock: &mut Clock) {
    let plain = model::<Fixed>(LawKind::Lugre, &[]);
    let bits = velocities().map(|v| Fixed::from_f64(v.into()).to_bits());
    measure(
        clock,
        "plain LuGre, Fixed",
        lugre_fixed as *const (),
        Fixed::zero(),
        bits,
        |state, v| Arguments {
            words: [address(law(&plain)), address(state), *v as usize],
            float: 0.0,
        },
    );
    let improved = model::<Fixed>(LawKind::ImprovedLugre, &[]);
    #[cfg(feature = "terms")]
    {
        let with_unknown = model::<Fixed>(LawKind::ImprovedLugre, LOOKUP_TERM);
        let samples = velocities().map(sample::<Fixed>);
        measure_model(clock, "improved LuGre + unknown, Fixed", &with_unknown, samples);
    }
    for (name, model) in
        [("plain LuGre as a model, Fixed", &plain), ("improved LuGre, Fixed", &improved)]
    {
        measure_model(clock, name, model, velocities().map(sample::<Fixed>));
    }
    for (name, law) in [
        ("compensator, plain LuGre, Fixed", LawKind::Lugre),
        ("compensator, improved LuGre, Fixed", LawKind::ImprovedLugre),
    ] {
        let mut flags = 0u32;
        let inputs = velocities().enumerate().map(|(i, v)| inputs::<Fixed>(i, v));
        let call = |joint: &mut Compensator<Fixed>, inputs: &Inputs<Fixed>| {
            let words = [address(joint), address(inputs), &raw mut flags as usize];
            Arguments { words, float: 0.0 }
        };
        measure(clock, name, joint_fixed as *const (), joint(law, &[]), inputs, call);
    }
}

fn joint<T: Real<Setting = f32>>(law: LawKind, terms: &[TermKind]) -> Compensator<T> {
    match Compensator::build(&configuration(law, terms), PERIOD_S) {
        Ok(mut joint) => {
            joint.set_enabled(true);
            joint
        }
        Err(refused) => panic!("{refused}"),
    }
}

extern "C" fn network_f32(
    network: &Reference<f32>,
    state: &mut NetworkState<f32, CELLS>,
    inputs: &[f32; INPUTS],
) -> f32 {
    network.evaluate(state, inputs).stiffness
}

extern "C" fn network_fixed(
    network: &Reference<Fixed>,
    state: &mut NetworkState<Fixed, CELLS>,
    inputs: &[Fixed; INPUTS],
) -> i32 {
    network.evaluate(state, inputs).stiffness.to_bits()
}

extern "C" fn supplied_f32(
    law: &AugmentedLugre<f32>,
    held: &mut f32,
    factors: &Factors<f32>,
    velocity: f32,
) -> f32 {
    law.step(held, velocity, factors)
}

type Reference<T> = Network<T, INPUTS, CELLS>;

/// Measures the network outside the loop, and the law it supplies inside.
fn measure_network(clock: &mut Clock) {
    let network = reference_network::network::<f32>();
    let readings = || velocities().map(|v| [v, 0.5 * v, 2.0 * v]);
    let function = network_f32 as *const ();
    let fresh = NetworkState::<f32, CELLS>::default();
    measure(clock, "network of 8 cells, f32", function, fresh, readings(), |state, inputs| {
        let words = [address(&network), address(state), address(inputs)];
        Arguments { words, float: 0.0 }
    });
    let fixed = reference_network::network::<Fixed>();
    let readings = readings().map(|inputs| inputs.map(|input| Fixed::from_f64(input.into())));
    let function = network_fixed as *const ();
    let fresh = NetworkState::<Fixed, CELLS>::default();
    measure(clock, "network of 8 cells, Fixed", function, fresh, readings, |state, inputs| {
        let words = [address(&fixed), address(state), address(inputs)];
        Arguments { words, float: 0.0 }
    });
    let Some(law) = reference_network::law::<f32>(PERIOD_S) else {
        panic!("the reference law is legal")
    };
    let factors = Factors { coulomb: 0.9f32, static_level: 1.1, stiffness: 0.5 };
    let function = supplied_f32 as *const ();
    measure(clock, "lugre-lstm, its law, f32", function, 0.0f32, velocities(), |held, v| {
        Arguments { words: [address(&law), address(held), address(&factors)], float: *v }
    });
    print_line!("ram | Network<f32>, 8 cells | {}", size_of::<Reference<f32>>());
    print_line!("ram | NetworkState<f32>, 8 cells | {}", size_of::<NetworkState<f32, CELLS>>());
}

/// Prints every line of the table.
pub fn print_all(clock: &mut Clock) {
    #[cfg(feature = "c-reference")]
    c_reference::measure_c(clock);
    measure_f32(clock);
    measure_fixed(clock);
    guards::measure_guards(clock);
    current_loop::measure_loops(clock);
    interrupt::measure_interrupts(clock);
    measure_network(clock);
    print_line!("ram | Compensator<f32> | {}", size_of::<Compensator<f32>>());
    print_line!("ram | Compensator<Fixed> | {}", size_of::<Compensator<Fixed>>());
    print_line!("ram | Model<f32> | {}", size_of::<FrictionModel<f32>>());
    print_line!("ram | State<f32> | {}", size_of::<ModelState<f32>>());
    print_line!("ram | CurrentLoop<f32> | {}", size_of::<current_loop::Loop>());
}

#[cfg(feature = "c-reference")]
mod c_reference {
    //! The laws of `tests/cost/reference.c`, driven through velocities at which they are finite.
    #![allow(unsafe_code)] // Declares C functions, which only the clock calls.

    use super::{Arguments, Clock, address, measure, print_line, velocities};

    /// `struct lugre` of the C file.
    #[repr(C)]
    struct Law([f32; 10]);

    unsafe extern "C" {
        fn lugre_step(law: *const Law, state: *mut f32, velocity: f32) -> f32;
        fn improved_lugre_step(law: *const Law, state: *mut f32, sample: *const [f32; 4]) -> f32;
        // newlib's expf reports overflows through it.
        #[allow(dead_code)]
        fn __errno() -> *mut i32;
    }

    pub fn measure_c(clock: &mut Clock) {
        let law = Law([1.5, 0.7, 10.0, 1e4, 30.0, 0.08, 50e-6, 0.01, 2.4, 0.02]);
        let legal = || velocities().filter(|v| v.abs() < 13.0);
        measure(clock, "plain LuGre, C", lugre_step as *const (), 0.0f32, legal(), |state, v| {
            Arguments { words: [address(&law), address(state), 0], float: *v }
        });
        let samples = legal().map(|v| [v, 40.0, v.clamp(-0.5, 0.5), 0.2]);
        let function = improved_lugre_step as *const ();
        measure(clock, "improved LuGre, C", function, 0.0f32, samples, |state, sample| Arguments {
            words: [address(&law), address(state), address(sample)],
            float: 0.0,
        });
        print_line!("compiler | arm-none-eabi-gcc -O3 -ffast-math, newlib expf");
    }
}
