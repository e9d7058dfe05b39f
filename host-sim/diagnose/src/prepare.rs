//! Reading, checking and splitting of a log, as every front end does before a fit or a diagnosis.
//!
//! [`prepare`] reads files or tables in memory, checks the log ([`joint_log::log_check`]), splits it into training and test
//! data, and cuts both into tracks. The same log and options give the same result, whatever holds the log.

use crate::DiagnosisOptions;
use compensator_core::parameters::Choices;
use compensator_core::{Quantity, TermKind};
use friction_fit::params::ParameterFileError;
use friction_fit::prediction::PredictionError;
use friction_fit::spec::{Spec, SpecError};
use friction_fit::{
    FitOptions, Loss, Outcome, Rows, Track, campaign_start, identify_robustly, tracks_since,
};
use joint_log::log_check::{self, CheckedLog, Corrections, LogFinding, LogFindingKind};
use joint_log::setting::{Message, Setting};
use joint_log::work::{self, Cancelled, Progress};
use joint_log::{
    Cells, DataError, Dataset, FileContent, Part, ReadOptions, Split, SplitRule, Table, read_tables,
};
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Bytes that are hashed at a time: some tenths of a millisecond of work.
const HASHED_BYTES: usize = 64 * 1024;

/// Where a log is.
#[derive(Clone, Debug)]
pub enum Source {
    /// In files, of any supported format.
    Files(Vec<PathBuf>),
    /// In memory, as files of text.
    Contents(Vec<FileContent>),
    /// In memory.
    Tables(Vec<Table>),
}

impl Source {
    /// Reads the log.
    fn read(&self, options: &ReadOptions) -> Result<Dataset, Error> {
        let progress = |done, total| work::report(Progress::Reading { done, total });
        Ok(match self {
            Self::Files(files) => {
                let mut seen = HashSet::new();
                if let Some(twice) = files.iter().find(|file| !seen.insert(*file)) {
                    return Err(Error::Twice(twice.clone()));
                }
                joint_log::read(files, options, &progress)?
            }
            Self::Contents(contents) => joint_log::read_contents(contents, options, &progress)?,
            Self::Tables(tables) => read_tables(tables, options)?,
        })
    }

    /// Returns the SHA-256 of each file, or of the contents of each table.
    fn hashes(&self) -> Result<Vec<String>, Error> {
        let of_content =
            |content: &FileContent| hexadecimal(Sha256::new_with_prefix(&content.bytes));
        match self {
            Self::Files(files) => files.iter().map(|file| file_sha256(file)).collect(),
            Self::Contents(contents) => Ok(contents.iter().map(of_content).collect()),
            Self::Tables(tables) => Ok(tables.iter().map(table_sha256).collect()),
        }
    }
}

/// How a log is read, checked and split.
#[derive(Clone, Debug)]
pub struct PrepareOptions {
    /// How the log is read.
    pub read: ReadOptions,
    /// The mapped columns as the user gave them, `ours=theirs`, for reports.
    pub columns: Vec<String>,
    /// What is corrected in the log.
    pub corrections: Corrections,
    /// Rule of the split into training and test data.
    pub split: SplitRule,
    /// Seed of the choice of held-out runs.
    pub seed: u64,
    /// Rigid-body parts that the torque column contains besides friction.
    pub rigid_body: Vec<TermKind>,
    /// Use every N-th sample of the residual, at least 1.
    pub decimate: usize,
    /// Loss of the fits; `None` for [`Loss::Huber`] if the torque has many spikes or rows of a held channel are left out,
    /// else [`Loss::Squares`].
    pub loss: Option<Loss>,
}

impl Default for PrepareOptions {
    fn default() -> Self {
        Self {
            read: ReadOptions::default(),
            columns: Vec::new(),
            corrections: Corrections::default(),
            split: SplitRule::default(),
            seed: 0,
            rigid_body: Vec::new(),
            decimate: 1,
            loss: None,
        }
    }
}

/// The log of one joint, read, checked and split.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// Name of the joint, if the log has several.
    pub joint: Option<String>,
    /// All runs.
    pub data: Dataset,
    /// Training and test parts of the runs.
    pub split: Split,
    /// Training tracks.
    pub train: Vec<Track>,
    /// Test tracks.
    pub test: Vec<Track>,
    /// SHA-256 of each file, or of the contents of each table ([`table_sha256`]).
    pub hashes: Vec<String>,
    /// Problems of the log itself.
    pub log_findings: Vec<LogFinding>,
    /// Lines that describe how the columns were read.
    pub overview: Vec<String>,
    /// Rigid-body parts that the torque column contains besides friction.
    pub rigid_body: Vec<TermKind>,
    /// The mapped columns as the user gave them.
    pub columns: Vec<String>,
    /// Samples dropped at the start of each run.
    pub skip: usize,
    /// Every N-th sample of the residual is used.
    pub decimate: usize,
    /// True if the motion is used as logged.
    pub is_motion_logged: bool,
    /// Loss of the fits.
    pub loss: Loss,
    /// Seed of the choice of held-out runs.
    pub seed: u64,
}

impl Prepared {
    /// Returns the training rows.
    pub fn train_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.train, decimate: self.decimate }
    }

    /// Returns the test rows.
    pub fn test_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.test, decimate: self.decimate }
    }

    /// Returns the options of a diagnosis of this log, without a given model.
    pub fn question(&self) -> DiagnosisOptions {
        DiagnosisOptions {
            decimate: self.decimate,
            rigid_body: self.rigid_body.clone(),
            seed: self.seed,
            log_findings: self.log_findings.clone(),
            loss: self.loss,
            ..DiagnosisOptions::default()
        }
    }
}

/// Why a log could not be prepared, fitted or diagnosed. Each message is one line.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The log cannot be read or split.
    #[error(transparent)]
    Data(#[from] DataError),
    /// A model or a rigid-body part is unknown, or a model has too many terms.
    #[error(transparent)]
    Model(#[from] SpecError),
    /// The file of a model is wrong.
    #[error(transparent)]
    ParameterFile(#[from] ParameterFileError),
    /// A model cannot predict the log.
    #[error(transparent)]
    Prediction(#[from] PredictionError),
    /// A file cannot be read.
    #[error("{}: {error}", file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// A file is given twice.
    #[error("{}: file is given twice", .0.display())]
    Twice(PathBuf),
    /// No two rows are left for training, or for testing.
    #[error("found no continuous segment of at least two rows for training or for testing")]
    NoSegment,
    /// The request of a front end cannot be met.
    #[error("{0}")]
    Request(String),
    /// The caller stopped the computation.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl Message for Error {
    fn marked(&self) -> String {
        match self {
            Self::Data(error) => error.marked(),
            Self::Model(error) => error.marked(),
            Self::Request(message) => message.clone(),
            error => error.to_string(),
        }
    }
}

impl From<String> for Error {
    fn from(message: String) -> Self {
        Self::Request(message)
    }
}

/// Why kinds of findings cannot be left uncorrected, as the end of a message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AsLoggedError {
    /// The kind is only reported.
    #[error("{0} is never corrected")]
    NeverCorrected(String),
    /// There is no such kind.
    #[error("unknown kind {0:?}")]
    UnknownKind(String),
}

/// Reads, checks and splits the log of one joint. Reports the bytes read ([`work::report`]).
///
/// # Errors
/// If the log cannot be read or split, or holds several joints ([`DataError::SeveralJoints`]).
pub fn prepare(source: &Source, options: &PrepareOptions) -> Result<Prepared, Error> {
    let data = source.read(&options.read)?;
    work::report_stage("checking the log");
    log_check::refuse(&data)?;
    check_gravity(&data, &options.rigid_body)?;
    let checked = log_check::check(data, options.corrections);
    let is_motion_logged = checked.is_motion_logged || !options.corrections.motion;
    let CheckedLog { data, findings: log_findings, overview, suspicion, .. } = checked;
    if let Some(suspicion) = suspicion {
        return Err(suspicion.error(&data).into());
    }
    let overview = overview.lines(&data);
    let split = joint_log::split(&data, &options.split, options.seed)?;
    let start = campaign_start(&data);
    let of = |parts: &[Part]| tracks_since(&data.select(parts), None, start);
    let (train, test) = (of(&split.train), of(&split.test));
    if train.is_empty() || test.is_empty() {
        return Err(Error::NoSegment);
    }
    let has_spikes = data.runs.iter().any(|run| !run.torque_spikes.is_empty());
    // Where most rows of a held channel are left out, the others are too sparse for reversals: a few large errors there.
    let is_sparse = log_findings
        .iter()
        .any(|finding| finding.kind == LogFindingKind::HeldChannel && finding.corrected);
    let automatic = if has_spikes || is_sparse { Loss::Huber } else { Loss::Squares };
    Ok(Prepared {
        joint: None,
        data,
        split,
        train,
        test,
        hashes: source.hashes()?,
        log_findings,
        overview,
        rigid_body: options.rigid_body.clone(),
        columns: options.columns.clone(),
        skip: options.read.skip,
        decimate: options.decimate,
        is_motion_logged,
        loss: options.loss.unwrap_or(automatic),
        seed: options.seed,
    })
}

/// Refuses the torque of gravity for a log without a position, of which it is a function.
fn check_gravity(data: &Dataset, rigid_body: &[TermKind]) -> Result<(), DataError> {
    let has_position = data.runs.iter().all(|run| run.get(Quantity::Position).is_some());
    if has_position || !rigid_body.contains(&TermKind::GravityImbalance) {
        return Ok(());
    }
    let name = Quantity::Position.name(data.joint);
    Err(DataError::Request {
        what: Setting::RigidBody.given("gravity"),
        found: "a log without a position".into(),
        expected: format!(
            "the column {name}, or {}",
            Setting::Columns.suggested(format!("{name}=NAME"))
        ),
    })
}

/// Fits each model with the rigid-body parts of the log. Reports the model at work ([`work::report_stage`]).
///
/// # Errors
/// If a model has more terms than the core takes.
pub fn identify_each(
    specs: &[Spec],
    input: &Prepared,
    choices: Choices,
    options: &FitOptions,
) -> Result<Vec<Outcome>, SpecError> {
    let fit = |spec: &Spec| {
        let spec = spec.clone().on(&input.rigid_body);
        work::report_stage(&format!("fitting {spec} to {} rows", input.data.rows));
        let mut base = spec.parameters()?;
        base.choices = choices;
        let (train, test) = (input.train_rows(), input.test_rows());
        Ok(identify_robustly(input.loss, &spec, &base, train, test, options))
    };
    specs.iter().map(fit).collect()
}

/// Returns the corrections of a log without those of some kinds. `motion` selects the reconstructed motion; `None` that to
/// which the torque is closer.
///
/// # Errors
/// Returns the first name that is no kind, or a kind that is never corrected, as the end of a message.
pub fn corrections(
    motion: Option<bool>,
    as_logged: &[String],
) -> Result<Corrections, AsLoggedError> {
    let mut correct = Corrections::of_motion(motion);
    for name in as_logged {
        match LogFindingKind::parse(name.trim()) {
            Some(
                LogFindingKind::VelocityNoise
                | LogFindingKind::VelocityLag
                | LogFindingKind::Quantised,
            ) => {
                correct.motion = false;
            }
            Some(
                LogFindingKind::ChannelLag
                | LogFindingKind::Saturated
                | LogFindingKind::ComputedTorque
                | LogFindingKind::TooLittle,
            ) => return Err(AsLoggedError::NeverCorrected(name.clone())),
            // The diagnosis detects a torque lag and a channel gain itself.
            Some(kind) => correct = correct.without(&[kind]),
            None => return Err(AsLoggedError::UnknownKind(name.clone())),
        }
    }
    Ok(correct)
}

/// Returns the SHA-256 of a file as hexadecimal digits.
///
/// # Errors
/// One line, if the file cannot be read.
pub fn file_sha256(file: &Path) -> Result<String, Error> {
    let failed = |error| Error::Io { file: file.to_owned(), error };
    let mut reader = std::fs::File::open(file).map_err(failed)?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    loop {
        work::checkpoint();
        match reader.read(&mut buffer).map_err(failed)? {
            0 => break,
            read => hasher.update(&buffer[..read]),
        }
    }
    Ok(hexadecimal(hasher))
}

/// Returns the SHA-256 of a table's contents as hexadecimal digits: of the name of each column, its number of rows, and its
/// cells (numbers little-endian, texts with their length). It is the same in every process, and not that of a file.
pub fn table_sha256(table: &Table) -> String {
    let mut hasher = Sha256::new();
    let mut bytes = Vec::new();
    let text = |text: &str, bytes: &mut Vec<u8>| {
        bytes.extend((text.len() as u64).to_le_bytes());
        bytes.extend(text.as_bytes());
    };
    for (name, cells) in &table.columns {
        text(name, &mut bytes);
        bytes.extend((cells.len() as u64).to_le_bytes());
        if let Cells::Unreadable { kind, .. } = cells {
            text(kind, &mut bytes);
        }
        for row in 0..cells.len() {
            match cells {
                Cells::Numbers(cells) => bytes.extend(cells[row].to_bits().to_le_bytes()),
                Cells::Integers(cells) | Cells::Stamps(cells) => {
                    bytes.push(u8::from(cells[row].is_some()));
                    bytes.extend(cells[row].unwrap_or_default().to_le_bytes());
                }
                Cells::Texts(cells) => text(&cells[row], &mut bytes),
                Cells::Mixed(_) => text(&cells.text_of(row), &mut bytes),
                Cells::Unreadable { .. } => {}
            }
            // Hashed in pieces, which is faster than cell by cell.
            if bytes.len() >= HASHED_BYTES {
                work::checkpoint();
                hasher.update(&bytes);
                bytes.clear();
            }
        }
    }
    hasher.update(&bytes);
    hexadecimal(hasher)
}

fn hexadecimal(hasher: Sha256) -> String {
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}
