//! What of a log is played, and when.
//!
//! The inputs of one joint and the SYNCs are, in the log's order and times; whatever number the joint had,
//! the frames go to the one that is tested. What the joint answered when it was recorded is kept beside
//! for comparison. Everything else that a log holds (other nodes, CAN FD, remote requests, error
//! frames) is counted and passed over. Bad lines are counted; more than one in twenty is an error.

use compensator_core::can::{
    Answer, Entry, Frame, FrameError, Inbox, Message, Node, Status, SyncOutcome,
};
use joint_trace::{CanFrame, Census, Frames, LineError, TextFormat, TextReader};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

/// Samples an answer may come late by, at most.
const LATEST: usize = 4096;

/// Share of bad lines that is too much.
const BAD_LINES_MAX: f64 = 0.05;

/// A frame and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Planned {
    /// Time from the first frame, ns.
    pub due_ns: u64,
    /// What is sent.
    pub message: Message,
}

/// What a log held besides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassedOver {
    /// Frames of other nodes, and answers.
    pub foreign: u64,
    /// Frames of the joint with a wrong length or content.
    pub damaged: u64,
    /// CAN FD frames.
    pub flexible: u64,
    /// Remote requests.
    pub remote: u64,
    /// Error frames.
    pub error: u64,
    /// Frames stamped before the one that stands before them; played with it.
    pub backwards: u64,
    /// Lines that are no frames, where each should be one.
    pub bad_lines: u64,
}

/// What is played.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The frames, by rising time.
    pub frames: Vec<Planned>,
    /// SYNCs among them.
    pub samples: u64,
    /// Time from SYNC to SYNC, s: the median.
    pub period_s: f64,
    /// What the joint answered when it was recorded, by sample; empty where it did not.
    pub recorded: Vec<Option<Recorded>>,
    /// What was passed over.
    pub passed_over: PassedOver,
    /// SHA-256 of the log, in hexadecimal.
    pub sha256: String,
    /// Lines of the log.
    pub lines: u64,
    /// The first bad line: its number and what is expected.
    pub first_bad: Option<(u64, &'static str)>,
}

/// A recorded answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorded {
    /// TPDO 1.
    pub answer: Answer,
    /// TPDO 2.
    pub status: Status,
}

/// Why a log cannot be played; one line.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// It cannot be read.
    #[error("{file}: {source}")]
    Read {
        /// The file.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// Too many lines are no frames.
    #[error(
        "{file}: {bad} of {lines} lines are no frames of a CAN log, the first is line {first}: expected {expected}"
    )]
    Bad {
        /// The file.
        file: String,
        /// How many.
        bad: u64,
        /// Of how many.
        lines: u64,
        /// The first of them.
        first: u64,
        /// What should stand there.
        expected: &'static str,
    },
    /// No joint was fed in it.
    #[error(
        "{file}: {samples} SYNCs (080) and {motions} Motion frames (480 + node) of a joint, expected at least 2 and 1; found {census}"
    )]
    Empty {
        /// The file.
        file: String,
        /// SYNCs there are.
        samples: u64,
        /// Motion frames there are.
        motions: u64,
        /// What is in it.
        census: Census,
    },
}

impl Plan {
    /// Reads a log, for the node that is to be tested.
    ///
    /// # Errors
    /// See [`PlanError`].
    pub fn read(path: &Path, node: Node) -> Result<Self, PlanError> {
        let file = path.display().to_string();
        let failed = |source| PlanError::Read { file: file.clone(), source };
        let mut reader = BufReader::with_capacity(1 << 20, File::open(path).map_err(failed)?);
        let format = TextFormat::of(reader.fill_buf().map_err(failed)?);
        let mut builder = Builder::new(node, format);
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

    /// A plan of a log in memory.
    ///
    /// # Errors
    /// As [`Plan::read`].
    pub fn parse(log: &[u8], node: Node) -> Result<Self, PlanError> {
        let mut builder = Builder::new(node, TextFormat::of(log));
        log.split_inclusive(|byte| *byte == b'\n').for_each(|line| builder.line(line));
        let sha256 = Sha256::digest(log).iter().map(|byte| format!("{byte:02x}")).collect();
        builder.finish("log", sha256, || Census::of(log))
    }
}

struct Builder {
    node: Node,
    reader: TextReader,
    /// Whether every line must be a frame, as candump's are.
    is_candump: bool,
    /// The joint that is followed: its interface and number; the first whose inputs are seen.
    joint: Option<(Vec<u8>, Node)>,
    /// Counts the samples as the joint does, once the log has said where they count from.
    inbox: Inbox,
    counts: bool,
    /// The number in its run of each SYNC's sample; `None` for one that ends none.
    numbers: Vec<Option<u32>>,
    plan: Plan,
    first_ns: Option<u64>,
    last_ns: u64,
    motions: u64,
    /// Times of SYNCs, ns.
    syncs: Vec<u64>,
    answer: Option<Answer>,
}

impl Builder {
    fn new(node: Node, format: Option<TextFormat>) -> Self {
        let format = format.unwrap_or_default();
        let plan = Plan {
            frames: Vec::new(),
            samples: 0,
            period_s: 0.0,
            recorded: Vec::new(),
            passed_over: PassedOver::default(),
            sha256: String::new(),
            lines: 0,
            first_bad: None,
        };
        Self {
            node,
            reader: TextReader::new(format),
            is_candump: format == TextFormat::Candump,
            joint: None,
            inbox: Inbox::new(node),
            counts: false,
            numbers: Vec::new(),
            plan,
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
        let over = &mut self.plan.passed_over;
        let line = match self.reader.read(text) {
            Frames::Line(line) => line,
            Frames::None if !self.is_candump => return,
            found => {
                let error = if let Frames::Bad(error) = found { error } else { LineError::Time };
                over.bad_lines += 1;
                self.plan.first_bad.get_or_insert((self.plan.lines, error.expected()));
                return;
            }
        };
        let frame = match line.frame {
            CanFrame::Flexible { .. } => return over.flexible += 1,
            CanFrame::Remote { .. } => return over.remote += 1,
            CanFrame::Error { .. } => return over.error += 1,
            CanFrame::Data { .. } => line.frame.to_joint(),
        };
        let Some(frame) = frame else { return over.foreign += 1 };
        match Message::parse(&frame) {
            Ok(message) => self.message(message, line.interface, line.time_ns),
            Err(FrameError::Foreign(_)) => over.foreign += 1,
            Err(_) => {
                let ours = self.is_ours(&frame, line.interface);
                let over = &mut self.plan.passed_over;
                *if ours { &mut over.damaged } else { &mut over.foreign } += 1;
            }
        }
    }

    fn is_ours(&self, frame: &Frame, interface: &[u8]) -> bool {
        let number = (frame.identifier() & 0x7F) as u8;
        self.joint.as_ref().is_some_and(|(own, node)| own == interface && node.number() == number)
    }

    fn message(&mut self, message: Message, interface: &[u8], time_ns: u64) {
        let is_answer =
            matches!(message, Message::Answer(..) | Message::Status(..) | Message::Telemetry(..));
        let ours = match (&self.joint, message.node()) {
            (Some((own, _)), None) => own == interface,
            (Some((own, joint)), Some(node)) => own == interface && *joint == node,
            // Nobody is followed yet: the first to be fed is, from its first frame on.
            (None, Some(node)) if !is_answer => {
                self.joint = Some((interface.to_vec(), node));
                true
            }
            (None, _) => false,
        };
        if !ours {
            self.plan.passed_over.foreign += 1;
            return;
        }
        match message {
            Message::Answer(_, answer) => return self.answer = Some(answer),
            Message::Status(_, status) => {
                if let Some(answer) = self.answer.take() {
                    self.record(Recorded { answer, status });
                }
                return;
            }
            Message::Telemetry(..) => return,
            _ => {}
        }
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        if time_ns < self.last_ns {
            self.plan.passed_over.backwards += 1;
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
            Message::Entry(_, Entry::JointKind(_)) => {}
            Message::Entry(_, Entry::Run(_) | Entry::Sequence(_)) => self.counts = true,
            Message::Motion(..) => self.motions += 1,
            _ => {}
        }
        self.plan.frames.push(Planned { due_ns, message });
    }

    /// Puts an answer to the sample it answers: with several on their way that is not the last. Where the
    /// log has not said yet which number the samples have, the last is all there is to go by.
    fn record(&mut self, recorded: Recorded) {
        let number = Some(recorded.status.sequence);
        let latest = self.numbers.len().saturating_sub(LATEST);
        let place = if self.counts {
            self.numbers.iter().skip(latest).rposition(|known| *known == number)
        } else {
            self.numbers.len().checked_sub(1 + latest)
        };
        let place = place.and_then(|place| self.plan.recorded.get_mut(latest + place));
        if let Some(place @ None) = place {
            *place = Some(recorded);
        }
    }

    /// `census` says what is in the log, where that has to be said.
    fn finish(
        mut self,
        file: &str,
        sha256: String,
        census: impl FnOnce() -> io::Result<Census>,
    ) -> Result<Plan, PlanError> {
        let plan = &mut self.plan;
        let (bad, lines) = (plan.passed_over.bad_lines, plan.lines);
        if let Some((first, expected)) = plan.first_bad
            && bad as f64 > BAD_LINES_MAX * lines as f64
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
            // To a microsecond, the resolution of most logs: a period of 1 ms is one, not 0.999998.
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
    fn inputs_of_the_joint_are_played_to_the_node_that_is_tested() {
        let plan = Plan::parse(LOG.as_bytes(), Node::new(3).unwrap()).unwrap();
        let sent: Vec<_> =
            plan.frames.iter().map(|planned| (planned.due_ns, planned.message.emit())).collect();
        let identifiers: Vec<u16> = sent.iter().map(|(_, frame)| frame.identifier()).collect();
        assert_eq!(identifiers, [0x483, 0x80, 0x483, 0x80, 0x80]);
        let times: Vec<u64> = sent.iter().map(|(due_ns, _)| *due_ns / 1000).collect();
        assert_eq!(times, [0, 0, 1000, 1000, 1900]);
        assert_eq!(plan.samples, 3);
        let over = plan.passed_over;
        assert_eq!((over.foreign, over.damaged), (2, 1));
        assert_eq!((over.flexible, over.remote, over.error), (1, 1, 1));
        assert_eq!(plan.recorded[0].unwrap().answer.friction_torque_nm, 1.0);
        assert!(plan.recorded[1].is_none());
        // Steps of 1 and 0.9 ms.
        assert!((plan.period_s - 1e-3).abs() < 1e-12);
    }

    #[test]
    fn a_recorded_answer_belongs_to_the_sample_of_its_number() {
        let log = "(1.000) can0 601#2300200107000000\n(1.000) can0 481#0000803F0000C07F\n\
            (1.000) can0 080#01\n(1.001) can0 080#02\n(1.002) can0 080#02\n(1.003) can0 080#03\n\
            (1.004) can0 181#0000803F00000000\n(1.004) can0 281#0000000000000000\n\
            (1.004) can0 181#0000004000000000\n(1.004) can0 281#0000000002000000\n\
            (1.005) can0 181#0000404000000000\n(1.005) can0 281#0000000009000000\n";
        let plan = Plan::parse(log.as_bytes(), Node::new(9).unwrap()).unwrap();
        let torques: Vec<_> = (plan.recorded.iter())
            .map(|recorded| recorded.map(|recorded| recorded.answer.friction_torque_nm))
            .collect();
        assert_eq!(torques, [Some(1.0), None, None, Some(2.0)]);
    }

    #[test]
    fn what_cannot_be_played_is_refused_in_one_line() {
        let node = Node::FIRST;
        let error = Plan::parse(b"time_s,velocity_rad_s\n0,1\n", node).unwrap_err().to_string();
        assert!(
            error.contains("2 of 2 lines are no frames of a CAN log, the first is line 1"),
            "{error}"
        );
        // Two SYNCs and commands, but nobody says how the joint moves.
        let log = b"(1.0) can0 301#0000000000000000\n(1.0) can0 080#01\n(1.1) can0 080#02\n";
        let error = Plan::parse(log, node).unwrap_err().to_string();
        assert_eq!(
            error,
            "log: 2 SYNCs (080) and 0 Motion frames (480 + node) of a joint, expected at least 2 and \
             1; found frames 080 (2), 301 (1)"
        );
    }
}
