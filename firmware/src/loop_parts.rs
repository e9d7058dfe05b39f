//! What a current loop is made of: built in the background, handed to the interrupt whole.
//!
//! Building divides, validates and takes milliseconds, so it is done outside the interrupt; the interrupt
//! swaps motor and friction model between two periods ([`crate::loop_task::LoopTask::swap`]).

use crate::control::{Compensate, JointCompensator, Motor, MotorParameters, PERIOD_S};
use crate::log::log;
use crate::parameter_set::ParameterSet;
use compensator_core::configuration::Configuration;
use compensator_core::network::Factors;
use compensator_core::{Flags, Inputs, Output, ParameterError};
use core::cell::Cell;

/// The friction compensator, held to the share of the current that temperature leaves.
#[derive(Clone, Debug)]
pub struct Model {
    inner: JointCompensator<f32>,
    /// Largest current of joint and motor, A.
    most_a: f32,
    /// What temperature leaves of it, A. A cell, because it changes with every order, and the current loop
    /// that owns this model gives out shared references only.
    limit_a: Cell<f32>,
    /// Share of the compensation that is left.
    compensation: Cell<f32>,
}

impl Model {
    /// Builds it for a period in s, held to so many ampere.
    ///
    /// # Errors
    /// As [`JointCompensator::build`].
    pub fn build(
        friction: &Configuration,
        most_a: f32,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        let inner = JointCompensator::build(friction, period_s)?;
        Ok(Self { inner, most_a, limit_a: Cell::new(most_a), compensation: Cell::new(1.0) })
    }

    pub(crate) fn set_share(&self, share: f32) {
        // NaN leaves nothing.
        let share = if share >= 0.0 { share.min(1.0) } else { 0.0 };
        self.limit_a.set(self.most_a * share);
    }

    pub(crate) fn set_compensation(&self, share: f32) {
        self.compensation.set(if share >= 0.0 { share.min(1.0) } else { 0.0 });
    }
}

impl Compensate for Model {
    fn set_enabled(&mut self, enabled: bool) {
        self.inner.set_enabled(enabled);
    }

    fn is_enabled(&self) -> bool {
        self.inner.is_enabled()
    }

    #[inline]
    fn step(&mut self, inputs: &Inputs<f32>) -> Output<f32> {
        let output = self.inner.step(inputs);
        let left = self.compensation.get();
        Output {
            compensation_torque_nm: left * output.compensation_torque_nm,
            feed_forward_current_a: left * output.feed_forward_current_a,
            ..output
        }
    }

    #[inline]
    fn sum(&self, command_a: f32, output: &Output<f32>) -> (f32, Flags) {
        let (sum, flags) = self.inner.sum(command_a, output);
        let limit = self.limit_a.get();
        if sum.abs() <= limit {
            return (sum, flags);
        }
        (sum.max(-limit).min(limit), flags | Flags::CURRENT_LIMITED)
    }

    fn torque_constant_nm_per_a(&self) -> f32 {
        self.inner.torque_constant_nm_per_a()
    }

    fn supply(&mut self, factors: Option<Factors<f32>>) {
        self.inner.supply(factors);
    }

    fn bristle_torque_nm(&self) -> f32 {
        self.inner.bristle_torque_nm()
    }
}

/// What a power stage imposes on the loop, whatever its parameters say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTraits {
    /// How old the encoder's angle is by the way it is read, s; the sensor's own delay is the parameter
    /// `encoder_delay_s`, which this is added to.
    pub encoder_age_s: f32,
    /// Largest modulation that leaves the shunts time to settle; `modulation_max` is held to it.
    pub modulation_max: f32,
}

impl StageTraits {
    /// A stage whose encoder is read with the currents, and whose current sensors lie in the phases.
    pub const NONE: Self = Self { encoder_age_s: 0.0, modulation_max: 1.0 };

    /// Largest modulation for low-side shunts, s: before the top, where they are sampled, every low side conducts for
    /// half of `(1 - duty) T` less the dead time, and that has to be the amplifiers' settling time; a modulation `m`
    /// has its largest duty at `(1 + m) / 2`.
    pub const fn modulation_for(period_s: f32, dead_time_s: f32, settle_s: f32) -> f32 {
        1.0 - 4.0 * (dead_time_s + settle_s) / period_s
    }
}

/// What a current loop is made of: built outside the interrupt, handed over whole.
#[derive(Clone, Debug)]
pub struct Parts {
    pub(crate) motor: Motor,
    pub(crate) model: Model,
    pub(crate) may_drive: bool,
}

impl Parts {
    /// Builds the parts for a period in s, and a stage.
    ///
    /// # Errors
    /// What of motor or friction model stands against it.
    pub fn build(
        set: &ParameterSet,
        stage: StageTraits,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        // Legal by themselves first: a refusal names what was written.
        set.motor.validate()?;
        let motor = MotorParameters {
            encoder_delay_s: set.motor.encoder_delay_s + stage.encoder_age_s,
            modulation_max: set.motor.modulation_max.min(stage.modulation_max),
            ..set.motor
        }
        .build(period_s)?;
        let most_a = set.motor.current_limit_a.min(set.friction.compensator.current_limit_a);
        let model = Model::build(&set.friction, most_a, period_s)?;
        Ok(Self { motor, model, may_drive: true })
    }

    /// What a loop starts with: parts of the stored set, or else something to measure with and never drive.
    ///
    /// # Panics
    /// Where not even the default set can be built, which the tests rule out.
    pub fn first(set: &ParameterSet, stage: StageTraits) -> Self {
        Self::build(set, stage, PERIOD_S).unwrap_or_else(|_refused| {
            log!(error, "stored parameters cannot be built: {=str}", _refused.field);
            match Self::build(&ParameterSet::default(), stage, PERIOD_S) {
                Ok(parts) => parts.measuring_only(),
                Err(refused) => panic!("default parameters: {refused}"),
            }
        })
    }

    /// The same parts, to measure with and never to drive: for a joint whose own cannot be built.
    #[must_use]
    pub fn measuring_only(self) -> Self {
        Self { may_drive: false, ..self }
    }
}
