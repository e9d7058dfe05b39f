//! A joint in HIL (hardware in the loop): its inputs come over the bus, as in a replay.
//!
//! Every input comes in frames, the compensator takes one step at each SYNC, and all it gives goes back
//! in frames; nothing drives a bridge. The joint driver runs this code on its processor, and the PC that
//! replays a trace to it runs the same code beside it on the frames it sent. The two then differ in
//! compiler, processor and floating-point unit, in the bus between and in nothing else, so their answers
//! must agree to the last bit. A network that supplies the law is evaluated here too, at the rate it was trained with:
//! before the first sample after the joint was switched on, and then every so many samples.

#[cfg(feature = "fixed")]
use compensator_core::Fixed;
use compensator_core::can::{Answer, Inbox, Message, Node, Status, Sync, SyncOutcome, Telemetry};
use compensator_core::configuration::Configuration;
use compensator_core::network::{Factors, JointNetwork, Supplier};
use compensator_core::{Compensator, Flags, ParameterError, Real};

/// The number a joint computes with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Number {
    /// `f32`.
    #[default]
    Float,
    /// [`compensator_core::Fixed`], for processors without a floating-point unit; in images with the feature `fixed`.
    #[cfg(feature = "fixed")]
    Fixed,
}

impl Number {
    /// What [`Self::from_code`] takes, in words.
    pub const LEGAL: &str = if cfg!(feature = "fixed") {
        "0 (f32) or 1 (fixed point)"
    } else {
        "0 (f32): this driver has no fixed point"
    };

    /// The number of a code; `None` where there is none, or this image does not have it.
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Self::Float),
            #[cfg(feature = "fixed")]
            1 => Some(Self::Fixed),
            _ => None,
        }
    }
}

/// A compensator in the number it was asked for.
#[allow(clippy::large_enum_variant)] // No allocator to box in; an absent one is for a blank driver alone.
#[derive(Clone, Debug)]
enum Either {
    /// None: every answer is 0 and says that it is off.
    Absent,
    Float(Joint<f32>),
    #[cfg(feature = "fixed")]
    Fixed(Joint<Fixed>),
}

/// A compensator, and the network that supplies it, where one does.
#[derive(Clone, Debug)]
struct Joint<T: Real> {
    compensator: Compensator<T>,
    supply: Option<Supply<T>>,
}

/// A network at its own rate.
#[derive(Clone, Debug)]
struct Supply<T: Real> {
    supplier: Supplier<T>,
    /// Samples from one evaluation to the next.
    every: u32,
    /// Samples to the next one.
    left: u32,
}

impl<T: Real<Setting = f32>> Joint<T> {
    fn build(
        configuration: &Configuration,
        network: Option<&JointNetwork>,
        period_s: f32,
    ) -> Result<Self, ParameterError> {
        let supply = match network {
            None => None,
            Some(network) => {
                let supplier = Supplier::build(network, configuration.compensator.hold_s)?;
                let every = supplier.every(period_s)?;
                Some(Supply { supplier, every, left: 0 })
            }
        };
        Ok(Self { compensator: Compensator::build(configuration, period_s)?, supply })
    }

    fn set_enabled(&mut self, enabled: bool) {
        if !enabled && let Some(supply) = &mut self.supply {
            supply.supplier.rest();
            supply.left = 0;
        }
        self.compensator.set_enabled(enabled);
    }

    fn guard(&self) -> Option<NetworkGuard> {
        let state = self.supply.as_ref()?.supplier.state();
        let number = |value: T| value.value() as f32;
        let [coulomb, static_level, stiffness] = state.factors.to_array().map(number);
        Some(NetworkGuard {
            is_outside: state.is_outside,
            outside_count: state.outside_count,
            share: number(state.share),
            factors: Factors { coulomb, static_level, stiffness },
        })
    }
}

/// How a network stands to the inputs it was trained on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetworkGuard {
    /// Its last evaluation lay outside.
    pub is_outside: bool,
    /// Evaluations outside since the start.
    pub outside_count: u32,
    /// How much it has to say, 0 (the law's constants) to 1.
    pub share: f32,
    /// The factors in force.
    pub factors: Factors<f32>,
}

/// What a joint says after a SYNC.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reply {
    /// TPDO 1.
    pub answer: Answer,
    /// TPDO 2.
    pub status: Status,
    /// TPDO 3.
    pub telemetry: Telemetry,
}

impl Reply {
    /// What a joint says before its first sample.
    pub const NONE: Self = Self {
        answer: Answer { friction_torque_nm: 0.0, feed_forward_current_a: 0.0 },
        status: Status { flags: Flags::DISABLED, sequence: 0 },
        telemetry: Telemetry { current_a: 0.0, residual_torque_nm: f32::NAN },
    };

    /// Whether every bit is the same; NaN is equal to itself here.
    pub fn same_bits(&self, other: &Self) -> bool {
        self.words() == other.words()
    }

    /// All of it, in the order of the frames.
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

/// What a SYNC led to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// A sample, and how many were lost before it.
    Reply(Reply, u8),
    /// The same SYNC again: nothing was done.
    Duplicate,
    /// A SYNC from before the last: nothing was done.
    Late,
}

/// What a joint in HIL is besides its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HilSetup {
    /// The number it computes with.
    pub number: Number,
    /// Time from SYNC to SYNC, s.
    pub period_s: f32,
    /// Age of the campaign when a run begins, h.
    pub campaign_h: f32,
}

/// A compensator between frames.
#[derive(Clone, Debug)]
pub struct HilJoint {
    setup: HilSetup,
    inbox: Inbox,
    compensator: Either,
}

impl HilJoint {
    /// Builds the compensator; it is off.
    ///
    /// # Errors
    /// As [`Compensator::build`], [`Supplier::build`] and [`Supplier::every`].
    pub fn build(
        node: Node,
        configuration: &Configuration,
        network: Option<&JointNetwork>,
        setup: HilSetup,
    ) -> Result<Self, ParameterError> {
        let compensator = match setup.number {
            Number::Float => Either::Float(Joint::build(configuration, network, setup.period_s)?),
            #[cfg(feature = "fixed")]
            Number::Fixed => Either::Fixed(Joint::build(configuration, network, setup.period_s)?),
        };
        Ok(Self { setup, inbox: Inbox::new(node), compensator })
    }

    /// A joint without a model: it answers, and compensates nothing.
    pub const fn without_model(node: Node, setup: HilSetup) -> Self {
        Self { setup, inbox: Inbox::new(node), compensator: Either::Absent }
    }

    /// Switches the compensator on or off; on begins at rest.
    pub fn set_enabled(&mut self, enabled: bool) {
        match &mut self.compensator {
            Either::Absent => {}
            Either::Float(joint) => joint.set_enabled(enabled),
            #[cfg(feature = "fixed")]
            Either::Fixed(joint) => joint.set_enabled(enabled),
        }
    }

    /// Whether it is on.
    pub fn is_enabled(&self) -> bool {
        match &self.compensator {
            Either::Absent => false,
            Either::Float(joint) => joint.compensator.is_enabled(),
            #[cfg(feature = "fixed")]
            Either::Fixed(joint) => joint.compensator.is_enabled(),
        }
    }

    /// How its network stands to what it was trained on; `None` without one.
    pub fn network_guard(&self) -> Option<NetworkGuard> {
        match &self.compensator {
            Either::Absent => None,
            Either::Float(joint) => joint.guard(),
            #[cfg(feature = "fixed")]
            Either::Fixed(joint) => joint.guard(),
        }
    }

    /// What it is built for.
    pub const fn setup(&self) -> HilSetup {
        self.setup
    }

    /// What has been heard of the sample that is being put together.
    pub const fn inbox(&self) -> &Inbox {
        &self.inbox
    }

    /// Takes in a message that is no SYNC. A new run begins with the compensator at rest.
    pub fn take(&mut self, message: &Message) {
        if self.inbox.take(message) && self.is_enabled() {
            self.set_enabled(false);
            self.set_enabled(true);
        }
    }

    /// Takes in a SYNC, and steps where it ends a sample.
    pub fn sync(&mut self, sync: Sync) -> Step {
        let lost = match self.inbox.sync(sync) {
            SyncOutcome::Sample { lost } => lost,
            SyncOutcome::Duplicate => return Step::Duplicate,
            SyncOutcome::Late => return Step::Late,
        };
        let (inbox, setup) = (&self.inbox, self.setup);
        let reply = match &mut self.compensator {
            Either::Absent => {
                let status = Status { flags: Flags::DISABLED, sequence: inbox.sequence() };
                Reply { status, ..Reply::NONE }
            }
            Either::Float(joint) => reply(joint, inbox, setup),
            #[cfg(feature = "fixed")]
            Either::Fixed(joint) => reply(joint, inbox, setup),
        };
        self.inbox.end_sample();
        Step::Reply(reply, lost)
    }
}

fn reply<T: Real<Setting = f32>>(joint: &mut Joint<T>, inbox: &Inbox, setup: HilSetup) -> Reply {
    let Joint { compensator, supply } = joint;
    let inputs = inbox.inputs::<T>(setup.period_s, setup.campaign_h);
    let mut outside = Flags::empty();
    if let Some(Supply { supplier, every, left }) = supply
        && compensator.is_enabled()
    {
        if *left == 0 {
            *left = *every;
            let factors = supplier.evaluate(&inputs, compensator.bristle_torque_nm());
            compensator.supply(Some(factors));
        }
        *left -= 1;
        outside.set(Flags::NETWORK_OUTSIDE, supplier.state().is_outside);
    }
    let output = compensator.step(&inputs);
    let command = inbox.command_current_a(setup.period_s).map_or(0.0, |reading| reading.value);
    let (current, flags) = compensator.sum(T::from_setting(command), &output);
    let flags = flags | outside;
    // To `f32` by way of `f64`, which holds either number exactly: one rounding.
    let number = |value: T| value.value() as f32;
    let friction_torque_nm = number(output.friction_torque_nm);
    Reply {
        answer: Answer {
            friction_torque_nm,
            feed_forward_current_a: number(output.feed_forward_current_a),
        },
        status: Status { flags, sequence: inbox.sequence() },
        telemetry: Telemetry {
            current_a: number(current),
            residual_torque_nm: residual(inbox.measured_torque_nm(), friction_torque_nm, flags),
        },
    }
}

/// Measured less modelled torque, Nm; NaN where nothing is measured or nothing modelled. Every NaN is
/// the same one: processors differ in which they make.
fn residual(measured_nm: f32, modelled_nm: f32, flags: Flags) -> f32 {
    let difference = measured_nm - modelled_nm;
    if difference.is_nan() || flags.contains(Flags::DISABLED) { f32::NAN } else { difference }
}
