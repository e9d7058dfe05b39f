//! The replay plan: which frames of a log are sent, and at what time.
//!
//! A plan contains the inputs of one joint and the SYNCs, in the order and with the times of the log. The frames get the
//! node number of the tested joint. Recorded answers of the joint are kept for comparison. All other content (other nodes,
//! CAN FD, remote requests, error frames) is counted and skipped. More than one malformed line in twenty is an error.

use compensator_core::can::{
    AnswerFrame, Frame, FrameError, Message, NodeId, SampleAssembler, StatusFrame, SyncOutcome,
    TraceEntry,
};
use joint_trace::{CanFrame, Census, Frames, JointOnBus, Line, LineError, TextFormat, TextReader};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

/// Maximum latency of an answer, in samples.
const MAX_LATENCY_SAMPLES: usize = 4096;

/// Maximum share of malformed lines before the log is rejected.
const MAX_BAD_LINE_SHARE: f64 = 0.05;

/// A frame to send, and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlannedFrame {
    /// Time from the first frame, ns.
    pub due_ns: u64,
    /// The message.
    pub message: Message,
}

/// Counts of the skipped content of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SkippedFrames {
    /// Frames of other nodes.
    pub foreign: u64,
    /// Frames of the joint with a wrong length or content.
    pub damaged: u64,
    /// CAN FD frames.
    pub flexible: u64,
    /// Remote requests.
    pub remote: u64,
    /// Error frames.
    pub error: u64,
    /// Frames with a time stamp before that of the previous frame; sent together with it.
    pub backwards: u64,
    /// Lines without a valid frame.
    pub bad_lines: u64,
}

/// The frames to send, and the recorded answers.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Frames, ordered by time.
    pub frames: Vec<PlannedFrame>,
    /// Number of SYNCs.
    pub samples: u64,
    /// Median time between SYNCs, s.
    pub period_s: f64,
    /// Recorded answers by sample; empty if the log has none.
    pub recorded: Vec<Option<RecordedAnswer>>,
    /// Skipped content.
    pub skipped: SkippedFrames,
    /// SHA-256 of the log, hexadecimal.
    pub sha256: String,
    /// Number of lines of the log.
    pub lines: u64,
    /// Number of the first malformed line, and the expected text.
    pub first_bad: Option<(u64, &'static str)>,
}

/// An answer of a driver, in a log or in a replay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedAnswer {
    /// TPDO 1.
    pub answer: AnswerFrame,
    /// TPDO 2.
    pub status: StatusFrame,
}

impl RecordedAnswer {
    /// Returns true if all bits are those of another answer.
    pub fn has_bits_of(&self, other: &Self) -> bool {
        let bits = |of: &Self| {
            [of.answer.friction_torque_nm, of.answer.feed_forward_current_a].map(f32::to_bits)
        };
        bits(self) == bits(other) && self.status == other.status
    }
}

/// Error of a log that cannot be replayed; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PlanError {
    /// The file cannot be read.
    #[error("{file}: {source}")]
    Read { file: String, source: std::io::Error },
    /// Too many lines are malformed.
    #[error(
        "{file}: {bad} of {lines} lines are not frames of a CAN log, the first is line {first}: expected {expected}"
    )]
    Bad { file: String, bad: u64, lines: u64, first: u64, expected: &'static str },
    /// The lines have no time stamps.
    #[error("{file}: no time stamps, expected a log of candump -l can0, or of candump -L can0")]
    Unstamped { file: String },
    /// The log has no inputs of a joint.
    #[error(
        "{file}: {samples} SYNCs (080 with a counter of one byte) and {motions} Motion frames (480 + node) of a joint, expected at least 2 and 1; found {census}"
    )]
    Empty { file: String, samples: u64, motions: u64, census: Census },
}

impl Plan {
    /// Reads a log and plans its replay to `node`.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn read(path: &Path, node: NodeId) -> Result<Self, PlanError> {
        let file = path.display().to_string();
        let failed = |source| PlanError::Read { file: file.clone(), source };
        let mut reader = BufReader::with_capacity(1 << 20, File::open(path).map_err(failed)?);
        let mut builder = Builder::new(node, reader.fill_buf().map_err(failed)?);
        let mut line = Vec::new();
        let mut hash = Sha256::new();
        loop {
            line.clear();
            if reader.read_until(b'\n', &mut line).map_err(failed)? == 0 {
                break;
            }
            hash.update(&line);
            builder.line(&line);
        }
        let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        builder.finish(&file, sha256, || Census::of(BufReader::new(File::open(path)?)))
    }

    /// Plans the replay of a log in memory.
    ///
    /// # Errors
    /// See [`Plan::read`].
    pub fn parse(log: &[u8], node: NodeId) -> Result<Self, PlanError> {
        let mut builder = Builder::new(node, log);
        log.split_inclusive(|byte| *byte == b'\n').for_each(|line| builder.line(line));
        let sha256 = Sha256::digest(log).iter().map(|byte| format!("{byte:02x}")).collect();
        builder.finish("log", sha256, || Census::of(log))
    }
}

struct Builder {
    node: NodeId,
    reader: TextReader,
    format: TextFormat,
    /// The followed joint: the first one with inputs.
    joint: Option<JointOnBus>,
    /// Counts the samples as the joint does.
    inbox: SampleAssembler,
    /// True once the log has given a sample number.
    has_sample_numbers: bool,
    /// Sample number of each SYNC; `None` for a SYNC that ends no sample.
    numbers: Vec<Option<u32>>,
    plan: Plan,
    first_ns: Option<u64>,
    last_ns: u64,
    motions: u64,
    /// Times of SYNCs, ns.
    syncs: Vec<u64>,
    answer: Option<AnswerFrame>,
}

impl Builder {
    /// Creates the builder for a log with this beginning.
    fn new(node: NodeId, head: &[u8]) -> Self {
        let format = TextFormat::of(head).unwrap_or_default();
        Self {
            node,
            reader: TextReader::of(head),
            format,
            joint: None,
            inbox: SampleAssembler::new(node),
            has_sample_numbers: false,
            numbers: Vec::new(),
            plan: Plan::default(),
            first_ns: None,
            last_ns: 0,
            motions: 0,
            syncs: Vec::new(),
            answer: None,
        }
    }

    fn line(&mut self, text: &[u8]) {
        if text.trim_ascii().is_empty() {
            return;
        }
        self.plan.lines += 1;
        let over = &mut self.plan.skipped;
        let line = match self.reader.read(text) {
            Frames::Line(line) => line,
            // In candump logs, every line is a frame.
            Frames::None if self.format != TextFormat::Candump => return,
            found => {
                let error = if let Frames::Bad(error) = found { error } else { LineError::Time };
                over.bad_lines += 1;
                self.plan.first_bad.get_or_insert((self.plan.lines, error.expected(self.format)));
                return;
            }
        };
        let frame = match line.frame {
            CanFrame::Flexible { .. } => {
                let Some(telemetry) = line.frame.to_telemetry() else {
                    return over.flexible += 1;
                };
                return telemetry.frames().for_each(|frame| self.frame(&frame, &line));
            }
            CanFrame::Remote { .. } => return over.remote += 1,
            CanFrame::Error { .. } => return over.error += 1,
            CanFrame::Data { .. } => line.frame.to_joint(),
        };
        let Some(frame) = frame else { return over.foreign += 1 };
        self.frame(&frame, &line);
    }

    fn frame(&mut self, frame: &Frame, line: &Line) {
        match Message::parse(frame) {
            Ok(message) => self.message(message, line.interface, line.time_ns),
            Err(FrameError::Foreign(_)) => self.plan.skipped.foreign += 1,
            Err(_) => {
                let is_followed = self.is_of_joint(frame, line.interface);
                let over = &mut self.plan.skipped;
                *if is_followed { &mut over.damaged } else { &mut over.foreign } += 1;
            }
        }
    }

    fn is_of_joint(&self, frame: &Frame, interface: &[u8]) -> bool {
        let node = NodeId::new((frame.identifier() & 0x7F) as u8);
        self.joint.as_ref().zip(node).is_some_and(|(joint, node)| joint.is(interface, node))
    }

    fn message(&mut self, message: Message, interface: &[u8], time_ns: u64) {
        let is_answer =
            matches!(message, Message::Answer(..) | Message::Status(..) | Message::Telemetry(..));
        let is_followed = match (&self.joint, message.node()) {
            (Some(joint), None) => *joint.interface == *interface,
            (Some(joint), Some(node)) => joint.is(interface, node),
            // The first joint with inputs is followed, from its first frame on.
            (None, Some(node)) if !is_answer => {
                self.joint = Some(JointOnBus { interface: interface.into(), node });
                true
            }
            (None, _) => false,
        };
        if !is_followed {
            self.plan.skipped.foreign += 1;
            return;
        }
        match message {
            Message::Answer(_, answer) => return self.answer = Some(answer),
            Message::Status(_, status) => {
                if let Some(answer) = self.answer.take() {
                    self.record(RecordedAnswer { answer, status });
                }
                return;
            }
            Message::Telemetry(..) => return,
            _ => {}
        }
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        if time_ns < self.last_ns {
            self.plan.skipped.backwards += 1;
        }
        self.last_ns = self.last_ns.max(time_ns);
        let due_ns = self.last_ns - first_ns;
        let message = message.with_node(self.node);
        self.inbox.take(&message);
        match message {
            Message::Sync(sync) => {
                self.plan.samples += 1;
                self.plan.recorded.push(None);
                self.syncs.push(due_ns);
                let ends = matches!(self.inbox.sync(sync), SyncOutcome::Sample { .. });
                self.numbers.push(ends.then(|| self.inbox.sequence()));
                if ends {
                    self.inbox.end_sample();
                }
            }
            Message::Entry(_, TraceEntry::JointKind(_)) => {}
            Message::Entry(_, TraceEntry::Run(_) | TraceEntry::Sequence(_)) => {
                self.has_sample_numbers = true
            }
            Message::Motion(..) => self.motions += 1,
            _ => {}
        }
        self.plan.frames.push(PlannedFrame { due_ns, message });
    }

    /// Assigns an answer to its sample by the sample number. Without sample numbers in the log, assigns it to the last
    /// sample.
    fn record(&mut self, recorded: RecordedAnswer) {
        let number = Some(recorded.status.sequence);
        let latest = self.numbers.len().saturating_sub(MAX_LATENCY_SAMPLES);
        let place = if self.has_sample_numbers {
            self.numbers.iter().skip(latest).rposition(|known| *known == number)
        } else {
            self.numbers.len().checked_sub(1 + latest)
        };
        let place = place.and_then(|place| self.plan.recorded.get_mut(latest + place));
        if let Some(place @ None) = place {
            *place = Some(recorded);
        }
    }

    /// Completes the plan. `census` is called only for an error message.
    fn finish(
        mut self,
        file: &str,
        sha256: String,
        census: impl FnOnce() -> io::Result<Census>,
    ) -> Result<Plan, PlanError> {
        let plan = &mut self.plan;
        let (bad, lines) = (plan.skipped.bad_lines, plan.lines);
        if self.reader.lacks_stamps() {
            return Err(PlanError::Unstamped { file: file.into() });
        }
        if let Some((first, expected)) = plan.first_bad
            && bad as f64 > MAX_BAD_LINE_SHARE * lines as f64
        {
            return Err(PlanError::Bad { file: file.into(), bad, lines, first, expected });
        }
        if plan.samples < 2 || self.motions == 0 {
            let (samples, motions) = (plan.samples, self.motions);
            let file = file.to_owned();
            return Err(match census() {
                Ok(census) => PlanError::Empty { file, samples, motions, census },
                Err(source) => PlanError::Read { file, source },
            });
        }
        let mut steps: Vec<u64> =
            self.syncs.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0).collect();
        let middle = steps.len() / 2;
        if !steps.is_empty() {
            // Rounded to a microsecond, the resolution of most logs, so that 1 ms is not read as 0.999998 ms.
            let median_ns = *steps.select_nth_unstable(middle).1;
            plan.period_s = (median_ns as f64 / 1000.0).round() * 1e-6;
        }
        if plan.recorded.iter().all(Option::is_none) {
            plan.recorded.clear();
        }
        plan.sha256 = sha256;
        Ok(self.plan)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;

    const LOG: &str = "\
(10.000000) can0 487#0000803F0000C07F\n\
(10.000000) can0 080#01\n\
(10.000100) can0 187#0000803F00000000\n\
(10.000110) can0 287#0000000000000000\n\
(10.001000) can0 487#0000003F0000C07F\n\
(10.001000) can1 080#09\n\
(10.001000) can0 080#02\n\
(10.002000) can0 488#0000003F0000C07F\n\
(10.002000) can0 123##011\n\
(10.002000) can0 123#R\n\
(10.002000) can0 20000004#0000000000000000\n\
(10.001900) can0 487#00\n\
(10.001900) can0 080#03\n";

    #[test]
    fn plan_with_several_nodes_addresses_the_tested_node() {
        let plan = Plan::parse(LOG.as_bytes(), NodeId::new(3).unwrap()).unwrap();
        let sent: Vec<_> =
            plan.frames.iter().map(|planned| (planned.due_ns, planned.message.emit())).collect();
        let identifiers: Vec<u16> = sent.iter().map(|(_, frame)| frame.identifier()).collect();
        assert_eq!(identifiers, [0x483, 0x80, 0x483, 0x80, 0x80]);
        let times: Vec<u64> = sent.iter().map(|(due_ns, _)| *due_ns / 1000).collect();
        assert_eq!(times, [0, 0, 1000, 1000, 1900]);
        assert_eq!(plan.samples, 3);
        let over = plan.skipped;
        assert_eq!((over.foreign, over.damaged), (2, 1));
        assert_eq!((over.flexible, over.remote, over.error), (1, 1, 1));
        assert_eq!(plan.recorded[0].unwrap().answer.friction_torque_nm, 1.0);
        assert!(plan.recorded[1].is_none());
        // Steps of 1 and 0.9 ms.
        assert!((plan.period_s - 1e-3).abs() < 1e-12);
    }

    #[test]
    fn plan_with_late_answers_assigns_them_by_sample_number() {
        let log = "(1.000) can0 601#2300200107000000\n(1.000) can0 481#0000803F0000C07F\n\
            (1.000) can0 080#01\n(1.001) can0 080#02\n(1.002) can0 080#02\n(1.003) can0 080#03\n\
            (1.004) can0 181#0000803F00000000\n(1.004) can0 281#0000000000000000\n\
            (1.004) can0 181#0000004000000000\n(1.004) can0 281#0000000002000000\n\
            (1.005) can0 181#0000404000000000\n(1.005) can0 281#0000000009000000\n";
        let plan = Plan::parse(log.as_bytes(), NodeId::new(9).unwrap()).unwrap();
        let torques: Vec<_> = (plan.recorded.iter())
            .map(|recorded| recorded.map(|recorded| recorded.answer.friction_torque_nm))
            .collect();
        assert_eq!(torques, [Some(1.0), None, None, Some(2.0)]);
    }

    #[test]
    fn parse_without_joint_inputs_returns_one_line_error() {
        let node = NodeId::FIRST;
        let error = Plan::parse(b"time_s,velocity_rad_s\n0,1\n", node).unwrap_err();
        assert!(matches!(error, PlanError::Bad { bad: 2, lines: 2, first: 1, .. }), "{error}");
        message::check("traces", "no CAN log", &error.to_string(), &["2 of 2", "line 1"]);
        // Two SYNCs and commands, but no motion.
        let log = b"(1.0) can0 301#0000000000000000\n(1.0) can0 080#01\n(1.1) can0 080#02\n";
        let error = Plan::parse(log, node).unwrap_err();
        assert!(matches!(error, PlanError::Empty { samples: 2, motions: 0, .. }), "{error}");
        let parts = ["log: ", "080", "480 + node", "2 ", "1;", "080 (2), 301 (1)"];
        message::check("traces", "no inputs of a joint", &error.to_string(), &parts);
    }
}
