//! Assembles received frames into the inputs of one sample.
//!
//! Frames received before a SYNC belong to its sample. A quantity that is not received again keeps its last
//! value, and its age grows by one sample period per SYNC. A slow sensor may therefore send once per second.
//! NaN means that the quantity has no sensor; it counts as never received, not as invalid. The SYNC counter
//! identifies duplicate, late and lost SYNCs. Only a new SYNC completes a sample. A trace may announce the number
//! of the next sample: the next SYNC then completes that sample, whatever its counter, as in a log that the PC
//! reads. A driver in HIL and the PC that checks it run this same code, each on its own frames.

use super::{
    CommandFrame, Message, MotionFrame, NodeId, SealFrame, SurroundingsFrame, SyncFrame,
    TorqueFrame, TraceEntry,
};
use crate::number::Real;
use crate::quantity::{Inputs, Reading};

/// Classification of a SYNC by its counter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncOutcome {
    /// The SYNC completes a sample.
    Sample {
        /// Number of SYNCs lost before this one. Without an announced number, it is known modulo 240.
        lost: u32,
    },
    /// The SYNC repeats the last one.
    Duplicate,
    /// The SYNC is older than the last one.
    Late,
}

/// A received value and its age, in samples.
#[derive(Clone, Copy, Debug)]
struct Received<M> {
    value: M,
    age: u32,
}

/// The inputs of a joint in HIL, assembled from CAN frames.
#[derive(Clone, Debug)]
pub struct SampleAssembler {
    node: NodeId,
    motion: Option<Received<MotionFrame>>,
    torque: Option<Received<TorqueFrame>>,
    seal: Option<Received<SealFrame>>,
    surroundings: Option<Received<SurroundingsFrame>>,
    command: Option<Received<CommandFrame>>,
    /// Number of the current sample in its run, from 0, if no SYNC before it is lost.
    next: u32,
    /// Number announced for the current sample by a trace.
    announced: Option<u32>,
    /// Counter of the last SYNC; `None` before the first.
    last_counter: Option<u8>,
}

impl SampleAssembler {
    /// Creates an assembler without received values.
    pub const fn new(node: NodeId) -> Self {
        Self {
            node,
            motion: None,
            torque: None,
            seal: None,
            surroundings: None,
            command: None,
            next: 0,
            announced: None,
            last_counter: None,
        }
    }

    /// Stores a message; messages of other nodes are ignored.
    ///
    /// Returns true if a new run begins. All received values are then discarded, and the caller must clear the
    /// state of the model.
    pub fn take(&mut self, message: &Message) -> bool {
        if message.node() != Some(self.node) {
            return false;
        }
        match *message {
            Message::Motion(_, value) => self.motion = Some(received(value)),
            Message::Torque(_, value) => self.torque = Some(received(value)),
            Message::Seal(_, value) => self.seal = Some(received(value)),
            Message::Surroundings(_, value) => self.surroundings = Some(received(value)),
            Message::Command(_, value) => {
                // A repeated counter is not a new command: its age continues.
                let last_counter = self.command.map(|received| received.value.counter);
                if last_counter != Some(value.counter) {
                    self.command = Some(received(value));
                }
            }
            Message::Entry(_, TraceEntry::Run(_)) => {
                *self = Self::new(self.node);
                return true;
            }
            Message::Entry(_, TraceEntry::Sequence(number)) => self.announced = Some(number),
            _ => {}
        }
        false
    }

    /// Sets the commanded current, A, of a sample whose master sends no Command frames; it has no velocity reference.
    pub fn set_command(&mut self, current_a: f32) {
        self.command = Some(received(CommandFrame::new(current_a, f32::NAN, 0)));
    }

    /// Processes a SYNC and classifies it.
    pub fn sync(&mut self, sync: SyncFrame) -> SyncOutcome {
        let number = match (self.announced.take(), self.last_counter) {
            (Some(announced), _) => announced,
            (None, None) => self.next,
            (None, Some(last)) => {
                let ring = u32::from(SyncFrame::LAST);
                let ahead = (ring + u32::from(sync.counter) - u32::from(last)) % ring;
                if ahead == 0 {
                    return SyncOutcome::Duplicate;
                }
                // More than half the counter range ahead counts as behind.
                if ahead > ring / 2 {
                    return SyncOutcome::Late;
                }
                self.next.wrapping_add(ahead - 1)
            }
        };
        // Losses before the first SYNC are unknown, and none precede a number that goes back.
        let lost = self.last_counter.map_or(0, |_| number.saturating_sub(self.next));
        (self.next, self.last_counter) = (number, Some(sync.counter));
        if lost > 0 {
            // A value of age 0 may have been received after the lost SYNCs; it counts as one of this sample.
            self.age_values(lost, 1);
        }
        SyncOutcome::Sample { lost }
    }

    /// Number in its run of the sample that the last SYNC completed, or that the next one will complete.
    pub fn sequence(&self) -> u32 {
        self.announced.unwrap_or(self.next)
    }

    /// Measured torque of the sample, Nm; NaN if it was not measured or not received in this sample.
    pub fn measured_torque_nm(&self) -> f32 {
        self.torque
            .filter(|received| received.age == 0)
            .map_or(f32::NAN, |received| received.value.torque_nm)
    }

    /// Last measured torque, Nm, and its age, s.
    pub fn torque_nm(&self, period_s: f32) -> Reading<f32> {
        reading(self.torque, period_s, |torque| torque.torque_nm)
    }

    /// Commanded current, A, as received; 0 before the first command. The compensator flags one that is not finite.
    pub fn command_current_a(&self) -> f32 {
        self.command.map_or(0.0, |received| received.value.current_a)
    }

    /// Returns the inputs of the sample.
    ///
    /// `period_s` is the sample period, s. `campaign_h` is the campaign time at the start of the run, h. The
    /// acceleration is not transmitted.
    pub fn inputs<T: Real<Setting = f32>>(&self, period_s: f32, campaign_h: f32) -> Inputs<T> {
        let motion = |of: fn(&MotionFrame) -> f32| reading(self.motion, period_s, of);
        let seal = |of: fn(&SealFrame) -> f32| reading(self.seal, period_s, of);
        let surroundings =
            |of: fn(&SurroundingsFrame) -> f32| reading(self.surroundings, period_s, of);
        let campaign = campaign_h + self.sequence() as f32 * (period_s / 3600.0);
        Inputs {
            // No `..Inputs::missing()`: a new covariate must be assigned its frame here.
            velocity_rad_s: motion(|of| of.velocity_rad_s),
            velocity_reference_rad_s: reading(self.command, period_s, |of| {
                of.velocity_reference_rad_s()
            }),
            position_rad: motion(|of| of.position_rad),
            radial_force_n: seal(|of| of.radial_force_n),
            pressure_diff_mpa: seal(SealFrame::pressure_diff_mpa),
            temperature_c: surroundings(|of| of.temperature_c),
            load_torque_nm: reading(self.torque, period_s, |of| of.load_torque_nm),
            auxiliary: surroundings(|of| of.auxiliary),
            acceleration_rad_s2: Reading::missing(),
            campaign_time_h: T::from_setting(campaign),
        }
    }

    /// Ends the sample: the age of every received value grows by one sample.
    pub fn end_sample(&mut self) {
        self.next = self.next.wrapping_add(1);
        self.age_values(1, 0);
    }

    /// Adds samples to the age of every received value that is at least `youngest` samples old.
    fn age_values(&mut self, samples: u32, youngest: u32) {
        age(&mut self.motion, samples, youngest);
        age(&mut self.torque, samples, youngest);
        age(&mut self.seal, samples, youngest);
        age(&mut self.surroundings, samples, youngest);
        age(&mut self.command, samples, youngest);
    }
}

fn received<M>(value: M) -> Received<M> {
    Received { value, age: 0 }
}

fn age<M>(received: &mut Option<Received<M>>, samples: u32, youngest: u32) {
    if let Some(received) = received.as_mut().filter(|received| received.age >= youngest) {
        received.age = received.age.saturating_add(samples);
    }
}

fn reading<M: Copy, T: Real<Setting = f32>>(
    received: Option<Received<M>>,
    period_s: f32,
    of: impl Fn(&M) -> f32,
) -> Reading<T> {
    let Some(received) = received else { return Reading::missing() };
    let value = of(&received.value);
    if value.is_nan() {
        return Reading::missing();
    }
    let age_s = received.age as f32 * period_s;
    Reading { value: T::from_setting(value), age_s: T::from_setting(age_s) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f32 = 0.001;

    fn sync(counter: u8) -> SyncFrame {
        SyncFrame { counter }
    }

    fn moving(velocity_rad_s: f32, position_rad: f32) -> Message {
        Message::Motion(NodeId::FIRST, MotionFrame { velocity_rad_s, position_rad })
    }

    #[test]
    fn inputs_without_new_frames_age_by_one_period_per_sample() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        let missing: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert!(missing.velocity_rad_s.age_s < 0.0);
        inbox.take(&moving(1.5, f32::NAN));
        for counter in 1..=3 {
            assert_eq!(inbox.sync(sync(counter)), SyncOutcome::Sample { lost: 0 });
            let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
            assert_eq!(inputs.velocity_rad_s.value, 1.5);
            assert_eq!(inputs.velocity_rad_s.age_s, f32::from(counter - 1) * PERIOD_S);
            // The position is not measured.
            assert!(inputs.position_rad.age_s < 0.0);
            inbox.end_sample();
        }
        inbox.take(&moving(-2.0, 3.0));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert_eq!((inputs.velocity_rad_s.value, inputs.velocity_rad_s.age_s), (-2.0, 0.0));
        assert_eq!(inputs.position_rad.value, 3.0);
    }

    #[test]
    fn sync_counter_identifies_new_duplicate_late_and_lost() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        let mut step = |counter| {
            let outcome = inbox.sync(sync(counter));
            if matches!(outcome, SyncOutcome::Sample { .. }) {
                inbox.end_sample();
            }
            (outcome, inbox.sequence())
        };
        assert_eq!(step(238), (SyncOutcome::Sample { lost: 0 }, 1));
        assert_eq!(step(239), (SyncOutcome::Sample { lost: 0 }, 2));
        assert_eq!(step(239), (SyncOutcome::Duplicate, 2));
        assert_eq!(step(238), (SyncOutcome::Late, 2));
        assert_eq!(step(240), (SyncOutcome::Sample { lost: 0 }, 3));
        assert_eq!(step(4), (SyncOutcome::Sample { lost: 3 }, 7));
        assert_eq!(step(240), (SyncOutcome::Late, 7));
    }

    #[test]
    fn sync_after_announced_number_completes_that_sample() {
        let entry = |number| Message::Entry(NodeId::FIRST, TraceEntry::Sequence(number));
        // SYNCs are lost before the announced one: one, more than half the counter range, all of it, and more.
        for (announced, lost) in [(240, 1), (439, 200), (479, 240), (1239, 1000)] {
            let mut inbox = SampleAssembler::new(NodeId::FIRST);
            inbox.take(&entry(238));
            assert_eq!(inbox.sync(SyncFrame::of(238)), SyncOutcome::Sample { lost: 0 });
            inbox.end_sample();
            inbox.take(&entry(announced));
            assert_eq!(inbox.sequence(), announced);
            assert_eq!(inbox.sync(SyncFrame::of(announced)), SyncOutcome::Sample { lost });
            assert_eq!(inbox.sequence(), announced);
            inbox.end_sample();
            assert_eq!(inbox.sync(SyncFrame::of(announced)), SyncOutcome::Duplicate);
            assert_eq!(inbox.sync(SyncFrame::of(announced + 1)), SyncOutcome::Sample { lost: 0 });
            assert_eq!(inbox.sequence(), announced + 1);
        }
        // The master begins again without a new run.
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        inbox.sync(sync(30));
        inbox.end_sample();
        inbox.take(&entry(0));
        assert_eq!(inbox.sync(sync(1)), SyncOutcome::Sample { lost: 0 });
        assert_eq!(inbox.sequence(), 0);
    }

    #[test]
    fn sync_after_lost_ones_ages_values_received_before_the_last_sync() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        inbox.take(&moving(1.0, 1.0));
        let torque = TorqueFrame { torque_nm: 3.0, load_torque_nm: f32::NAN };
        inbox.take(&Message::Torque(NodeId::FIRST, torque));
        inbox.sync(sync(1));
        inbox.end_sample();
        // Three SYNCs are lost. Only the motion is received again.
        inbox.take(&moving(2.0, 2.0));
        assert_eq!(inbox.sync(sync(5)), SyncOutcome::Sample { lost: 3 });
        assert_eq!(inbox.torque_nm(PERIOD_S).age_s, 4.0 * PERIOD_S);
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert_eq!((inputs.position_rad.value, inputs.position_rad.age_s), (2.0, 0.0));
    }

    #[test]
    fn torque_that_is_not_measured_counts_as_never_received() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        let torque = TorqueFrame { torque_nm: f32::NAN, load_torque_nm: 6.0 };
        inbox.take(&Message::Torque(NodeId::FIRST, torque));
        assert!(inbox.torque_nm(PERIOD_S).age_s < 0.0);
    }

    #[test]
    fn take_with_run_entry_discards_received_values() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        inbox.take(&moving(1.0, 1.0));
        inbox.sync(sync(1));
        inbox.end_sample();
        // Another node's run is its own.
        let other = NodeId::new(2).unwrap();
        assert!(!inbox.take(&Message::Entry(other, TraceEntry::Run(5))));
        assert!(inbox.take(&Message::Entry(NodeId::FIRST, TraceEntry::Run(5))));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert!(inputs.velocity_rad_s.age_s < 0.0);
        assert_eq!(inbox.sequence(), 0);
    }

    #[test]
    fn take_with_repeated_command_keeps_its_age() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        let command =
            |counter| Message::Command(NodeId::FIRST, CommandFrame::new(2.0, 0.5, counter));
        inbox.take(&command(7));
        inbox.end_sample();
        inbox.take(&command(7));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert_eq!(inputs.velocity_reference_rad_s.age_s, PERIOD_S);
        inbox.take(&command(8));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert_eq!(inputs.velocity_reference_rad_s.age_s, 0.0);
        assert_eq!(inputs.velocity_reference_rad_s.value, 0.5);
        assert_eq!(inbox.command_current_a(), 2.0);
    }

    #[test]
    fn inputs_at_later_sample_advance_campaign_time() {
        let mut inbox = SampleAssembler::new(NodeId::FIRST);
        inbox.take(&Message::Entry(NodeId::FIRST, TraceEntry::Sequence(3_600_000)));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 2.0);
        assert!((inputs.campaign_time_h - 3.0).abs() < 1e-6);
    }
}
