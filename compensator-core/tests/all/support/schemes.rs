//! Three integration schemes for LuGre with one step per sample: the core's step and two alternatives.
//!
//! Each scheme receives the velocity at the end of the sample and returns the friction at that time. The alternatives
//! are textbook forms in `f64`, with the exponential. *Explicit Euler* uses the rate at the start of the sample. The
//! *exact zero-order hold* solves the sample in closed form for constant velocity.

use super::{Input, Seal};
use compensator_core::model::{ModelState, Sample};
use compensator_core::{FrictionModel, Parameters, Real};

/// Input of a scheme for one sample: the input at its end, and the change of side load (N) within it.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub input: Input,
    pub radial_force_change: f64,
    pub period: f64,
}

/// A scheme: returns the friction torque for one sample, Nm.
pub type Scheme<'a> = Box<dyn FnMut(&Step) -> f64 + 'a>;

/// Returns the core's model in the number type `T`.
pub fn core<T: Real>(parameters: &Parameters<T::Setting>, period: f64) -> Scheme<'static> {
    let period = <T::Setting as Real>::from_f64(period);
    let model: FrictionModel<T> = parameters.build(period).expect("the joint is legal");
    let mut state = ModelState::default();
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

/// Explicit Euler: `z + dt z'(z)`.
pub fn explicit(seal: &Seal) -> Scheme<'_> {
    let mut deflection = 0.0;
    Box::new(move |step| {
        let input = averaged(step);
        let rate = seal.deflection_rate(deflection, &input);
        deflection += rate * step.period;
        seal.friction(deflection, rate, &input)
    })
}

/// Exact zero-order hold: `z_inf + (z - z_inf) exp(-dt sigma0 |v| / g)`.
pub fn zero_order_hold(seal: &Seal) -> Scheme<'_> {
    let mut deflection = 0.0;
    Box::new(move |step| {
        let input = averaged(step);
        let drive = input.velocity + seal.bend_per_newton * input.radial_force_rate;
        let decay = seal.stiffness * input.velocity.abs() / seal.level(&input);
        let increment = if decay > 0.0 {
            let settled = drive / decay;
            (settled - deflection) * -(-decay * step.period).exp_m1()
        } else {
            drive * step.period
        };
        deflection += increment;
        let rate = seal.deflection_rate(deflection, &input);
        seal.friction(deflection, rate, &input)
    })
}

/// Returns the input with the mean rate of the side load over the sample, as a sampled system measures it.
fn averaged(step: &Step) -> Input {
    Input { radial_force_rate: step.radial_force_change / step.period, ..step.input }
}
