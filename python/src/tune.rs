//! Tuning of a joint on a bus.
//!
//! The session runs on threads that never wait for Python, because a late frame stops a real joint. The caller's thread
//! passes its lines and its question to Python, and asks for Ctrl-C; the session then ends in order.

use crate::diagnosis::Diagnosis;
use crate::error::refused;
use crate::table::Table;
use compensator_core::can::NodeId;
use compensator_core::can::slcan::BitRate;
use firmware::access::Key;
use friction_results::Files;
use friction_results::table_file::TableColumn;
use friction_results::tune::{self as results, TuneReport, TuneRun};
use joint_bus::bus::slcan::Options;
use joint_bus::bus::{Bus, BusName, Hub};
use joint_bus::canopen::{Client, key_of};
use joint_log::Cells;
use joint_log::work::{self, Progress};
use joint_rig::{MotorNode, service};
use joint_tuning::trial_set::UndoError;
use joint_tuning::{MotionLimits, Session, TuneOptions, TuneUser, motion, trial_set};
use pyo3::prelude::*;
use simulated_machines::joint_plant::DrawnJoint;
use simulated_machines::scenarios::Hide;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::{SystemTime, UNIX_EPOCH};

/// Options of the command line in messages, and the keywords that they are here.
const KEYWORDS: [(&str, &str); 6] = [
    ("(--range)", "(range_rad)"),
    ("--range ", "range_rad="),
    ("(--speed)", "(speed_rad_s)"),
    ("--speed ", "speed_rad_s="),
    ("--key FILE", "key=FILE"),
    ("--bus", "bus"),
];

fn in_keywords(message: &str) -> String {
    KEYWORDS
        .iter()
        .fold(message.to_owned(), |text, (option, keyword)| text.replace(option, keyword))
}

/// Why a joint is not tuned: the error of a library, or one of those below.
type Failure = Box<dyn std::error::Error + Send + Sync>;

/// A number is not accepted.
#[derive(Debug, thiserror::Error)]
#[error("{name}={number}: expected {expected}")]
struct Unfit {
    name: &'static str,
    number: f64,
    expected: &'static str,
}

/// Returns a failure as an exception.
fn failed(py: Python<'_>, failure: &Failure) -> PyErr {
    refused(py, &in_keywords(&failure.to_string()))
}

/// Where a joint is.
#[pyclass(frozen, module = "friction._core")]
pub struct Joint {
    bus: BusName,
    bit_rate: BitRate,
    node: NodeId,
    key: Key,
    seed: u64,
    simulated: Option<DrawnJoint>,
}

#[pymethods]
impl Joint {
    #[new]
    #[pyo3(signature = (bus, *, node, key=None, hide=vec![], seed=None, bit_rate))]
    fn new(
        py: Python<'_>,
        bus: &str,
        node: u8,
        key: Option<PathBuf>,
        hide: Vec<String>,
        seed: Option<u64>,
        bit_rate: u32,
    ) -> PyResult<Self> {
        let refuse = |line: String| refused(py, &line);
        let name = bus.parse::<BusName>().map_err(|error| refuse(error.to_string()))?;
        let is_loop = name == BusName::Loop;
        let id = NodeId::new(node).filter(|id| !is_loop || *id == NodeId::FIRST);
        let expected = if is_loop { "1, the simulated joint" } else { "1 to 127" };
        let node = id.ok_or_else(|| refuse(format!("node={node}: expected {expected}")))?;
        let bit_rate = BitRate::from_bits_per_second(bit_rate)
            .ok_or_else(|| refuse(format!("bit_rate={bit_rate}: not a bit rate of CAN, bit/s")))?;
        let key = key_of(key.as_deref()).map_err(|error| refuse(error.to_string()))?;
        if !is_loop && !hide.is_empty() {
            return Err(refuse("hide: needs bus=\"loop\", the simulated joint".to_owned()));
        }
        let parsed: Result<Vec<Hide>, _> = hide.iter().map(|text| Hide::parse(text)).collect();
        let hide = parsed.map_err(|error| refuse(format!("hide: {error}")))?;
        let seed = seed.unwrap_or(1);
        let draw =
            || DrawnJoint::draw(seed, &hide, None).map_err(|error| refuse(error.to_string()));
        let simulated = is_loop.then(draw).transpose()?;
        Ok(Self { bus: name, bit_rate, node, key, seed, simulated })
    }
}

impl Joint {
    fn name(&self) -> String {
        format!("node {} on {}", self.node.number(), self.bus)
    }

    /// Connects to the joint. The simulated joint is new for each connection.
    fn client(&self) -> Result<Client<Box<dyn Bus>>, Failure> {
        let hub = Hub::new();
        if let Some(joint) = &self.simulated {
            hub.attach(MotorNode::drawn(joint, &service::starting_set(joint))?);
        }
        let options = Options { bit_rate: self.bit_rate, ..Options::default() };
        let bus = self.bus.open(&hub, options)?;
        Ok(Client::new(bus, self.node).with_key(self.key))
    }
}

/// Result of a tuning session.
#[pyclass(frozen, module = "friction._core")]
pub struct Tuning {
    report: TuneReport,
    files: Files,
    runs: Vec<TuneRun>,
    diagnosis: Option<Py<Diagnosis>>,
}

#[pymethods]
impl Tuning {
    /// Returns the text of tune.json.
    fn json(&self) -> &str {
        &self.files.document.1
    }

    /// Returns the text of tune.html.
    #[pyo3(signature = (threads=0))]
    fn html(&self, threads: usize) -> String {
        // The page is ready.
        let _ = threads;
        let page = self.files.all().find(|(name, _)| *name == "tune.html");
        page.map_or_else(String::new, |(_, text)| String::from_utf8_lossy(text).into_owned())
    }

    /// Returns the first screen of the page as an HTML fragment without scripts.
    fn first_screen(&self) -> String {
        self.report.first_screen()
    }

    /// Writes all result files into a folder, each completely or not at all.
    #[pyo3(signature = (folder, threads=0))]
    fn write(&self, folder: PathBuf, threads: usize) -> PyResult<()> {
        let _ = threads;
        Ok(self.files.write(&folder)?)
    }

    /// Returns the recorded rows of all runs.
    fn runs(&self) -> Table {
        let cells = |column| match column {
            TableColumn::Numbers(numbers) => Cells::Numbers(numbers),
            TableColumn::Texts { texts, indices } => {
                Cells::Texts(indices.into_iter().map(|at| texts[at].clone()).collect())
            }
        };
        let columns = results::table(&self.runs).into_columns().into_iter();
        let columns = columns.map(|(name, column)| (name, cells(column))).collect();
        Table(joint_log::Table { name: "runs".to_owned(), columns })
    }

    /// The diagnosis of the runs; None if nothing was learnt.
    #[getter]
    fn diagnosis(&self, py: Python<'_>) -> Option<Py<Diagnosis>> {
        self.diagnosis.as_ref().map(|found| found.clone_ref(py))
    }
}

/// A question to the caller, and where its answer is expected.
type Question = (String, Sender<bool>);

/// The session's side of its user.
struct Caller {
    questions: Sender<Question>,
}

impl TuneUser for Caller {
    fn confirms(&mut self, what: &str) -> bool {
        let (reply, answer) = channel();
        self.questions.send((what.to_owned(), reply)).is_ok() && answer.recv().unwrap_or(false)
    }

    fn progress(&mut self, line: &str) {
        work::report_stage(line);
    }
}

/// The caller's side: what Python is asked while a session runs.
struct Listener {
    questions: Receiver<Question>,
    confirm: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
    is_simulated: bool,
    is_interrupted: Arc<AtomicBool>,
    last: RefCell<String>,
    exception: RefCell<Option<PyErr>>,
    /// The question to which the caller gave no answer.
    unanswered: RefCell<Option<String>>,
}

impl Listener {
    /// Asks for Ctrl-C, and passes on a new line and a question.
    fn listen(&self, py: Python<'_>, state: &Progress) -> PyResult<()> {
        let question = self.questions.try_recv();
        let passed = py.check_signals().and_then(|()| match &question {
            Ok((text, _)) if self.exception.borrow().is_none() => self.answer(py, text),
            _ => Ok(false),
        });
        if let Ok((_, reply)) = question {
            // The session waits for the answer.
            let _ = reply.send(*passed.as_ref().unwrap_or(&false));
        }
        passed?;
        match (state, &self.progress) {
            (Progress::Stage(line), Some(progress)) if *line != *self.last.borrow() => {
                line.clone_into(&mut self.last.borrow_mut());
                progress.call1(py, (line, None::<f64>)).map(|_| ())
            }
            _ => Ok(()),
        }
    }

    fn answer(&self, py: Python<'_>, question: &str) -> PyResult<bool> {
        match &self.confirm {
            Some(confirm) => confirm.call1(py, (question,))?.bind(py).is_truthy(),
            None if self.is_simulated => Ok(true),
            None => {
                self.unanswered.replace(Some(question.to_owned()));
                Ok(false)
            }
        }
    }

    /// Listens once. The first exception ends the session, which returns when the joint is back at its former set.
    fn poll(&self, state: &Progress) -> ControlFlow<()> {
        if let Err(raised) = Python::attach(|py| self.listen(py, state)) {
            self.is_interrupted.store(true, Ordering::Relaxed);
            self.exception.borrow_mut().get_or_insert(raised);
        }
        ControlFlow::Continue(())
    }
}

/// Tunes a joint. `motion` is the name and the text of a CSV file. `confirm` is called with the question whether the joint may
/// move; without it, only a simulated joint moves.
#[pyfunction]
#[pyo3(signature = (joint, *, range_rad, speed_rad_s, minutes, motion=None, allow_active=false, confirm=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "each is a keyword in Python")]
pub fn tune(
    py: Python<'_>,
    joint: &Bound<'_, Joint>,
    range_rad: f64,
    speed_rad_s: f64,
    minutes: f64,
    motion: Option<(String, String)>,
    allow_active: bool,
    confirm: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Tuning> {
    let joint = joint.get();
    let options = options(joint, range_rad, speed_rad_s, minutes, motion)
        .map_err(|error| failed(py, &error))?;
    let options = TuneOptions { allow_active, ..options };
    let is_interrupted = Arc::new(AtomicBool::new(false));
    let (send, questions) = channel();
    let (outcome, exception, unanswered) = py.detach(|| {
        let listener = Listener {
            questions,
            confirm,
            progress,
            is_simulated: options.is_simulated,
            is_interrupted: Arc::clone(&is_interrupted),
            last: RefCell::default(),
            exception: RefCell::default(),
            unanswered: RefCell::default(),
        };
        let outcome = work::run(0, &|state| listener.poll(state), || {
            let user = Caller { questions: send };
            session(joint, &options, is_interrupted, user)
        });
        (outcome, listener.exception.into_inner(), listener.unanswered.into_inner())
    });
    if let Some(raised) = exception {
        return Err(raised);
    }
    if let Some(question) = unanswered {
        let question = question.lines().map(str::trim).collect::<Vec<_>>().join("; ");
        let line =
            format!("confirm: expected True, or a function that answers this question: {question}");
        return Err(refused(py, &line));
    }
    let (mut session, files) = outcome.map_err(|error| failed(py, &error))?;
    let diagnosis = session.learnt.take().map(Diagnosis::of_session);
    Ok(Tuning {
        files,
        runs: joint_tuning::results::runs(&session),
        report: session.report,
        diagnosis: diagnosis.map(|found| Py::new(py, found)).transpose()?,
    })
}

fn options(
    joint: &Joint,
    range_rad: f64,
    speed_rad_s: f64,
    minutes: f64,
    motion: Option<(String, String)>,
) -> Result<TuneOptions, Failure> {
    // The limits of the command line.
    for (name, number) in [("range_rad", range_rad), ("speed_rad_s", speed_rad_s)] {
        if !(number > 0.0 && number <= 100.0) {
            let expected = "a number above 0 and at most 100";
            return Err(Unfit { name, number, expected }.into());
        }
    }
    if !(1.0..=60.0).contains(&minutes) {
        return Err(Unfit { name: "minutes", number: minutes, expected: "1 to 60" }.into());
    }
    let limits = MotionLimits::new(range_rad, speed_rad_s);
    let parse = |(name, text): (String, String)| motion::parse(&name, &text, &limits);
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Ok(TuneOptions {
        node: joint.node,
        limits,
        seconds: 60.0 * minutes,
        motion: motion.map(parse).transpose()?,
        allow_active: false,
        seed: joint.seed,
        joint: joint.name(),
        is_simulated: joint.simulated.is_some(),
        now_s: now.as_secs(),
    })
}

fn session(
    joint: &Joint,
    options: &TuneOptions,
    is_interrupted: Arc<AtomicBool>,
    mut user: Caller,
) -> Result<(Session, Files), Failure> {
    let client = joint.client()?;
    let is_interrupted = Box::new(move || is_interrupted.load(Ordering::Relaxed));
    let session = joint_tuning::tune(client, options, is_interrupted, &mut user)?;
    let files = joint_tuning::results::files(&session)?;
    Ok((session, files))
}

/// Brings the former parameters of a joint back, and saves them. Returns their CRC.
#[pyfunction]
pub fn undo_tuning(py: Python<'_>, joint: &Bound<'_, Joint>) -> PyResult<String> {
    let joint = joint.get();
    let undone = py.detach(|| {
        let mut client = joint.client()?;
        let record = trial_set::undo(&mut client).map_err(|error| match error {
            UndoError::NotTuned => format!("{}: {error}", joint.name()).into(),
            error => Failure::from(error),
        })?;
        Ok::<_, Failure>(format!("{:08x}", record.before_crc))
    });
    undone.map_err(|error| failed(py, &error))
}
