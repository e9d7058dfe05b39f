//! A joint in HIL (hardware in the loop): its inputs come over the bus, as in a replay.
//!
//! All inputs come in frames. The compensator takes one step at each SYNC, and its outputs return in frames;
//! nothing drives a bridge. The joint driver runs this code on its processor. The PC that replays a trace runs
//! the same code on the frames it sent. The two differ only in compiler, processor, floating-point unit and bus,
//! so their answers must agree bit for bit. A network that supplies the law is evaluated here too, at the rate
//! of its training: before the first sample after enabling, and then at a fixed number of samples. A joint that adapts its
//! friction levels learns from the measured torque of the samples, at the tuned set from the begin of a run on.

use crate::control::{Covariates, LoopFlags};
use crate::level_learner::{LearningSample, LevelLearner};
use crate::node::dictionary::records::NetworkObject;
#[cfg(feature = "fixed")]
use compensator_core::Fixed;
use compensator_core::adaptation::{Frozen, Gains};
use compensator_core::can::{
    AnswerFrame, Message, NodeId, SampleAssembler, StatusFrame, SyncFrame, SyncOutcome,
    TelemetryFrame,
};
use compensator_core::configuration::Configuration;
use compensator_core::network::{FactorSupplier, JointNetwork};
use compensator_core::parameters::Text;
use compensator_core::text;
use compensator_core::{Compensator, Flags, ParameterError, Real};

/// Longest time for which a measured torque is held for the learning, s. A joint on its sensors sends its torque at every
/// tenth SYNC.
const TORQUE_HELD_S: f32 = 0.05;

/// Number type of the compensator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NumberType {
    /// `f32`.
    #[default]
    Float,
    /// [`compensator_core::Fixed`], for processors without a floating-point unit; in images with the feature
    /// `fixed`.
    #[cfg(feature = "fixed")]
    Fixed,
}

impl NumberType {
    /// Description of the codes that [`Self::from_code`] accepts.
    pub const LEGAL_CODES: Text = if cfg!(feature = "fixed") {
        text!("0 (f32) or 1 (fixed point)")
    } else {
        text!("0 (f32): this driver has no fixed point")
    };

    /// Returns the number type of a code; `None` if there is none, or if this image does not contain it.
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Float),
            #[cfg(feature = "fixed")]
            1 => Some(Self::Fixed),
            _ => None,
        }
    }
}

/// A compensator in the selected number type.
#[allow(clippy::large_enum_variant)] // There is no allocator to box in; `Absent` occurs only in a blank driver.
#[derive(Clone, Debug)]
enum HilCompensator {
    /// No model: every answer is 0 and has the flag that compensation is off.
    Absent,
    Float(SuppliedCompensator<f32>),
    #[cfg(feature = "fixed")]
    Fixed(SuppliedCompensator<Fixed>),
}

/// A compensator, and the network that supplies it, if any.
#[derive(Clone, Debug)]
struct SuppliedCompensator<T: Real> {
    compensator: Compensator<T>,
    supply: Option<NetworkSchedule<T>>,
}

/// A network and the rate of its evaluation.
#[derive(Clone, Debug)]
struct NetworkSchedule<T: Real> {
    supplier: FactorSupplier<T>,
    /// Samples from one evaluation to the next.
    period_samples: u32,
    /// Samples left to the next evaluation.
    samples_left: u32,
}

impl<T: Real<Setting = f32>> SuppliedCompensator<T> {
    #[inline(never)]
    fn build(
        configuration: &Configuration,
        network: Option<&JointNetwork>,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        let supply = match network {
            None => None,
            Some(network) => {
                let supplier = FactorSupplier::build(network, configuration.compensator.hold_s)?;
                let period_samples = supplier.every(period_s)?;
                Some(NetworkSchedule { supplier, period_samples, samples_left: 0 })
            }
        };
        Ok(Self { compensator: Compensator::build(configuration, period_s)?, supply })
    }

    fn set_enabled(&mut self, enabled: bool) {
        if !enabled && let Some(supply) = &mut self.supply {
            supply.supplier.rest();
            supply.samples_left = 0;
        }
        self.compensator.set_enabled(enabled);
    }

    fn network_object(&self) -> Option<NetworkObject> {
        self.supply.as_ref().map(|supply| network_object(&supply.supplier))
    }
}

/// Returns the state of a network (200Bh).
pub(crate) fn network_object<T: Real<Setting = f32>>(
    supplier: &FactorSupplier<T>,
) -> NetworkObject {
    let state = supplier.state();
    let bits = |value: T| (value.value() as f32).to_bits();
    let [coulomb_factor, static_factor, stiffness_factor] = state.factors.to_array().map(bits);
    NetworkObject {
        present: 1,
        outside: state.is_outside.into(),
        outside_count: state.outside_count,
        share: bits(state.share),
        coulomb_factor,
        static_factor,
        stiffness_factor,
    }
}

/// The answer of a joint to a SYNC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HilReply {
    /// TPDO 1.
    pub answer: AnswerFrame,
    /// TPDO 2.
    pub status: StatusFrame,
    /// TPDO 3.
    pub telemetry: TelemetryFrame,
}

impl HilReply {
    /// The answer of a joint before its first sample.
    pub const NONE: Self = Self {
        answer: AnswerFrame { friction_torque_nm: 0.0, feed_forward_current_a: 0.0 },
        status: StatusFrame { flags: Flags::DISABLED, sequence: 0 },
        telemetry: TelemetryFrame { current_a: 0.0, residual_torque_nm: f32::NAN },
    };

    /// Returns all values as words, in the order of the frames, which is that of 2005h.
    pub fn words(&self) -> [u32; 6] {
        [
            self.answer.friction_torque_nm.to_bits(),
            self.answer.feed_forward_current_a.to_bits(),
            self.status.flags.bits(),
            self.status.sequence,
            self.telemetry.current_a.to_bits(),
            self.telemetry.residual_torque_nm.to_bits(),
        ]
    }
}

/// Result of a SYNC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HilStep {
    /// A sample was computed; the number of SYNCs lost before it.
    Reply(HilReply, u32),
    /// The same SYNC was received again and ignored.
    Duplicate,
    /// A SYNC older than the last one was received and ignored.
    Late,
}

/// Settings of a joint in HIL besides its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HilSetup {
    /// Number type of the compensator.
    pub number: NumberType,
    /// Time from SYNC to SYNC, s.
    pub period_s: f32,
    /// Age of the campaign at the start of a run, h.
    pub campaign_h: f32,
}

/// A compensator whose inputs and outputs are frames.
#[derive(Clone, Debug)]
pub struct HilJoint {
    setup: HilSetup,
    inbox: SampleAssembler,
    compensator: HilCompensator,
    /// Gains that were set on the sizes of the model; `None` before the first.
    gains: Option<Gains<f32>>,
}

impl HilJoint {
    /// Builds the compensator; it is disabled.
    ///
    /// # Errors
    /// As [`Compensator::build`], [`FactorSupplier::build`] and [`FactorSupplier::every`].
    #[inline(never)]
    pub fn build(
        node: NodeId,
        configuration: &Configuration,
        network: Option<&JointNetwork>,
        setup: HilSetup,
    ) -> Result<Self, ParameterError> {
        let compensator = match setup.number {
            NumberType::Float => HilCompensator::Float(SuppliedCompensator::build(
                configuration,
                network,
                setup.period_s,
            )?),
            #[cfg(feature = "fixed")]
            NumberType::Fixed => HilCompensator::Fixed(SuppliedCompensator::build(
                configuration,
                network,
                setup.period_s,
            )?),
        };
        Ok(Self { setup, inbox: SampleAssembler::new(node), compensator, gains: None })
    }

    /// Creates a joint without a model: it answers and compensates nothing.
    pub const fn without_model(node: NodeId, setup: HilSetup) -> Self {
        let compensator = HilCompensator::Absent;
        Self { setup, inbox: SampleAssembler::new(node), compensator, gains: None }
    }

    /// Enables the compensator, at rest, or disables it.
    pub fn set_enabled(&mut self, enabled: bool) {
        match &mut self.compensator {
            HilCompensator::Absent => {}
            HilCompensator::Float(joint) => joint.set_enabled(enabled),
            #[cfg(feature = "fixed")]
            HilCompensator::Fixed(joint) => joint.set_enabled(enabled),
        }
    }

    /// Returns true if the compensator is enabled.
    pub fn is_enabled(&self) -> bool {
        match &self.compensator {
            HilCompensator::Absent => false,
            HilCompensator::Float(joint) => joint.compensator.is_enabled(),
            #[cfg(feature = "fixed")]
            HilCompensator::Fixed(joint) => joint.compensator.is_enabled(),
        }
    }

    /// Returns the state of the network (200Bh); `None` without one.
    pub(crate) fn network_object(&self) -> Option<NetworkObject> {
        match &self.compensator {
            HilCompensator::Absent => None,
            HilCompensator::Float(joint) => joint.network_object(),
            #[cfg(feature = "fixed")]
            HilCompensator::Fixed(joint) => joint.network_object(),
        }
    }

    /// Returns the settings.
    pub const fn setup(&self) -> HilSetup {
        self.setup
    }

    /// Returns the inputs received for the next sample.
    pub const fn inbox(&self) -> &SampleAssembler {
        &self.inbox
    }

    /// Processes a message other than SYNC. A new run resets the compensator to rest.
    ///
    /// Returns true if a new run begins. What was learnt in the last one must then be discarded, so that every run gives the
    /// same answers again.
    pub fn take(&mut self, message: &Message) -> bool {
        let is_new_run = self.inbox.take(message);
        if is_new_run && self.is_enabled() {
            self.set_enabled(false);
            self.set_enabled(true);
        }
        is_new_run
    }

    /// Commands this current, A, in place of a Command frame, without a velocity reference.
    pub fn set_command(&mut self, current_a: f32) {
        self.inbox.set_command(current_a);
    }

    /// Processes a SYNC, and computes a step if it ends a sample.
    pub fn sync(&mut self, sync: SyncFrame) -> HilStep {
        self.step(sync, None)
    }

    /// Processes a SYNC as [`Self::sync`], with the gains of `learner`, which then learns from the sample. `blocked` is a
    /// reason of the settings to learn nothing.
    pub fn sync_learning(
        &mut self,
        sync: SyncFrame,
        learner: &mut LevelLearner,
        blocked: Option<Frozen>,
    ) -> HilStep {
        self.set_gains(&learner.gains());
        self.step(sync, Some((learner, blocked)))
    }

    /// Sets gains on the sizes of the model, if they are others than those in use.
    fn set_gains(&mut self, gains: &Gains<f32>) {
        if self.gains.unwrap_or_default() == *gains {
            return;
        }
        self.gains = Some(*gains);
        match &mut self.compensator {
            HilCompensator::Absent => {}
            HilCompensator::Float(joint) => joint.compensator.set_gains(gains),
            #[cfg(feature = "fixed")]
            HilCompensator::Fixed(joint) => joint.compensator.set_gains(&gains.convert()),
        }
    }

    fn step(
        &mut self,
        sync: SyncFrame,
        learning: Option<(&mut LevelLearner, Option<Frozen>)>,
    ) -> HilStep {
        let lost = match self.inbox.sync(sync) {
            SyncOutcome::Sample { lost } => lost,
            SyncOutcome::Duplicate => return HilStep::Duplicate,
            SyncOutcome::Late => return HilStep::Late,
        };
        let (inbox, setup) = (&self.inbox, self.setup);
        let reply = match &mut self.compensator {
            HilCompensator::Absent => {
                let status = StatusFrame { flags: Flags::DISABLED, sequence: inbox.sequence() };
                HilReply { status, ..HilReply::NONE }
            }
            HilCompensator::Float(joint) => reply(joint, inbox, setup),
            #[cfg(feature = "fixed")]
            HilCompensator::Fixed(joint) => reply(joint, inbox, setup),
        };
        if let Some((learner, blocked)) = learning
            && learner.is_active()
        {
            self.learn(learner, blocked, reply.status.flags);
        }
        self.inbox.end_sample();
        HilStep::Reply(reply, lost)
    }

    /// Learns from the sample that the last SYNC ended.
    #[inline(never)]
    fn learn(&self, learner: &mut LevelLearner, blocked: Option<Frozen>, flags: Flags) {
        let inputs = self.inbox.inputs::<f32>(self.setup.period_s, self.setup.campaign_h);
        let torque = self.inbox.torque_nm(self.setup.period_s);
        let is_held = (0.0..TORQUE_HELD_S).contains(&torque.age_s);
        let is_known = inputs.position_rad.age_s >= 0.0;
        learner.take_covariates(&Covariates::of_inputs(&inputs));
        let sample = LearningSample {
            velocity_rad_s: inputs.velocity_rad_s.value,
            position_rad: if is_known { inputs.position_rad.value } else { f32::NAN },
            torque_nm: if is_held { torque.value } else { f32::NAN },
            loop_flags: LoopFlags::empty(),
            flags,
            campaign_time_h: inputs.campaign_time_h,
        };
        learner.step(&sample, blocked.or((!self.is_enabled()).then_some(Frozen::NotArmed)));
    }
}

fn reply<T: Real<Setting = f32>>(
    joint: &mut SuppliedCompensator<T>,
    inbox: &SampleAssembler,
    setup: HilSetup,
) -> HilReply {
    let SuppliedCompensator { compensator, supply } = joint;
    let inputs = inbox.inputs::<T>(setup.period_s, setup.campaign_h);
    let mut outside = Flags::empty();
    if let Some(NetworkSchedule { supplier, period_samples, samples_left }) = supply
        && compensator.is_enabled()
    {
        if *samples_left == 0 {
            *samples_left = *period_samples;
            let factors = supplier.evaluate(&inputs, compensator.bristle_torque_nm());
            compensator.supply(Some(factors));
        }
        *samples_left -= 1;
        outside.set(Flags::NETWORK_OUTSIDE, supplier.state().is_outside);
    }
    let output = compensator.step(&inputs);
    let command = T::from_setting(inbox.command_current_a());
    let (current, flags) = compensator.sum(command, &output);
    let flags = flags | outside;
    // The conversion to `f32` through `f64`, which holds both types exactly, rounds once.
    let number = |value: T| value.value() as f32;
    let friction_torque_nm = number(output.friction_torque_nm);
    HilReply {
        answer: AnswerFrame {
            friction_torque_nm,
            feed_forward_current_a: number(output.feed_forward_current_a),
        },
        status: StatusFrame { flags, sequence: inbox.sequence() },
        telemetry: TelemetryFrame {
            current_a: number(current),
            residual_torque_nm: residual(inbox.measured_torque_nm(), friction_torque_nm, flags),
        },
    }
}

/// Returns measured less modelled torque, Nm; NaN if either is missing. NaN is always the same constant, because
/// the bits of a computed NaN depend on the processor.
fn residual(measured_nm: f32, modelled_nm: f32, flags: Flags) -> f32 {
    let difference = measured_nm - modelled_nm;
    if difference.is_nan() || flags.contains(Flags::DISABLED) { f32::NAN } else { difference }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::Covariates;
    use compensator_core::can::{MotionFrame, SealFrame, SurroundingsFrame, TorqueFrame};

    #[test]
    fn inbox_with_all_frames_gives_every_covariate_with_its_age() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        let node = NodeId::FIRST;
        for message in [
            Message::Motion(node, MotionFrame { velocity_rad_s: 0.5, position_rad: 0.25 }),
            Message::Torque(node, TorqueFrame { torque_nm: 7.0, load_torque_nm: 6.0 }),
            Message::Seal(node, SealFrame { radial_force_n: 5.0, pressure_diff_pa: 4e6 }),
            Message::Surroundings(node, SurroundingsFrame { temperature_c: 3.0, auxiliary: 2.0 }),
        ] {
            inbox.take(&message);
        }
        inbox.end_sample();
        let inputs = inbox.inputs::<f32>(1e-3, 0.0);
        let mut values = Vec::new();
        for quantity in Covariates::QUANTITIES {
            let reading = quantity.reading_in(&inputs);
            assert_eq!(reading.age_s, 1e-3, "{quantity:?}");
            assert!(!values.contains(&reading.value), "{quantity:?} is that of another");
            values.push(reading.value);
        }
    }
}
