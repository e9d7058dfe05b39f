//! Every answer of a driver, held against the core.
//!
//! A joint of its own, fed with the frames as they were sent, says what must come back. Answers carry the
//! number of their sample, so one that is lost, comes twice, late or in another order is told from one
//! that is wrong; a wrong one differs in at least one bit, and is shown with both values.

use compensator_core::can::{Answer, Frame, Message, Node, Status, Sync, Telemetry};
use firmware::hil::{HilJoint, Reply, Step};
use serde::Serialize;
use std::collections::VecDeque;

/// Samples that may wait for their answers, at most; older ones are lost.
const WAITING: usize = 4096;
/// Answered samples kept, to tell a repeated answer from a wrong one.
const ANSWERED: usize = 256;
/// Mismatches shown.
const SHOWN: usize = 10;

/// What came of the answers.
#[derive(Clone, Debug, Default, Serialize, PartialEq)]
pub struct Tally {
    /// SYNCs sent.
    pub samples: u64,
    /// Samples whose answer and status came and agree with the core in every bit.
    pub equal: u64,
    /// Telemetry frames that came and agree in every bit.
    pub telemetry_equal: u64,
    /// Samples, or telemetry frames, that differ.
    pub mismatches: u64,
    /// Samples nobody answered.
    pub lost: u64,
    /// Answers that came twice.
    pub duplicated: u64,
    /// Answers that came after a later one's.
    pub reordered: u64,
    /// Answers to no sample that was sent.
    pub unexpected: u64,
    /// Answers equal to those in the log, where it has some.
    pub recorded_equal: u64,
    /// Answers in the log.
    pub recorded: u64,
    /// The first mismatches.
    pub shown: Vec<Mismatch>,
}

/// An answer that differs.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub struct Mismatch {
    /// Which sample, from 0.
    pub sample: u64,
    /// Which number of it.
    pub what: &'static str,
    /// What the driver said.
    pub found: String,
    /// What the core says.
    pub expected: String,
}

/// A sample on its way.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    sample: u64,
    sent_ns: u64,
    reply: Reply,
}

/// The core beside a driver.
#[derive(Debug)]
pub struct Check {
    node: Node,
    core: HilJoint,
    waiting: VecDeque<Waiting>,
    answered: VecDeque<Waiting>,
    /// So many of those that wait, the oldest, are not counted on any more.
    given_up: usize,
    /// The answer whose status has not come yet.
    answer: Option<Answer>,
    tally: Tally,
    round_trips_ns: Vec<u64>,
}

impl Check {
    /// A check with a joint as the driver is set up; it is on.
    pub fn new(node: Node, mut core: HilJoint) -> Self {
        core.set_enabled(true);
        Self {
            node,
            core,
            waiting: VecDeque::new(),
            answered: VecDeque::new(),
            given_up: 0,
            answer: None,
            tally: Tally::default(),
            round_trips_ns: Vec::new(),
        }
    }

    /// A message is being sent at this time of the bus.
    pub fn sent(&mut self, message: &Message, now_ns: u64) {
        let Message::Sync(sync) = message else {
            self.core.take(message);
            return;
        };
        self.sync(*sync, now_ns);
    }

    fn sync(&mut self, sync: Sync, now_ns: u64) {
        let sample = self.tally.samples;
        self.tally.samples += 1;
        // A log may hold a SYNC twice; a driver passes over what the core passes over.
        let Step::Reply(reply, _) = self.core.sync(sync) else { return };
        if self.waiting.len() == WAITING {
            self.waiting.pop_front();
            self.given_up = self.given_up.saturating_sub(1);
            self.tally.lost += 1;
        }
        self.waiting.push_back(Waiting { sample, sent_ns: now_ns, reply });
    }

    /// Samples that wait for their answers.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Of them, those whose answers are still counted on.
    pub fn outstanding(&self) -> usize {
        self.waiting.len() - self.given_up
    }

    /// Counts on no answer to what was sent so far; one that comes all the same is as good as any.
    pub fn give_up(&mut self) {
        self.given_up = self.waiting.len();
    }

    /// A frame came. Gives the number of a sample that is answered with it, and what was answered.
    pub fn received(&mut self, frame: &Frame, time_ns: u64) -> Option<(u64, Answer, Status)> {
        match Message::parse(frame).ok()? {
            Message::Answer(node, answer) if node == self.node => {
                self.answer = Some(answer);
                None
            }
            Message::Status(node, status) if node == self.node => self.status(status, time_ns),
            Message::Telemetry(node, telemetry) if node == self.node => {
                self.telemetry(telemetry);
                None
            }
            _ => None,
        }
    }

    fn status(&mut self, status: Status, time_ns: u64) -> Option<(u64, Answer, Status)> {
        let answer = self.answer.take();
        let number = |waiting: &Waiting| waiting.reply.status.sequence == status.sequence;
        let Some(place) = self.waiting.iter().position(number) else {
            match self.answered.iter().rposition(number) {
                Some(last) if last + 1 == self.answered.len() => self.tally.duplicated += 1,
                Some(_) => self.tally.reordered += 1,
                None => self.tally.unexpected += 1,
            }
            return None;
        };
        self.tally.lost += place as u64;
        self.waiting.drain(..place);
        self.given_up = self.given_up.saturating_sub(place + 1);
        let sample = self.waiting.pop_front()?;
        if self.answered.len() == ANSWERED {
            self.answered.pop_front();
        }
        self.answered.push_back(sample);
        self.round_trips_ns.push(time_ns.saturating_sub(sample.sent_ns));
        let Some(answer) = answer else {
            // Its status came, its answer did not.
            self.tally.lost += 1;
            return None;
        };
        let expected = sample.reply;
        let pairs = [
            ("friction torque, Nm", answer.friction_torque_nm, expected.answer.friction_torque_nm),
            (
                "feed-forward current, A",
                answer.feed_forward_current_a,
                expected.answer.feed_forward_current_a,
            ),
        ];
        let mut same = true;
        for (what, found, expected) in pairs {
            same &= self.same_float(sample.sample, what, found, expected);
        }
        if status.flags != expected.status.flags {
            same = false;
            let words = (format!("{:?}", status.flags), format!("{:?}", expected.status.flags));
            self.show(sample.sample, "flags", words.0, words.1);
        }
        if same {
            self.tally.equal += 1;
        } else {
            self.tally.mismatches += 1;
        }
        Some((sample.sample, answer, status))
    }

    fn telemetry(&mut self, telemetry: Telemetry) {
        // It follows the status of its sample.
        let Some(sample) = self.answered.back().copied() else {
            self.tally.unexpected += 1;
            return;
        };
        let expected = sample.reply.telemetry;
        let same =
            self.same_float(sample.sample, "current, A", telemetry.current_a, expected.current_a)
                & self.same_float(
                    sample.sample,
                    "residual torque, Nm",
                    telemetry.residual_torque_nm,
                    expected.residual_torque_nm,
                );
        if same {
            self.tally.telemetry_equal += 1;
        } else {
            self.tally.mismatches += 1;
        }
    }

    fn same_float(&mut self, sample: u64, what: &'static str, found: f32, expected: f32) -> bool {
        let same = found.to_bits() == expected.to_bits();
        if !same {
            let words = |value: f32| format!("{value} ({:08x})", value.to_bits());
            self.show(sample, what, words(found), words(expected));
        }
        same
    }

    fn show(&mut self, sample: u64, what: &'static str, found: String, expected: String) {
        if self.tally.shown.len() < SHOWN {
            self.tally.shown.push(Mismatch { sample, what, found, expected });
        }
    }

    /// Ends the check: what still waits is lost. Gives what came of it, and the time from each SYNC to
    /// the status that answered it, ns.
    pub fn finish(mut self) -> (Tally, Vec<u64>) {
        self.tally.lost += self.waiting.len() as u64;
        (self.tally, self.round_trips_ns)
    }
}

impl Tally {
    /// Whether every sample was answered, and every answer is the core's.
    pub fn holds(&self) -> bool {
        self.equal > 0 && self.mismatches == 0 && self.lost == 0 && self.unexpected == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::Motion;
    use firmware::node_settings::NodeSettings;
    use firmware::parameter_set::ParameterSet;

    fn joint() -> HilJoint {
        let set = ParameterSet::default();
        HilJoint::build(Node::FIRST, &set.friction, None, NodeSettings::default().hil_setup())
            .unwrap()
    }

    /// Sends so many samples, and gives the frames a driver answers with, by sample.
    fn answers(check: &mut Check, count: u32) -> Vec<[Frame; 3]> {
        let mut driver = joint();
        driver.set_enabled(true);
        let mut all = Vec::new();
        for sequence in 0..count {
            let velocity_rad_s = 0.5 * (sequence as f32 * 0.1).sin();
            let motion =
                Message::Motion(Node::FIRST, Motion { velocity_rad_s, position_rad: f32::NAN });
            let sync = Message::Sync(Sync::of(sequence));
            driver.take(&motion);
            check.sent(&motion, 0);
            check.sent(&sync, 1000);
            let Step::Reply(reply, 0) = driver.sync(Sync::of(sequence)) else { panic!() };
            all.push([
                Message::Answer(Node::FIRST, reply.answer).emit(),
                Message::Status(Node::FIRST, reply.status).emit(),
                Message::Telemetry(Node::FIRST, reply.telemetry).emit(),
            ]);
        }
        all
    }

    fn check() -> Check {
        Check::new(Node::FIRST, joint())
    }

    fn give(check: &mut Check, frames: &[Frame]) {
        for frame in frames {
            check.received(frame, 0);
        }
    }

    #[test]
    fn right_answers_hold() {
        let mut check = check();
        for frame in answers(&mut check, 500).iter().flatten() {
            check.received(frame, 3000);
        }
        let (tally, times) = check.finish();
        assert!(tally.holds(), "{tally:?}");
        assert_eq!((tally.equal, tally.telemetry_equal), (500, 500));
        assert_eq!(times, [2000; 500]);
    }

    #[test]
    fn one_wrong_bit_anywhere_is_found() {
        for (frame, bit) in (0..2).flat_map(|frame| (0..64).map(move |bit| (frame, bit))) {
            // The number of the sample is not an answer but its address.
            if frame == 1 && bit >= 32 {
                continue;
            }
            let mut check = check();
            let mut frames = answers(&mut check, 20);
            let right = frames[7][frame];
            let mut data: [u8; 8] = right.data().try_into().unwrap();
            data[bit / 8] ^= 1 << (bit % 8);
            frames[7][frame] = Frame::new(right.identifier(), &data).unwrap();
            give(&mut check, frames.as_flattened());
            let (tally, _) = check.finish();
            assert!(!tally.holds());
            assert_eq!((tally.mismatches, tally.equal), (1, 19), "frame {frame}, bit {bit}");
            assert_eq!(tally.shown[0].sample, 7);
        }
    }

    #[test]
    fn lost_repeated_and_reordered_answers_are_no_mismatches() {
        let mut check = check();
        let frames = answers(&mut check, 10);
        let order = [0, 1, 1, 3, 4, 3, 5, 6, 7, 9];
        for sample in order {
            give(&mut check, &frames[sample][..2]);
        }
        let (tally, _) = check.finish();
        assert_eq!((tally.equal, tally.mismatches), (8, 0));
        assert_eq!((tally.lost, tally.duplicated, tally.reordered), (2, 1, 1));
        assert!(!tally.holds());
    }

    #[test]
    fn an_answer_that_was_given_up_still_counts() {
        let mut check = check();
        let frames = answers(&mut check, 10);
        check.give_up();
        assert_eq!((check.waiting(), check.outstanding()), (10, 0));
        give(&mut check, frames[..4].as_flattened());
        assert_eq!((check.waiting(), check.outstanding()), (6, 0));
        give(&mut check, &frames[9]);
        assert_eq!((check.waiting(), check.outstanding()), (0, 0));
        let (tally, _) = check.finish();
        assert_eq!((tally.equal, tally.lost, tally.unexpected), (5, 5, 0));
    }

    #[test]
    fn silence_does_not_hold() {
        let mut check = check();
        answers(&mut check, 10);
        let (tally, _) = check.finish();
        assert_eq!(tally.lost, 10);
        assert!(!tally.holds());
    }
}
