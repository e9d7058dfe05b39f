//! The friction compensator at the interface of the current loop: `f32` outside, any number type inside.
//!
//! The loop computes in `f32`. The compensator may use [`compensator_core::Fixed`]. [`Compensate`] is the interface that the
//! loop needs, and [`JointCompensator`] implements it for the core's compensator in any number type. A joint without a
//! compensator implements it as well.

use compensator_core::adaptation::Gains;
use compensator_core::compensator::Reading;
use compensator_core::configuration::Configuration;
use compensator_core::network::Factors;
use compensator_core::{Compensator, CompensatorOutput, Flags, Inputs, ParameterError, Real};
use core::cell::Cell;

/// Interface of a compensator to the current loop.
///
/// # Contract
/// Outputs are finite for all inputs. If the compensator is disabled, [`Compensate::sum`] returns the command
/// with the same bits unless a limit acts.
pub trait Compensate {
    /// Enables the compensator, at rest and with zero torque, or disables it.
    fn set_enabled(&mut self, enabled: bool);
    /// Returns true if the compensator is enabled.
    fn is_enabled(&self) -> bool;
    /// Processes one sample of the joint.
    fn step(&mut self, inputs: &Inputs<f32>) -> CompensatorOutput<f32>;
    /// Adds the compensation to a command, A, and limits the sum.
    fn sum(&self, command_a: f32, output: &CompensatorOutput<f32>) -> (f32, Flags);
    /// Returns the present limit of the motor current, A; infinite if [`Compensate::sum`] has none of its own.
    fn current_limit_a(&self) -> f32 {
        f32::INFINITY
    }
    /// Returns the joint torque per motor current, Nm/A, gear included.
    fn torque_constant_nm_per_a(&self) -> f32;
    /// Sets the factors that a network supplies; `None` selects the constants of the law.
    fn supply(&mut self, factors: Option<Factors<f32>>);
    /// Becomes a copy of another compensator. What [`Compensate::replace_base`] copies may be missing.
    fn replace(&mut self, from: &Self)
    where
        Self: Clone,
    {
        self.clone_from(from);
    }
    /// Completes [`Compensate::replace`]: only then may gains be set.
    fn replace_base(&mut self, _from: &Self) {}
    /// Sets the gains on the sizes of the model; a joint without one has none.
    fn set_gains(&mut self, _gains: &Gains<f32>) {}
    /// Returns the torque held by the deflected bristles, Nm.
    fn bristle_torque_nm(&self) -> f32;
}

/// The core's compensator, for any number type, limited to the share of the current that the temperature permits.
#[derive(Clone, Debug)]
pub struct JointCompensator<T: Real> {
    inner: Compensator<T>,
    torque_constant_nm_per_a: f32,
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

impl<T: Real<Setting = f32>> JointCompensator<T> {
    /// Builds a compensator for a period in s; it is disabled at first.
    ///
    /// # Errors
    /// As [`Compensator::build`].
    pub fn build(configuration: &Configuration, period_s: f32) -> Result<Self, ParameterError> {
        Ok(Self {
            inner: Compensator::build(configuration, period_s)?,
            torque_constant_nm_per_a: configuration.compensator.torque_constant_nm_per_a,
            max_current_a: f32::INFINITY,
            limit_a: Cell::new(f32::INFINITY),
            compensation: Cell::new(1.0),
        })
    }

    /// Returns the compensator limited to this current, A, besides the limit of its parameters.
    #[must_use]
    pub fn limited_to(self, max_current_a: f32) -> Self {
        Self { max_current_a, limit_a: Cell::new(max_current_a), ..self }
    }

    pub(crate) fn set_current_share(&self, share: f32) {
        self.limit_a.set(self.max_current_a * limited_share(share));
    }

    pub(crate) fn set_compensation_share(&self, share: f32) {
        self.compensation.set(limited_share(share));
    }
}

impl<T: Real<Setting = f32>> Compensate for JointCompensator<T> {
    fn set_enabled(&mut self, enabled: bool) {
        self.inner.set_enabled(enabled);
    }

    fn is_enabled(&self) -> bool {
        self.inner.is_enabled()
    }

    #[inline]
    fn step(&mut self, inputs: &Inputs<f32>) -> CompensatorOutput<f32> {
        let output = self.inner.step(&convert(inputs));
        let left = self.compensation.get();
        CompensatorOutput {
            friction_torque_nm: single(output.friction_torque_nm),
            compensation_torque_nm: left * single(output.compensation_torque_nm),
            feed_forward_current_a: left * single(output.feed_forward_current_a),
            flags: output.flags,
        }
    }

    #[inline]
    fn sum(&self, command_a: f32, output: &CompensatorOutput<f32>) -> (f32, Flags) {
        let output = CompensatorOutput {
            friction_torque_nm: T::from_setting(output.friction_torque_nm),
            compensation_torque_nm: T::from_setting(output.compensation_torque_nm),
            feed_forward_current_a: T::from_setting(output.feed_forward_current_a),
            flags: output.flags,
        };
        let command = T::from_setting(command_a);
        let (sum, flags) = self.inner.sum(command, &output);
        // If disabled, the command must keep its bits: a coarser number type would round it.
        let acted = flags.intersects(Flags::CURRENT_LIMITED | Flags::COMMAND_INVALID);
        let passes = !self.inner.is_enabled() && !acted && command_a.is_finite();
        let sum = if passes { command_a } else { single(sum) };
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
        self.torque_constant_nm_per_a
    }

    fn supply(&mut self, factors: Option<Factors<f32>>) {
        self.inner.supply(factors.map(|factors| Factors {
            coulomb: T::from_setting(factors.coulomb),
            static_level: T::from_setting(factors.static_level),
            stiffness: T::from_setting(factors.stiffness),
        }));
    }

    fn replace(&mut self, from: &Self) {
        self.inner.replace(&from.inner);
        self.torque_constant_nm_per_a = from.torque_constant_nm_per_a;
        self.max_current_a = from.max_current_a;
        self.limit_a.clone_from(&from.limit_a);
        self.compensation.clone_from(&from.compensation);
    }

    fn replace_base(&mut self, from: &Self) {
        self.inner.replace_base(&from.inner);
    }

    fn set_gains(&mut self, gains: &Gains<f32>) {
        self.inner.set_gains(&gains.convert());
    }

    fn bristle_torque_nm(&self) -> f32 {
        single(self.inner.bristle_torque_nm())
    }
}

#[inline(always)]
fn single<T: Real>(number: T) -> f32 {
    number.value() as f32
}

/// Converts inputs to another number type. A type without NaN would convert NaN to a fresh 0; such a reading is
/// marked missing. For `f32` the conversion compiles to nothing.
#[inline(always)]
fn convert<T: Real<Setting = f32>>(inputs: &Inputs<f32>) -> Inputs<T> {
    let reading = |from: Reading<f32>| {
        let (value, age_s) = (T::from_setting(from.value), T::from_setting(from.age_s));
        let same = value.value().is_finite() == from.value.is_finite()
            && age_s.value().is_nan() == from.age_s.is_nan();
        if same { Reading { value, age_s } } else { Reading::missing() }
    };
    let time = T::from_setting(inputs.campaign_time_h);
    let timed = time.value().is_finite() == inputs.campaign_time_h.is_finite();
    // A negative time is refused by the compensator, which then holds the last valid one.
    inputs.convert(reading, if timed { time } else { -T::one() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::PERIOD_S;
    use crate::reference_joint::configuration;
    use compensator_core::{Fixed, LawKind};

    fn build<T: Real<Setting = f32>>() -> JointCompensator<T> {
        JointCompensator::build(&configuration(LawKind::ImprovedLugre, &[]), PERIOD_S)
            .expect("the joint is legal")
    }

    fn pass<T: Real<Setting = f32>>(command: f32) -> (f32, Flags) {
        let mut off = build::<T>();
        let output = off.step(&Inputs::velocity(1.0));
        off.sum(command, &output)
    }

    #[test]
    fn disabled_sum_within_limits_keeps_the_command_bits() {
        for command in [0.1f32, -0.0, 1e-20, -25.999_999, 17.123_457] {
            assert_eq!(pass::<f32>(command).0.to_bits(), command.to_bits());
            assert_eq!(pass::<Fixed>(command).0.to_bits(), command.to_bits());
        }
        for command in [27.0, 1e9, f32::NAN, f32::INFINITY] {
            assert!(pass::<f32>(command).0.abs() <= 26.0);
            assert!(pass::<Fixed>(command).0.abs() <= 26.0);
        }
    }

    #[test]
    fn step_in_fixed_point_matches_f32_and_nan_is_treated_as_missing() {
        let (mut float, mut fixed) = (build::<f32>(), build::<Fixed>());
        float.set_enabled(true);
        fixed.set_enabled(true);
        let mut inputs = Inputs::velocity(0.5);
        inputs.radial_force_n = Reading::fresh(40.0);
        let run = |inputs: &Inputs<f32>,
                   float: &mut JointCompensator<f32>,
                   fixed: &mut JointCompensator<Fixed>| {
            for _ in 0..2000 {
                float.step(inputs);
                fixed.step(inputs);
            }
            let (float, fixed) = (float.step(inputs), fixed.step(inputs));
            let difference = float.friction_torque_nm - fixed.friction_torque_nm;
            assert!(difference.abs() < 2e-3, "{float:?}, {fixed:?}");
            float.friction_torque_nm
        };
        let known = run(&inputs, &mut float, &mut fixed);
        inputs.radial_force_n = Reading::fresh(f32::NAN);
        let held = run(&inputs, &mut float, &mut fixed);
        // After 0.1 s of NaN, the side load of 40 N is held, not replaced by 0.
        assert!((held - known).abs() < 0.02, "{held} against {known}");
        inputs.radial_force_n = Reading { value: 0.0, age_s: f32::NAN };
        run(&inputs, &mut float, &mut fixed);
    }
}
