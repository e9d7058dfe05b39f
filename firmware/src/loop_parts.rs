//! The parts of a current loop: built in the background, passed to the interrupt whole.
//!
//! Building validates, divides and takes milliseconds, so it is done outside the interrupt. The interrupt swaps
//! motor and friction model between two periods ([`crate::loop_task::LoopTask::swap`]).

use crate::control::parameters::OVERCURRENT_MARGIN;
use crate::control::{Compensate, JointCompensator, Motor, MotorParameters, PERIOD_S};
use crate::log::log;
use crate::parameter_set::ParameterSet;
use crate::sensors::encoder::EncoderKind;
use compensator_core::adaptation::Gains;
use compensator_core::configuration::Configuration;
use compensator_core::network::Factors;
use compensator_core::parameters::Bound;
use compensator_core::text;
use compensator_core::{CompensatorOutput, Flags, Inputs, ParameterError};
use core::cell::Cell;

/// The friction compensator, limited to the share of the current that the temperature permits.
#[derive(Clone, Debug)]
pub struct LimitedCompensator {
    inner: JointCompensator<f32>,
    /// Maximum current of joint and motor, A.
    max_current_a: f32,
    /// Present current limit, A, after temperature derating. A `Cell`, because it changes with every command and
    /// the current loop gives out shared references only.
    limit_a: Cell<f32>,
    /// Share of the compensation in use, 0..=1.
    compensation: Cell<f32>,
}

/// Limits a share to 0..=1; NaN counts as 0. Not with `f32::min`, which is a call on this core.
#[inline(always)]
fn limited_share(share: f32) -> f32 {
    if share >= 1.0 {
        1.0
    } else if share >= 0.0 {
        share
    } else {
        0.0
    }
}

impl LimitedCompensator {
    /// Builds a compensator for a period in s, limited to `max_current_a`.
    ///
    /// # Errors
    /// As [`JointCompensator::build`].
    pub fn build(
        friction: &Configuration,
        max_current_a: f32,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        let inner = JointCompensator::build(friction, period_s)?;
        Ok(Self {
            inner,
            max_current_a,
            limit_a: Cell::new(max_current_a),
            compensation: Cell::new(1.0),
        })
    }

    pub(crate) fn set_current_share(&self, share: f32) {
        self.limit_a.set(self.max_current_a * limited_share(share));
    }

    pub(crate) fn set_compensation_share(&self, share: f32) {
        self.compensation.set(limited_share(share));
    }
}

impl Compensate for LimitedCompensator {
    fn set_enabled(&mut self, enabled: bool) {
        self.inner.set_enabled(enabled);
    }

    fn is_enabled(&self) -> bool {
        self.inner.is_enabled()
    }

    #[inline]
    fn step(&mut self, inputs: &Inputs<f32>) -> CompensatorOutput<f32> {
        let output = self.inner.step(inputs);
        let left = self.compensation.get();
        CompensatorOutput {
            compensation_torque_nm: left * output.compensation_torque_nm,
            feed_forward_current_a: left * output.feed_forward_current_a,
            ..output
        }
    }

    #[inline]
    fn sum(&self, command_a: f32, output: &CompensatorOutput<f32>) -> (f32, Flags) {
        let (sum, flags) = self.inner.sum(command_a, output);
        let limit = self.limit_a.get();
        if sum.abs() <= limit {
            return (sum, flags);
        }
        (sum.max(-limit).min(limit), flags | Flags::CURRENT_LIMITED)
    }

    #[inline]
    fn current_limit_a(&self) -> f32 {
        self.limit_a.get()
    }

    fn torque_constant_nm_per_a(&self) -> f32 {
        self.inner.torque_constant_nm_per_a()
    }

    fn supply(&mut self, factors: Option<Factors<f32>>) {
        self.inner.supply(factors);
    }

    fn replace(&mut self, from: &Self) {
        self.inner.replace(&from.inner);
        self.max_current_a = from.max_current_a;
        self.limit_a.clone_from(&from.limit_a);
        self.compensation.clone_from(&from.compensation);
    }

    fn replace_base(&mut self, from: &Self) {
        self.inner.replace_base(&from.inner);
    }

    fn set_gains(&mut self, gains: &Gains<f32>) {
        self.inner.set_gains(gains);
    }

    fn bristle_torque_nm(&self) -> f32 {
        self.inner.bristle_torque_nm()
    }
}

/// Properties of a power stage that apply in addition to the parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTraits {
    /// Age of the angle of an encoder that is read in frames, caused by the way it is read, s. It is added to the parameter `encoder_delay_s`,
    /// the delay of the sensor itself.
    pub encoder_age_s: f32,
    /// The same of an encoder with BiSS C, which latches earlier.
    pub biss_age_s: f32,
    /// Largest phase current that the stage can measure, A; limits `overcurrent_a` and `current_limit_a`.
    pub current_max_a: f32,
    /// Maximum modulation that leaves the shunts time to settle; limits `modulation_max`.
    pub modulation_max: f32,
}

impl StageTraits {
    /// A stage that reads the encoder together with the currents and has current sensors of any range in the phases.
    pub const NONE: Self = Self {
        encoder_age_s: 0.0,
        biss_age_s: 0.0,
        current_max_a: f32::INFINITY,
        modulation_max: 1.0,
    };

    /// Checks the currents of a set against what the stage can measure. A current that is not measured is neither
    /// controlled nor limited.
    ///
    /// # Errors
    /// Names the current, its bound and the reason.
    pub fn check_currents(&self, set: &ParameterSet) -> Result<(), ParameterError> {
        let most_a = self.current_max_a;
        for (field, value, most_a) in [
            (text!("current_limit_a"), set.motor.current_limit_a, most_a / OVERCURRENT_MARGIN),
            (text!("overcurrent_a"), set.motor.overcurrent_a, most_a),
            (text!("overcurrent_a"), set.thresholds.overcurrent_a, most_a),
        ] {
            if value > most_a {
                let why = text!("the current sensors of this board measure no more");
                let bound = Bound::AtMost(most_a);
                return Err(ParameterError { field, value, bound, why });
            }
        }
        Ok(())
    }

    /// Returns the maximum modulation for low-side shunts. They are sampled at the top of the PWM period. Before
    /// it, every low side conducts for half of `(1 - duty) T` less the dead time, which must be at least the
    /// settling time of the amplifiers. A modulation `m` has its largest duty at `(1 + m) / 2`. All times are in
    /// s.
    pub const fn max_modulation(period_s: f32, dead_time_s: f32, settle_s: f32) -> f32 {
        1.0 - 4.0 * (dead_time_s + settle_s) / period_s
    }
}

/// The parts of a current loop: built outside the interrupt, passed whole.
#[derive(Clone, Debug)]
pub struct LoopParts {
    pub(crate) motor: Motor,
    pub(crate) model: LimitedCompensator,
    pub(crate) may_drive: bool,
}

impl LoopParts {
    /// Builds the parts for a period in s and a power stage.
    ///
    /// # Errors
    /// Names the parameter of motor or friction model that was refused.
    pub fn build(
        set: &ParameterSet,
        stage: StageTraits,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        // Validate the written values first, so that the error names what was written.
        set.motor.validate()?;
        stage.check_currents(set)?;
        let kind = EncoderKind::of(set.sensors.encoder_kind);
        let encoder_age_s = kind.age_s(stage.encoder_age_s, stage.biss_age_s);
        let motor = MotorParameters {
            encoder_delay_s: set.motor.encoder_delay_s + encoder_age_s,
            modulation_max: set.motor.modulation_max.min(stage.modulation_max),
            ..set.motor
        }
        .build(period_s)?
        .with_overspeed(set.thresholds.overspeed_rad_s);
        let max_current_a = set.motor.current_limit_a.min(set.friction.compensator.current_limit_a);
        let model = LimitedCompensator::build(&set.friction, max_current_a, period_s)?;
        Ok(Self { motor, model, may_drive: true })
    }

    /// Builds the parts of a set in use. If it cannot be built, stores why in `refused`, and returns parts of the default set
    /// that measure and never drive.
    ///
    /// # Errors
    /// The default set cannot be built either, which the tests rule out.
    // Not inlined, to reduce the size of the image.
    #[inline(never)]
    pub fn build_or_measure_only(
        set: &ParameterSet,
        stage: StageTraits,
        refused: &mut Option<ParameterError>,
    ) -> Result<Self, ParameterError> {
        let mut built = Self::build(set, stage, PERIOD_S);
        if let Err(error) = built {
            log!(error, "stored parameters cannot be built: {=u32:08X}", error.field.number());
            *refused = Some(error);
            // Parts that never drive may have currents that the stage cannot measure.
            let stage = StageTraits { current_max_a: f32::INFINITY, ..stage };
            built = Self::build(&ParameterSet::default(), stage, PERIOD_S);
            if let Ok(parts) = &mut built {
                parts.may_drive = false;
            }
        }
        built
    }

    /// Returns the same parts, to measure and never to drive.
    #[must_use]
    pub fn measure_only(self) -> Self {
        Self { may_drive: false, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_defaults_beyond_the_range_of_the_stage_measure_only() {
        let stage = StageTraits { current_max_a: 1.0, ..StageTraits::NONE };
        let may_drive = |stage, refused: &mut Option<_>| {
            let built = LoopParts::build_or_measure_only(&ParameterSet::default(), stage, refused);
            built.expect("the default set measures").may_drive
        };
        let mut refused = None;
        assert!(may_drive(StageTraits::NONE, &mut refused) && refused.is_none());
        assert!(!may_drive(stage, &mut refused) && refused.is_some());
    }
}
