//! A joint of the core alone, in each number type: the image and the tests on a PC compute the same steps with it.
//!
//! The shipped image has neither fixed point nor networks. This image shows that they give the bits of a PC on a Cortex-M4F,
//! and what each step takes: [`Number`] names the functions whose calls the emulator counts.
#![cfg_attr(target_os = "none", no_std)]

#[path = "../../../reference_network.rs"]
mod reference;

use compensator_core::can::SampleAssembler;
use compensator_core::configuration::Configuration;
use compensator_core::model::{FrictionModel, ModelState, Sample};
use compensator_core::network::{AugmentedLugre, CELLS, Factors, Network, NetworkState};
use compensator_core::{Compensator, Fixed, Inputs, Real};
use reference::INPUTS;

/// Time from sample to sample, s.
pub const PERIOD_S: f32 = 2e-3;
/// Words of an answer.
pub const WORDS: usize = 5;
/// Age of the campaign at the start, h.
const CAMPAIGN_H: f32 = 3.0;
/// Samples from one evaluation of the network to the next.
const PERIOD_SAMPLES: u32 = 4;

/// What the compensator computes for a sample: friction, feed-forward current, current, flags.
pub type Update<T> = (T, T, T, u32);

/// The reference network.
pub type ReferenceNetwork<T> = Network<T, INPUTS, CELLS>;
/// Its state.
pub type ReferenceState<T> = NetworkState<T, CELLS>;

fn update<T: Real<Setting = f32>>(
    joint: &mut Compensator<T>,
    inputs: &Inputs<T>,
    current_a: T,
) -> Update<T> {
    let output = joint.step(inputs);
    let (sum, flags) = joint.sum(current_a, &output);
    (output.friction_torque_nm, output.feed_forward_current_a, sum, flags.bits())
}

/// A number type of the core.
pub trait Number: Real<Setting = f32> {
    /// Returns all bits.
    fn bits(self) -> u32;

    /// Steps a compensator, and adds its current to this one.
    fn update(
        joint: &mut Compensator<Self>,
        inputs: &Inputs<Self>,
        current_a: Self,
    ) -> Update<Self>;

    /// Steps a model without compensator.
    fn step(
        model: &FrictionModel<Self>,
        state: &mut ModelState<Self>,
        sample: &Sample<Self>,
    ) -> Self;

    /// Evaluates the network.
    fn evaluate(
        network: &ReferenceNetwork<Self>,
        state: &mut ReferenceState<Self>,
        inputs: &[Self; INPUTS],
    );

    /// Steps the law to which the factors of the network apply.
    fn apply(
        law: &AugmentedLugre<Self>,
        held_nm: &mut Self,
        velocity_rad_s: Self,
        factors: &Factors<Self>,
    ) -> Self;
}

/// Makes a number type of the core. Its functions are modules of their own, whose names the symbols of the image contain.
macro_rules! number {
    ($number:ty, $module:ident, $bits:expr) => {
        mod $module {
            use super::*;

            #[inline(never)]
            pub fn update(
                joint: &mut Compensator<$number>,
                inputs: &Inputs<$number>,
                current_a: $number,
            ) -> Update<$number> {
                super::update(joint, inputs, current_a)
            }

            #[inline(never)]
            pub fn step(
                model: &FrictionModel<$number>,
                state: &mut ModelState<$number>,
                sample: &Sample<$number>,
            ) -> $number {
                model.step(state, sample)
            }

            #[inline(never)]
            pub fn evaluate(
                network: &ReferenceNetwork<$number>,
                state: &mut ReferenceState<$number>,
                inputs: &[$number; INPUTS],
            ) {
                network.evaluate(state, inputs);
            }

            #[inline(never)]
            pub fn apply(
                law: &AugmentedLugre<$number>,
                held_nm: &mut $number,
                velocity_rad_s: $number,
                factors: &Factors<$number>,
            ) -> $number {
                law.step(held_nm, velocity_rad_s, factors)
            }
        }

        impl Number for $number {
            fn bits(self) -> u32 {
                $bits(self)
            }

            fn update(
                joint: &mut Compensator<Self>,
                inputs: &Inputs<Self>,
                current_a: Self,
            ) -> Update<Self> {
                $module::update(joint, inputs, current_a)
            }

            fn step(
                model: &FrictionModel<Self>,
                state: &mut ModelState<Self>,
                sample: &Sample<Self>,
            ) -> Self {
                $module::step(model, state, sample)
            }

            fn evaluate(
                network: &ReferenceNetwork<Self>,
                state: &mut ReferenceState<Self>,
                inputs: &[Self; INPUTS],
            ) {
                $module::evaluate(network, state, inputs);
            }

            fn apply(
                law: &AugmentedLugre<Self>,
                held_nm: &mut Self,
                velocity_rad_s: Self,
                factors: &Factors<Self>,
            ) -> Self {
                $module::apply(law, held_nm, velocity_rad_s, factors)
            }
        }
    };
}

number!(f32, in_f32, f32::to_bits);
number!(Fixed, in_fixed, |value: Fixed| value.to_bits() as u32);

/// A joint that computes samples.
pub trait Joint {
    /// Computes the sample that the last SYNC ended.
    fn step(&mut self, inbox: &SampleAssembler) -> [u32; WORDS];
}

/// A compensator, and its model alone. Its answers are friction, feed-forward, current, flags, and the torque of the model.
pub struct CompensatedJoint<T: Real> {
    compensator: Compensator<T>,
    model: FrictionModel<T>,
    state: ModelState<T>,
}

impl<T: Number> CompensatedJoint<T> {
    /// Builds an enabled joint; `None` if the number type cannot compute it.
    pub fn build(friction: &Configuration) -> Option<Self> {
        let mut compensator = Compensator::build(friction, PERIOD_S).ok()?;
        compensator.set_enabled(true);
        let model = friction.model.build(PERIOD_S).ok()?;
        Some(Self { compensator, model, state: ModelState::default() })
    }
}

impl<T: Number> Joint for CompensatedJoint<T> {
    fn step(&mut self, inbox: &SampleAssembler) -> [u32; WORDS] {
        let inputs = inbox.inputs::<T>(PERIOD_S, CAMPAIGN_H);
        let command = inbox.command_current_a();
        let (friction, forward, current, flags) =
            T::update(&mut self.compensator, &inputs, T::from_setting(command));
        // The velocity may be any number; the covariates are constant.
        let sample = Sample {
            velocity_rad_s: inputs.velocity_rad_s.value,
            radial_force_n: T::from_f64(40.0),
            pressure_diff_mpa: T::from_f64(0.2),
            position_rad: T::from_f64(1.0),
            temperature_c: T::from_f64(30.0),
            auxiliary: T::from_f64(0.4),
            ..Sample::default()
        };
        let torque = T::step(&self.model, &mut self.state, &sample);
        [friction.bits(), forward.bits(), current.bits(), flags, torque.bits()]
    }
}

/// The reference network and its law. Its answers are the factors, the evaluations outside of the range, and the torque.
pub struct NetworkJoint<T: Real> {
    network: ReferenceNetwork<T>,
    state: ReferenceState<T>,
    law: AugmentedLugre<T>,
    held_nm: T,
    samples: u32,
}

impl<T: Number> NetworkJoint<T> {
    /// Builds the joint; `None` if the number type cannot compute it.
    pub fn build() -> Option<Self> {
        let law = reference::law(PERIOD_S)?;
        let (network, state) = (reference::network(), NetworkState::default());
        Some(Self { network, state, law, held_nm: T::zero(), samples: 0 })
    }
}

impl<T: Number> Joint for NetworkJoint<T> {
    fn step(&mut self, inbox: &SampleAssembler) -> [u32; WORDS] {
        let inputs = inbox.inputs::<T>(PERIOD_S, CAMPAIGN_H);
        let velocity = inputs.velocity_rad_s.value;
        if self.samples.is_multiple_of(PERIOD_SAMPLES) {
            let values = [inputs.auxiliary.value, velocity, self.held_nm];
            T::evaluate(&self.network, &mut self.state, &values);
        }
        self.samples += 1;
        let factors = &self.state.factors;
        let torque = T::apply(&self.law, &mut self.held_nm, velocity, factors);
        let [coulomb, level, stiffness] = factors.to_array().map(Number::bits);
        [coulomb, level, stiffness, self.state.outside_count, torque.bits()]
    }
}
