//! Frames put together to the inputs of one sample.
//!
//! What comes before a SYNC belongs to its sample. A quantity keeps its last value and grows older by
//! a sample period with every SYNC it is not heard of again, so a thermometer may speak once a second.
//! NaN says that nobody measures a quantity: it counts as never heard, not as wrong. The SYNC's counter
//! tells a SYNC that comes twice, too late, or after others were lost; only a new one makes a sample.
//! A driver that is fed from the bus and the PC that checks it run this same code, each on its own
//! frames.

use super::{Command, Entry, Message, Motion, Node, Seal, Surroundings, Sync, Torque};
use crate::number::Real;
use crate::quantity::{Inputs, Reading};

/// What a SYNC was.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SyncOutcome {
    /// It ends a sample. So many SYNCs before it were lost.
    Sample {
        /// Number of SYNCs that never came.
        lost: u8,
    },
    /// The same SYNC again.
    Duplicate,
    /// One from before the last.
    Late,
}

/// A value and its age in samples; `None` until something is heard.
#[derive(Clone, Copy, Debug)]
struct Heard<M> {
    value: M,
    age: u32,
}

/// The inputs of a joint that is fed from the bus.
#[derive(Clone, Debug)]
pub struct Inbox {
    node: Node,
    motion: Option<Heard<Motion>>,
    torque: Option<Heard<Torque>>,
    seal: Option<Heard<Seal>>,
    surroundings: Option<Heard<Surroundings>>,
    command: Option<Heard<Command>>,
    /// Number of the next sample in its run.
    next: u32,
    /// The counter of the last SYNC; `None` before the first.
    last_counter: Option<u8>,
}

impl Inbox {
    /// Nothing heard yet.
    pub const fn new(node: Node) -> Self {
        Self {
            node,
            motion: None,
            torque: None,
            seal: None,
            surroundings: None,
            command: None,
            next: 0,
            last_counter: None,
        }
    }

    /// Takes in a message; one for another node is passed over. `true` where a new run begins:
    /// what was heard is forgotten then, and the state of the model is to be cleared.
    pub fn take(&mut self, message: &Message) -> bool {
        let fresh = |node: Node| node == self.node;
        match *message {
            Message::Motion(node, value) if fresh(node) => self.motion = Some(heard(value)),
            Message::Torque(node, value) if fresh(node) => self.torque = Some(heard(value)),
            Message::Seal(node, value) if fresh(node) => self.seal = Some(heard(value)),
            Message::Surroundings(node, value) if fresh(node) => {
                self.surroundings = Some(heard(value));
            }
            Message::Command(node, value) if fresh(node) => {
                // A repeated command is no new one: its age goes on.
                let repeated = self.command.is_some_and(|had| had.value.counter == value.counter);
                if !repeated {
                    self.command = Some(heard(value));
                }
            }
            Message::Entry(node, Entry::Run(_)) if fresh(node) => {
                *self = Self::new(self.node);
                return true;
            }
            Message::Entry(node, Entry::Sequence(number)) if fresh(node) => self.next = number,
            _ => {}
        }
        false
    }

    /// Takes in a SYNC and says whether it ends a sample.
    pub fn sync(&mut self, sync: Sync) -> SyncOutcome {
        let ring = u16::from(Sync::LAST);
        let lost = match self.last_counter {
            None => 0,
            Some(last) => {
                let ahead = (ring + u16::from(sync.counter) - u16::from(last)) % ring;
                if ahead == 0 {
                    return SyncOutcome::Duplicate;
                }
                // Half the ring ahead, or half behind.
                if ahead > ring / 2 {
                    return SyncOutcome::Late;
                }
                (ahead - 1) as u8
            }
        };
        self.last_counter = Some(sync.counter);
        self.next = self.next.wrapping_add(u32::from(lost));
        SyncOutcome::Sample { lost }
    }

    /// Number in its run of the sample that the last SYNC ended, or that the next one will end.
    pub const fn sequence(&self) -> u32 {
        self.next
    }

    /// The measured torque of the sample, Nm; NaN where none is measured, or none came with it.
    pub fn measured_torque_nm(&self) -> f32 {
        self.torque.filter(|had| had.age == 0).map_or(f32::NAN, |had| had.value.torque_nm)
    }

    /// The commanded current, A, and its age in s; `None` before the first command.
    pub fn command_current_a(&self, period_s: f32) -> Option<Reading<f32>> {
        self.command
            .map(|had| Reading { value: had.value.current_a, age_s: had.age as f32 * period_s })
    }

    /// The inputs of the sample, for a sample period in s and a campaign that was `campaign_h` old when
    /// the run began. The acceleration is not on the bus.
    pub fn inputs<T: Real<Setting = f32>>(&self, period_s: f32, campaign_h: f32) -> Inputs<T> {
        let motion = |of: fn(&Motion) -> f32| reading(self.motion, period_s, of);
        let seal = |of: fn(&Seal) -> f32| reading(self.seal, period_s, of);
        let surroundings = |of: fn(&Surroundings) -> f32| reading(self.surroundings, period_s, of);
        let campaign = campaign_h + self.next as f32 * (period_s / 3600.0);
        Inputs {
            velocity_rad_s: motion(|of| of.velocity_rad_s),
            velocity_reference_rad_s: reading(self.command, period_s, |of| {
                of.velocity_reference_rad_s()
            }),
            position_rad: motion(|of| of.position_rad),
            radial_force_n: seal(|of| of.radial_force_n),
            pressure_diff_mpa: seal(Seal::pressure_diff_mpa),
            temperature_c: surroundings(|of| of.temperature_c),
            load_torque_nm: reading(self.torque, period_s, |of| of.load_torque_nm),
            auxiliary: surroundings(|of| of.auxiliary),
            campaign_time_h: T::from_setting(campaign),
            ..Inputs::missing()
        }
    }

    /// Ends the sample: all that was heard is a sample older.
    pub fn end_sample(&mut self) {
        self.next = self.next.wrapping_add(1);
        age(&mut self.motion);
        age(&mut self.torque);
        age(&mut self.seal);
        age(&mut self.surroundings);
        age(&mut self.command);
    }
}

fn heard<M>(value: M) -> Heard<M> {
    Heard { value, age: 0 }
}

fn age<M>(heard: &mut Option<Heard<M>>) {
    if let Some(heard) = heard {
        heard.age = heard.age.saturating_add(1);
    }
}

fn reading<M: Copy, T: Real<Setting = f32>>(
    heard: Option<Heard<M>>,
    period_s: f32,
    of: impl Fn(&M) -> f32,
) -> Reading<T> {
    let Some(had) = heard else { return Reading::missing() };
    let value = of(&had.value);
    if value.is_nan() {
        return Reading::missing();
    }
    let age_s = had.age as f32 * period_s;
    Reading { value: T::from_setting(value), age_s: T::from_setting(age_s) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f32 = 0.001;

    fn sync(counter: u8) -> Sync {
        Sync { counter }
    }

    fn moving(velocity_rad_s: f32, position_rad: f32) -> Message {
        Message::Motion(Node::FIRST, Motion { velocity_rad_s, position_rad })
    }

    #[test]
    fn what_is_not_heard_again_ages() {
        let mut inbox = Inbox::new(Node::FIRST);
        let missing: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert!(missing.velocity_rad_s.age_s < 0.0);
        inbox.take(&moving(1.5, f32::NAN));
        for counter in 1..=3 {
            assert_eq!(inbox.sync(sync(counter)), SyncOutcome::Sample { lost: 0 });
            let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
            assert_eq!(inputs.velocity_rad_s.value, 1.5);
            assert_eq!(inputs.velocity_rad_s.age_s, f32::from(counter - 1) * PERIOD_S);
            // Nobody measures the position.
            assert!(inputs.position_rad.age_s < 0.0);
            inbox.end_sample();
        }
        inbox.take(&moving(-2.0, 3.0));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert_eq!((inputs.velocity_rad_s.value, inputs.velocity_rad_s.age_s), (-2.0, 0.0));
        assert_eq!(inputs.position_rad.value, 3.0);
    }

    #[test]
    fn a_sync_is_new_again_late_or_after_lost_ones() {
        let mut inbox = Inbox::new(Node::FIRST);
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
    fn a_run_begins_with_nothing_heard() {
        let mut inbox = Inbox::new(Node::FIRST);
        inbox.take(&moving(1.0, 1.0));
        inbox.sync(sync(1));
        inbox.end_sample();
        // Another node's run is its own.
        let other = Node::new(2).unwrap();
        assert!(!inbox.take(&Message::Entry(other, Entry::Run(5))));
        assert!(inbox.take(&Message::Entry(Node::FIRST, Entry::Run(5))));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert!(inputs.velocity_rad_s.age_s < 0.0);
        assert_eq!(inbox.sequence(), 0);
    }

    #[test]
    fn a_repeated_command_goes_on_ageing() {
        let mut inbox = Inbox::new(Node::FIRST);
        let command = |counter| Message::Command(Node::FIRST, Command::new(2.0, 0.5, counter));
        inbox.take(&command(7));
        inbox.end_sample();
        inbox.take(&command(7));
        assert_eq!(inbox.command_current_a(PERIOD_S).unwrap().age_s, PERIOD_S);
        inbox.take(&command(8));
        assert_eq!(inbox.command_current_a(PERIOD_S).unwrap().age_s, 0.0);
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 0.0);
        assert_eq!(inputs.velocity_reference_rad_s.value, 0.5);
    }

    #[test]
    fn the_campaign_goes_on_with_the_samples() {
        let mut inbox = Inbox::new(Node::FIRST);
        inbox.take(&Message::Entry(Node::FIRST, Entry::Sequence(3_600_000)));
        let inputs: Inputs<f32> = inbox.inputs(PERIOD_S, 2.0);
        assert!((inputs.campaign_time_h - 3.0).abs() < 1e-6);
    }
}
