//! Comparison of every answer of a driver with the core.
//!
//! A HIL joint in this process receives the same frames and computes the expected answers. Answers carry the number of
//! their sample, so a lost, duplicated, late or reordered answer is distinguished from a wrong one. A wrong answer differs
//! in at least one bit, and is listed with both values.

use super::CoreJoint;
use super::plan::RecordedAnswer;
use compensator_core::can::{
    AnswerFrame, Frame, Message, NodeId, StatusFrame, SyncFrame, TelemetryFrame,
};
use firmware::hil::{HilReply, HilStep};
use serde::Serialize;
use std::collections::VecDeque;

/// Maximum number of samples that wait for answers. Older ones count as lost.
const MAX_WAITING_SAMPLES: usize = 4096;
/// Number of answered samples kept, to recognise duplicated answers.
const KEPT_ANSWERED_SAMPLES: usize = 256;
/// Maximum number of listed mismatches.
const MAX_LISTED_MISMATCHES: usize = 10;

/// Counts of the answers.
#[derive(Clone, Debug, Default, Serialize, PartialEq)]
pub struct Tally {
    /// Sent SYNCs.
    pub samples: u64,
    /// Samples whose answer and status agree with the core in every bit.
    pub equal: u64,
    /// Telemetry frames that agree in every bit.
    pub telemetry_equal: u64,
    /// Samples or telemetry frames that differ.
    pub mismatches: u64,
    /// Samples without an answer.
    pub lost: u64,
    /// Duplicated answers.
    pub duplicated: u64,
    /// Answers that arrived after a later sample's answer.
    pub reordered: u64,
    /// Answers that belong to no sent sample.
    pub unexpected: u64,
    /// Answers equal to the recorded ones.
    pub recorded_equal: u64,
    /// Recorded answers in the log.
    pub recorded: u64,
    /// The first mismatches.
    pub shown: Vec<Mismatch>,
}

/// An answer that differs.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub struct Mismatch {
    /// Number of the sample, from 0.
    pub sample: u64,
    /// Name of the value.
    pub what: &'static str,
    /// Value of the driver.
    pub found: String,
    /// Value of the core.
    pub expected: String,
}

/// A sample without an answer.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    sample: u64,
    sent_ns: u64,
    reply: HilReply,
}

/// Compares a driver with the core.
#[derive(Debug)]
pub struct Check {
    node: NodeId,
    core: CoreJoint,
    waiting: VecDeque<Waiting>,
    answered: VecDeque<Waiting>,
    /// Number of the oldest waiting samples whose answers are not expected.
    given_up: usize,
    /// The answer whose status has not arrived yet.
    answer: Option<AnswerFrame>,
    tally: Tally,
    round_trips_ns: Vec<u64>,
}

impl Check {
    /// Creates a check with a joint that is set up like the driver. The joint is enabled.
    pub fn new(node: NodeId, core: impl Into<CoreJoint>) -> Self {
        let mut core = core.into();
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

    /// Records a message that is sent at the bus time `now_ns`.
    pub fn sent(&mut self, message: &Message, now_ns: u64) {
        let Message::Sync(sync) = message else {
            self.core.take(message);
            return;
        };
        self.sync(*sync, now_ns);
    }

    fn sync(&mut self, sync: SyncFrame, now_ns: u64) {
        let sample = self.tally.samples;
        self.tally.samples += 1;
        // A log may contain a SYNC twice. The driver ignores it as the core does.
        let HilStep::Reply(reply, _) = self.core.sync(sync) else { return };
        if self.waiting.len() == MAX_WAITING_SAMPLES {
            self.waiting.pop_front();
            self.given_up = self.given_up.saturating_sub(1);
            self.tally.lost += 1;
        }
        self.waiting.push_back(Waiting { sample, sent_ns: now_ns, reply });
    }

    /// Returns the number of samples that wait for answers.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Returns the number of waiting samples whose answers are expected.
    pub fn outstanding(&self) -> usize {
        self.waiting.len() - self.given_up
    }

    /// Stops expecting answers to the samples sent so far. An answer that still arrives counts.
    pub fn give_up(&mut self) {
        self.given_up = self.waiting.len();
    }

    /// Processes a received frame. Returns the number of the sample that it completes, and what the driver answered.
    pub fn received(&mut self, frame: &Frame, time_ns: u64) -> Option<(u64, RecordedAnswer)> {
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

    fn status(&mut self, status: StatusFrame, time_ns: u64) -> Option<(u64, RecordedAnswer)> {
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
        if self.answered.len() == KEPT_ANSWERED_SAMPLES {
            self.answered.pop_front();
        }
        self.answered.push_back(sample);
        self.round_trips_ns.push(time_ns.saturating_sub(sample.sent_ns));
        let Some(answer) = answer else {
            // The status arrived without its answer.
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
            let [found, expected] =
                [status.flags, expected.status.flags].map(|flags| format!("{flags:?}"));
            self.show(sample.sample, "flags", found, expected);
        }
        if same {
            self.tally.equal += 1;
        } else {
            self.tally.mismatches += 1;
        }
        Some((sample.sample, RecordedAnswer { answer, status }))
    }

    fn telemetry(&mut self, telemetry: TelemetryFrame) {
        // Telemetry follows the status of its sample.
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
        if self.tally.shown.len() < MAX_LISTED_MISMATCHES {
            self.tally.shown.push(Mismatch { sample, what, found, expected });
        }
    }

    /// Ends the check. Waiting samples count as lost. Returns the counts and the round-trip times from SYNC to status, ns.
    pub fn finish(mut self) -> (Tally, Vec<u64>) {
        self.tally.lost += self.waiting.len() as u64;
        (self.tally, self.round_trips_ns)
    }
}

impl Tally {
    /// Returns true if every sample was answered and every answer equals the core's.
    pub fn holds(&self) -> bool {
        self.equal > 0 && self.mismatches == 0 && self.lost == 0 && self.unexpected == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::MotionFrame;
    use firmware::hil::HilJoint;
    use firmware::node_settings::NodeSettings;
    use firmware::parameter_set::ParameterSet;

    fn joint() -> HilJoint {
        let set = ParameterSet::default();
        HilJoint::build(NodeId::FIRST, &set.friction, None, NodeSettings::default().hil_setup())
            .unwrap()
    }

    /// Sends `count` samples. Returns the frames of a driver's answers by sample.
    fn answers(check: &mut Check, count: u32) -> Vec<[Frame; 3]> {
        let mut driver = joint();
        driver.set_enabled(true);
        let mut all = Vec::new();
        for sequence in 0..count {
            let velocity_rad_s = 0.5 * (sequence as f32 * 0.1).sin();
            let motion = Message::Motion(
                NodeId::FIRST,
                MotionFrame { velocity_rad_s, position_rad: f32::NAN },
            );
            let sync = Message::Sync(SyncFrame::of(sequence));
            driver.take(&motion);
            check.sent(&motion, 0);
            check.sent(&sync, 1000);
            let HilStep::Reply(reply, 0) = driver.sync(SyncFrame::of(sequence)) else { panic!() };
            all.push([
                Message::Answer(NodeId::FIRST, reply.answer).emit(),
                Message::Status(NodeId::FIRST, reply.status).emit(),
                Message::Telemetry(NodeId::FIRST, reply.telemetry).emit(),
            ]);
        }
        all
    }

    fn check() -> Check {
        Check::new(NodeId::FIRST, joint())
    }

    fn give(check: &mut Check, frames: &[Frame]) {
        for frame in frames {
            check.received(frame, 0);
        }
    }

    #[test]
    fn check_with_equal_answers_holds() {
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
    fn check_with_one_wrong_bit_reports_one_mismatch() {
        for (frame, bit) in (0..2).flat_map(|frame| (0..64).map(move |bit| (frame, bit))) {
            // The sample number is the address of the answer, not part of it.
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
    fn check_with_lost_duplicated_and_reordered_answers_reports_no_mismatch() {
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
    fn check_with_answer_after_give_up_counts_it() {
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
    fn check_without_answers_does_not_hold() {
        let mut check = check();
        answers(&mut check, 10);
        let (tally, _) = check.finish();
        assert_eq!(tally.lost, 10);
        assert!(!tally.holds());
    }
}
