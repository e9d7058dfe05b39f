//! Assembly of frames into samples.
//!
//! * A SYNC ends a sample. Its time stamp is the time of the sample.
//! * The fast PDOs (motion, torque) must arrive between two SYNCs. A joint that sends its torque at every n-th SYNC gives a
//!   sample at every n-th one. The slow PDOs (seal, surroundings) keep their last
//!   values, as in the driver.
//! * The driver's answers follow the SYNC, so a sample is complete when the next one begins.
//! * The assembler follows one joint on one interface: the first joint whose inputs it receives. The [`Summary`] lists
//!   the others, because each joint is a data set of its own.
//! * The frame with both sides of the gear (260h + node) gives the position of the joint's side.
//! * A damaged frame of the joint invalidates its own sample only.

mod sample;

pub use sample::TraceSample;

use crate::frame::{CanFrame, Line};
use compensator_core::can::{
    FdTelemetry, Frame, FrameError, JointKind, Message, NodeId, SyncFrame, TraceEntry,
};
use sample::{NO_MOTION, NO_TORQUE};

/// Counts of a log.
#[derive(Clone, Debug, Default)]
pub struct Summary {
    /// Lines with a frame.
    pub frames: u64,
    /// Samples completed by a SYNC.
    pub samples: u64,
    /// Missing samples, from the counter of the SYNCs.
    pub lost: u64,
    /// Samples with an answer from the driver.
    pub answers: u64,
    /// Error frames.
    pub errors: u64,
    /// Frames that are not process data of the joint.
    pub foreign: u64,
    /// Interface and node number of the joint that was followed.
    pub joint: Option<(String, u8)>,
    /// Other joints with inputs in the log; at most 16.
    pub others: Vec<(String, u8)>,
    /// Kind of the joint: revolute or prismatic.
    pub kind: JointKind,
}

/// Maximum number of other joints in [`Summary::others`].
const MAX_OTHER_JOINTS: usize = 16;

/// Assembles frames into samples.
#[derive(Debug, Default)]
pub struct Assembler {
    joint: Option<(Box<[u8]>, NodeId)>,
    /// Values since the last SYNC, and the last values of the slow PDOs.
    open: TraceSample,
    has_motion: bool,
    has_torque: bool,
    /// Sequence number of the last sample with a torque, and the least distance of two of them.
    last_torque: Option<u32>,
    torque_every: Option<u32>,
    /// The completed sample, whose answers may follow.
    closed: Option<TraceSample>,
    /// Sequence number and counter of the last SYNC in this run.
    last: Option<(u32, u8)>,
    /// Sequence number announced for the next sample.
    announced: Option<u32>,
    summary: Summary,
}

impl Assembler {
    /// Processes the next line of a log. Returns the previous sample once it is complete.
    #[inline]
    pub fn push(&mut self, number: u64, line: &Line) -> Option<TraceSample> {
        self.summary.frames += 1;
        let frame = match &line.frame {
            CanFrame::Data { identifier, extended: false, length, bytes } => {
                let data = bytes.get(..usize::from(*length)).unwrap_or_default();
                Frame::new(*identifier as u16, data)
            }
            CanFrame::Error { .. } => {
                self.summary.errors += 1;
                return None;
            }
            frame => match frame.to_telemetry() {
                Some(telemetry) => return self.telemetry(number, line, &telemetry),
                None => None,
            },
        };
        self.frame(number, line, frame)
    }

    /// Processes the frames in a CAN FD frame.
    fn telemetry(
        &mut self,
        number: u64,
        line: &Line,
        telemetry: &FdTelemetry,
    ) -> Option<TraceSample> {
        // The first frame of a sample completes the one before, so at most one is returned.
        telemetry.frames().fold(None, |completed, frame| {
            let sample = self.frame(number, line, Some(frame));
            completed.or(sample)
        })
    }

    #[inline]
    fn frame(&mut self, number: u64, line: &Line, frame: Option<Frame>) -> Option<TraceSample> {
        if let Some((node, position_rad)) = frame.as_ref().and_then(sides) {
            if self.is_followed(line.interface, node) {
                self.open.joint_position_rad = position_rad;
            } else {
                self.summary.foreign += 1;
            }
            return None;
        }
        let message = frame.map(|frame| (Message::parse(&frame), frame));
        match message {
            Some((Ok(message), _)) => self.message(number, line, message),
            Some((Err(FrameError::Foreign(_)), _)) | None => {
                self.summary.foreign += 1;
                None
            }
            Some((Err(fault), frame)) => {
                self.fault(line, &frame, fault);
                None
            }
        }
    }

    /// Returns the last sample and the summary.
    pub fn finish(mut self) -> (Option<TraceSample>, Summary) {
        let last = self.take_completed();
        self.summary.joint = self.joint.as_ref().map(|(interface, node)| named(interface, *node));
        (last, self.summary)
    }

    fn take_completed(&mut self) -> Option<TraceSample> {
        let sample = self.closed.take()?;
        self.summary.samples += 1;
        self.summary.answers += u64::from(sample.answer.is_some());
        Some(sample)
    }

    /// Returns true if the frame belongs to the followed joint. The first input selects that joint.
    #[inline]
    fn select_or_match(&mut self, interface: &[u8], node: NodeId) -> bool {
        match &self.joint {
            Some(_) => {
                let is_followed = self.is_followed(interface, node);
                if !is_followed {
                    self.count_other(interface, node);
                }
                is_followed
            }
            None => {
                self.joint = Some((interface.into(), node));
                true
            }
        }
    }

    fn count_other(&mut self, interface: &[u8], node: NodeId) {
        self.summary.foreign += 1;
        let others = &mut self.summary.others;
        let known =
            |other: &(String, u8)| other.1 == node.number() && other.0.as_bytes() == interface;
        if others.len() < MAX_OTHER_JOINTS && !others.iter().any(known) {
            others.push(named(interface, node));
        }
    }

    #[inline]
    fn is_followed(&self, interface: &[u8], node: NodeId) -> bool {
        let joint = self.joint.as_ref();
        joint.is_some_and(|(followed, number)| *number == node && **followed == *interface)
    }

    #[inline]
    fn message(&mut self, number: u64, line: &Line, message: Message) -> Option<TraceSample> {
        let interface = line.interface;
        match message {
            Message::Motion(node, _)
            | Message::Torque(node, _)
            | Message::Seal(node, _)
            | Message::Surroundings(node, _)
            | Message::Entry(node, _) => {
                if self.select_or_match(interface, node) {
                    let completed = self.take_completed();
                    self.input(message);
                    return completed;
                }
            }
            // Commands and telemetry are not part of a sample.
            Message::Command(..) | Message::Telemetry(..) => {}
            Message::Sync(sync) => {
                let is_same_bus = |(followed, _): &(Box<[u8]>, NodeId)| **followed == *interface;
                if self.joint.as_ref().is_some_and(is_same_bus) {
                    let completed = self.take_completed();
                    self.close(number, line.time_ns, sync);
                    return completed;
                }
                self.summary.foreign += 1;
            }
            Message::Answer(node, _) | Message::Status(node, _) => {
                let is_followed = self.is_followed(interface, node);
                match (&mut self.closed, message) {
                    (Some(closed), Message::Answer(_, answer)) if is_followed => {
                        closed.answer = Some(answer);
                    }
                    (Some(closed), Message::Status(_, status)) if is_followed => {
                        closed.status = Some(status);
                    }
                    _ => self.summary.foreign += 1,
                }
            }
        }
        None
    }

    /// Takes an input of the followed joint over.
    #[inline]
    fn input(&mut self, message: Message) {
        match message {
            Message::Motion(_, motion) => (self.open.motion, self.has_motion) = (motion, true),
            Message::Torque(_, torque) => (self.open.torque, self.has_torque) = (torque, true),
            Message::Seal(_, seal) => self.open.seal = seal,
            Message::Surroundings(_, surroundings) => self.open.surroundings = surroundings,
            Message::Entry(_, entry) => self.entry(entry),
            _ => {}
        }
    }

    fn entry(&mut self, entry: TraceEntry) {
        match entry {
            TraceEntry::Run(run) => {
                // The values of the slow PDOs belong to the previous run.
                self.open = TraceSample { run: Some(run), ..TraceSample::EMPTY };
                (self.has_motion, self.has_torque) = (false, false);
                (self.last, self.announced) = (None, Some(0));
                self.last_torque = None;
            }
            TraceEntry::Sequence(number) => self.announced = Some(number),
            TraceEntry::JointKind(kind) => self.summary.kind = kind,
        }
    }

    #[inline]
    fn close(&mut self, number: u64, time_ns: u64, sync: SyncFrame) {
        let sequence = self.count(sync);
        // A SYNC without values of this joint ends no sample of it.
        let has_values = self.has_motion || self.has_torque || self.open.fault.is_some();
        if has_values && self.is_torque_due(sequence) {
            let mut sample = TraceSample { line: number, time_ns, sequence, ..self.open };
            if sample.fault.is_some() {
                // Invalidates the sample whichever frame is damaged: a slow PDO would otherwise keep its old value.
                sample.motion = NO_MOTION;
            }
            self.closed = Some(sample);
        }
        if has_values {
            self.open.motion = NO_MOTION;
            self.open.torque = NO_TORQUE;
            self.open.joint_position_rad = f64::NAN;
            self.open.fault = None;
            (self.has_motion, self.has_torque) = (false, false);
        }
    }

    /// Returns false for a sample between two with a torque, of a joint that does not send it at every SYNC.
    fn is_torque_due(&mut self, sequence: u32) -> bool {
        let Some(last) = self.last_torque.replace(sequence) else {
            self.last_torque = self.has_torque.then_some(sequence);
            return true;
        };
        let distance = sequence.wrapping_sub(last).max(1);
        if self.has_torque {
            let least = self.torque_every.map_or(distance, |every| every.min(distance));
            self.torque_every = Some(least);
            return true;
        }
        self.last_torque = Some(last);
        self.torque_every.is_none_or(|every| distance.is_multiple_of(every))
    }

    /// Returns the sequence number of the sample that this SYNC ends. Without an announced number, the loss of a
    /// multiple of 240 samples is not detected.
    #[inline]
    fn count(&mut self, sync: SyncFrame) -> u32 {
        let sequence = match (self.announced.take(), self.last) {
            (Some(announced), _) => announced,
            (None, Some((last, counter))) => {
                let round = u32::from(SyncFrame::LAST);
                let passed = (round + u32::from(sync.counter) - u32::from(counter)) % round;
                last.wrapping_add(if passed == 0 { round } else { passed })
            }
            (None, None) => u32::from(sync.counter) - 1,
        };
        if let Some((last, _)) = self.last {
            self.summary.lost += u64::from(sequence.saturating_sub(last.saturating_add(1)));
        }
        self.last = Some((sequence, sync.counter));
        sequence
    }

    fn fault(&mut self, line: &Line, frame: &Frame, fault: FrameError) {
        let node = NodeId::new((frame.identifier() & 0x7F) as u8);
        let is_sync = frame.identifier() == 0x080;
        let is_followed = |(interface, number): &(Box<[u8]>, NodeId)| {
            **interface == *line.interface && (is_sync || node == Some(*number))
        };
        match &self.joint {
            // A damaged SYNC ends no sample. The next sequence number shows the loss.
            Some(joint) if is_followed(joint) && is_sync => {}
            Some(joint) if is_followed(joint) => self.open.fault = Some(fault),
            _ => self.summary.foreign += 1,
        }
    }
}

/// Returns the node and the position of the joint's side, rad, of a frame with both sides of the gear; NaN without a position.
///
/// Identifier 260h + node, for the nodes 1 to 31, with 60E4h:1 and 6064h: those that receive the Drive frame of nodes above 95.
fn sides(frame: &Frame) -> Option<(NodeId, f64)> {
    const SIDES: u16 = 0x260;
    const NODES: u16 = 0x1F;
    let node = NodeId::new((frame.identifier() & NODES) as u8)?;
    let [a, b, c, d, _, _, _, _] = *frame.data() else { return None };
    let position = i32::from_le_bytes([a, b, c, d]);
    let position_rad = if position == i32::MIN { f64::NAN } else { f64::from(position) / 1e6 };
    (frame.identifier() & !NODES == SIDES).then_some((node, position_rad))
}

fn named(interface: &[u8], node: NodeId) -> (String, u8) {
    (String::from_utf8_lossy(interface).into_owned(), node.number())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::candump;

    /// Returns the samples and the summary of a log.
    fn assemble(log: &str) -> (Vec<TraceSample>, Summary) {
        let mut assembler = Assembler::default();
        let mut samples = Vec::new();
        for (at, line) in log.lines().enumerate() {
            let line = candump::parse(line.trim().as_bytes()).unwrap();
            samples.extend(assembler.push(at as u64 + 1, &line));
        }
        let (last, summary) = assembler.finish();
        samples.extend(last);
        (samples, summary)
    }

    /// Data bytes of the pair (1.0, 2.0) in `f32`.
    const ONE_TWO: &str = "0000803F00000040";

    #[test]
    fn assembler_with_sync_completes_sample_and_attaches_answers() {
        let (samples, summary) = assemble(&format!(
            "(1.000000) can0 601#2300200105000000
             (1.001000) can0 481#{ONE_TWO}
             (1.001000) can0 681#{ONE_TWO}
             (1.001000) can0 401#{ONE_TWO}
             (1.002000) can0 080#01
             (1.003000) can0 181#{ONE_TWO}
             (1.003000) can0 281#0000020000000000
             (1.004000) can0 481#{ONE_TWO}
             (1.004000) can0 681#{ONE_TWO}
             (1.005000) can0 080#02"
        ));
        assert_eq!(samples.len(), 2);
        let [first, second] = [samples[0], samples[1]];
        assert_eq!(
            (first.line, first.time_ns, first.run, first.sequence),
            (5, 1_002_000_000, Some(5), 0)
        );
        assert_eq!((first.motion.velocity_rad_s, first.motion.position_rad), (1.0, 2.0));
        assert_eq!(first.answer.unwrap().feed_forward_current_a, 2.0);
        assert_eq!(first.status.unwrap().flags.bits(), 1 << 17);
        assert_eq!((second.sequence, second.answer), (1, None));
        assert_eq!(second.seal.pressure_diff_pa, 2.0, "a slow PDO keeps its value");
        assert!(second.surroundings.temperature_c.is_nan());
        assert_eq!((summary.samples, summary.answers, summary.lost), (2, 1, 0));
        assert_eq!(summary.joint, Some(("can0".to_owned(), 1)));
    }

    #[test]
    fn assembler_of_a_joint_that_sends_torque_at_every_third_sync_completes_these_samples() {
        let cycles: String = (1..=240)
            .map(|counter| {
                // One of its torques is lost.
                let has_torque = counter % 3 == 1 && counter != 151;
                let torque = format!("(1.0) can0 681#{ONE_TWO}\n");
                let torque = if has_torque { &*torque } else { "" };
                format!("(1.0) can0 481#{ONE_TWO}\n{torque}(1.0) can0 080#{counter:02X}\n")
            })
            .collect();
        let (samples, summary) = assemble(&cycles);
        // The distance of the torques is known from the second one on.
        let sequences: Vec<u32> = samples.iter().map(|sample| sample.sequence).collect();
        let expected: Vec<u32> = [0, 1, 2].into_iter().chain((3..240).step_by(3)).collect();
        assert_eq!(sequences, expected);
        let without: Vec<u32> = samples
            .iter()
            .filter(|sample| sample.torque.torque_nm.is_nan())
            .map(|sample| sample.sequence)
            .collect();
        assert_eq!(without, [1, 2, 150]);
        assert_eq!((summary.samples, summary.lost), (82, 0));
    }

    #[test]
    fn assembler_with_lost_and_damaged_frames_counts_losses_and_invalidates_one_sample() {
        let pair = format!("(1.0) can0 481#{ONE_TWO}\n(1.0) can0 681#{ONE_TWO}\n");
        let (samples, summary) = assemble(&format!(
            "{pair}(1.0) can0 080#EF
             {pair}(1.0) can0 080#02
             (1.0) can0 481#00112233
             (1.0) can0 681#{ONE_TWO}
             (1.0) can0 080#03
             (1.0) can0 481#{ONE_TWO}
             (1.0) can0 080#04
             (1.0) can0 080#05
             (1.0) can0 601#23002002F1010000
             {pair}(1.0) can0 080#12"
        ));
        let sequences: Vec<u32> = samples.iter().map(|sample| sample.sequence).collect();
        assert_eq!(sequences, [238, 241, 242, 243, 497]);
        assert_eq!(summary.lost, 2 + 252);
        let length = FrameError::Length { identifier: 0x481, found: 4, expected: 8 };
        assert_eq!(samples[2].fault, Some(length));
        assert!(samples[2].motion.velocity_rad_s.is_nan() && samples[3].fault.is_none());
        assert!(samples[3].torque.torque_nm.is_nan(), "a missing fast PDO is NaN");
        assert!(samples[4].torque.torque_nm == 1.0);
    }

    /// Returns a log of a joint on its sensors, with its answers in classic frames or in one of CAN FD.
    fn log_of_sensors(is_fd: bool) -> String {
        let mut out = Vec::new();
        let mut emit = |time_ns, frame| {
            let line = Line { time_ns, interface: b"can0", frame, direction: None };
            candump::emit(&line, crate::Fraction::Microseconds, &mut out);
        };
        for sequence in 0..5u32 {
            let time_ns = 1_000_000 * u64::from(sequence);
            let sync = SyncFrame::of(sequence);
            emit(time_ns, CanFrame::from(Message::Sync(sync).emit()));
            let mut telemetry = FdTelemetry::new(NodeId::FIRST, sync.counter, 0);
            for pdo in 0..6 {
                telemetry.put(
                    pdo,
                    [f32::to_le_bytes(sequence as f32 + 0.5); 2].concat().try_into().unwrap(),
                );
            }
            if is_fd {
                emit(time_ns + 300_000, CanFrame::from(telemetry));
            } else {
                telemetry.frames().for_each(|frame| emit(time_ns + 300_000, frame.into()));
            }
        }
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn assembler_with_fd_telemetry_returns_the_samples_of_the_classic_frames() {
        let of = |is_fd| {
            let (mut samples, summary) = assemble(&log_of_sensors(is_fd));
            samples.iter_mut().for_each(|sample| sample.line = 0);
            let summary = Summary { frames: 0, ..summary };
            (samples.len(), format!("{samples:?} {summary:?}"))
        };
        let classic = of(false);
        assert_eq!(of(true), classic);
        assert_eq!(classic.0, 4);
        assert!(log_of_sensors(true).contains("381##1"));
    }

    #[test]
    fn assembler_with_both_sides_of_the_gear_returns_the_position_of_the_joints_side() {
        let pair = format!("(1.0) can0 481#{ONE_TWO}\n(1.0) can0 681#{ONE_TWO}\n");
        // 1.5 rad and -2 rad, then no valid frame of the encoder, another joint, and none.
        let (samples, summary) = assemble(&format!(
            "{pair}(1.0) can0 261#60E3160080841E00
             (1.0) can0 080#01
             {pair}(1.0) can0 261#807BE1FF80841E00
             (1.0) can0 080#02
             {pair}(1.0) can0 261#0000008080841E00
             (1.0) can0 080#03
             {pair}(1.0) can0 262#60E3160080841E00
             (1.0) can0 080#04"
        ));
        let positions: Vec<f64> = samples.iter().map(|sample| sample.joint_position_rad).collect();
        assert_eq!(positions[..2], [1.5, -2.0]);
        assert!(positions[2].is_nan() && positions[3].is_nan() && positions.len() == 4);
        assert_eq!((samples[2].torque.torque_nm, summary.foreign), (1.0, 1));
    }

    #[test]
    fn assembler_with_several_joints_follows_the_first() {
        let (samples, summary) = assemble(&format!(
            "(1.0) can0 080#01
             (1.0) can0 000#0102
             (1.0) can0 20000004#000C000000000000
             (1.0) can0 00000481#{ONE_TWO}
             (1.0) can0 481##0{ONE_TWO}
             (1.0) can0 482#{ONE_TWO}
             (1.0) can0 483#{ONE_TWO}
             (1.0) can1 482#{ONE_TWO}
             (1.0) can1 080#01
             (1.0) can0 181#{ONE_TWO}
             (1.0) can0 302#{ONE_TWO}
             (1.0) can0 182#{ONE_TWO}
             (1.0) can0 080#07"
        ));
        assert_eq!(samples.len(), 1);
        assert_eq!((samples[0].sequence, samples[0].run), (6, None));
        assert_eq!(summary.joint, Some(("can0".to_owned(), 2)));
        assert_eq!(summary.others, [("can0".to_owned(), 3), ("can1".to_owned(), 2)]);
        assert_eq!((summary.frames, summary.errors, summary.answers), (13, 1, 0));
    }
}
