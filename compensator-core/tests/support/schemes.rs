//! Three ways to step LuGre once a sample: the core's, and two it is measured against.
//!
//! All get the velocity at the end of the sample and answer with the friction there. The explicit
//! and the exact one are written here from their textbook forms, in `f64` and with the exponential:
//! *explicit Euler* takes the rate of the state it starts from; the *exact zero-order hold* solves
//! the sample in closed form as if the velocity had stood still in it.

use super::{Input, Seal};
use compensator_core::model::{Sample, State};
use compensator_core::{Model, Parameters, Real};

/// What a scheme is told in one sample: the input at its end and the change of side load in it.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub input: Input,
    pub radial_force_change: f64,
    pub period: f64,
}

/// A scheme: friction torque in Nm for one sample.
pub type Scheme<'a> = Box<dyn FnMut(&Step) -> f64 + 'a>;

/// The core's model in the number `T`.
pub fn core<T: Real>(parameters: &Parameters<T::Setting>, period: f64) -> Scheme<'static> {
    let period = <T::Setting as Real>::from_f64(period);
    let model: Model<T> = parameters.build(period).expect("the joint is legal");
    let mut state = State::default();
    Box::new(move |step| {
        let sample = Sample {
            velocity_rad_s: T::from_f64(step.input.velocity),
            radial_force_n: T::from_f64(step.input.radial_force),
            radial_force_change_n: T::from_f64(step.radial_force_change),
            pressure_diff_mpa: T::from_f64(step.input.pressure_pa * 1e-6),
            ..Sample::default()
        };
        model.step(&mut state, &sample).value()
    })
}

/// `z + dt z'(z)`.
pub fn explicit(seal: &Seal) -> Scheme<'_> {
    let mut deflection = 0.0;
    Box::new(move |step| {
        let input = averaged(step);
        let rate = seal.deflection_rate(deflection, &input);
        deflection += rate * step.period;
        seal.friction(deflection, rate, &input)
    })
}

/// `z_inf + (z - z_inf) exp(-dt sigma0 |v| / g)`.
pub fn zero_order_hold(seal: &Seal) -> Scheme<'_> {
    let mut deflection = 0.0;
    Box::new(move |step| {
        let input = averaged(step);
        let drive = input.velocity + seal.bend_per_newton * input.radial_force_rate;
        let decay = seal.stiffness * input.velocity.abs() / seal.level(&input);
        let gained = if decay > 0.0 {
            let settled = drive / decay;
            (settled - deflection) * -(-decay * step.period).exp_m1()
        } else {
            drive * step.period
        };
        deflection += gained;
        let rate = seal.deflection_rate(deflection, &input);
        seal.friction(deflection, rate, &input)
    })
}

/// The input with the rate of the side load that a sampled system can know.
fn averaged(step: &Step) -> Input {
    Input { radial_force_rate: step.radial_force_change / step.period, ..step.input }
}
