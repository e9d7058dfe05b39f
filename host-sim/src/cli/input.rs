//! What every command that reads data shares: files, columns, split, rigid body.

use clap::Args;
use compensator_core::TermKind;
use friction_identification::data::{self, DataError, Dataset, ReadOptions, Split, SplitRule};
use friction_identification::fit::track::{campaign_start, tracks_since};
use friction_identification::fit::{Rows, Track};
use friction_identification::log_check::{self, Checked, Correct, Kind, LogFinding, overview};
use friction_identification::spec::parse_rigid_body;
use indicatif::{ProgressBar, ProgressStyle};
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::io::{IsTerminal, Read};
use std::path::{Path, PathBuf};

/// Data and how to read and split it.
#[derive(Args, Clone, Debug)]
pub struct DataArguments {
    /// Measured data: CSV, Parquet, MCAP or CAN traces, one or more files
    #[arg(required = true, value_name = "DATA")]
    pub data: Vec<PathBuf>,
    /// Held-out files; without them whole runs (or time blocks of a single run) are held out: of `diagnose`
    /// each run once
    #[arg(long, value_name = "DATA", num_args = 1..)]
    pub test: Vec<PathBuf>,
    /// Hold out the runs where COLUMN (constant within a run, or `run`) has one of the values
    #[arg(long, value_name = "COLUMN=VALUE,..", conflicts_with_all = ["test", "tail"])]
    pub hold_out: Option<String>,
    /// Hold out the last share of each run, 0 to 1
    #[arg(long, value_name = "SHARE", conflicts_with = "test")]
    pub tail: Option<f64>,
    /// Foreign columns, with their units: `torque_nm=tau_3:mNm,velocity_rad_s=dq_3:rpm,time_s=t:ms`; `:-Nm` turns
    /// the sign, `velocity[2]` is an element where cells hold lists
    #[arg(long, value_name = "a=b:unit,..", value_delimiter = ',')]
    pub columns: Vec<String>,
    /// Only the rows where COLUMN is one of the values: one joint of several (`joint=2` also where joints stand
    /// side by side as `torque_nm_1`, `torque_nm_2`); without it all are taken, one by one. May be given again
    #[arg(long = "where", value_name = "COLUMN=VALUE,..")]
    pub only: Vec<String>,
    /// Drop the first N samples of each run
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub skip: usize,
    /// Judge every N-th sample of the residual, anti-aliased; the simulation runs at the full rate
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub decimate: u32,
    /// Parts of the torque column that are not friction: inertia,gravity,load,offset,delay,gain
    #[arg(long, value_name = "PARTS", default_value = "")]
    pub rigid_body: String,
    /// The motion as reconstructed from position and velocity, or the velocity column as it stands
    #[arg(long, value_name = "WHICH", value_enum, default_value_t = MotionFrom::Smoothed)]
    pub motion: MotionFrom,
    /// Findings about the log that are told but not corrected: velocity-noise, velocity-lag, quantised (the
    /// motion is taken as logged), outlier, held-channel, torque-lag
    #[arg(long, value_name = "KIND,..", value_delimiter = ',')]
    pub as_logged: Vec<String>,
    /// Chooses which runs are held out; the same seed, the same result
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Threads; 0 for all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
}

/// Where the motion comes from.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionFrom {
    /// Reconstructed from all columns that speak of it.
    Smoothed,
    /// The velocity column as it stands.
    Logged,
}

/// Data read and split.
pub struct Input {
    /// All runs.
    pub data: Dataset,
    /// What is fitted on and judged by.
    pub split: Split,
    /// Tracks to fit on.
    pub train: Vec<Track>,
    /// Tracks to judge by.
    pub test: Vec<Track>,
    /// Parts of the torque column that are not friction.
    pub rigid_body: Vec<TermKind>,
    /// SHA-256 of each file.
    pub hashes: Vec<String>,
    /// What is wrong with the log itself.
    pub log_findings: Vec<LogFinding>,
    /// Which joint of several, as the beginning of a line; empty where there is one.
    joint: String,
    decimate: usize,
}

impl Input {
    /// Rows to fit on.
    pub fn train_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.train, decimate: self.decimate }
    }

    /// Tells what is wrong with the log on standard error, which a result on standard output leaves alone.
    pub fn warn(&self) {
        for finding in &self.log_findings {
            eprintln!("log: {}{}: {}", self.joint, finding.kind.name(), finding.in_words);
        }
    }

    /// Rows to judge by.
    pub fn test_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.test, decimate: self.decimate }
    }
}

/// What was read.
pub enum Inputs {
    /// The log of one joint.
    One(Box<Input>),
    /// Of several, each with its name.
    Several(Vec<(String, Input)>),
}

/// Why a log was not read.
enum Unread {
    /// It holds several joints.
    Several { column: String, joints: Vec<String> },
    /// One line for a person.
    Other(String),
}

impl From<String> for Unread {
    fn from(line: String) -> Self {
        Self::Other(line)
    }
}

impl From<DataError> for Unread {
    fn from(error: DataError) -> Self {
        match error {
            DataError::SeveralJoints { column, joints, .. } => Self::Several { column, joints },
            other => Self::Other(other.to_string()),
        }
    }
}

impl DataArguments {
    /// Reads and splits, by a rule of the command's own where the user names none: the log of one joint, or of
    /// each joint where there are several, with their names.
    ///
    /// # Errors
    /// One line for a person.
    pub fn read(&self, unless_asked: &SplitRule) -> Result<Inputs, String> {
        let (column, joints) = match self.read_one(unless_asked, String::new()) {
            Ok(input) => return Ok(Inputs::One(Box::new(input))),
            Err(Unread::Other(line)) => return Err(line),
            Err(Unread::Several { column, joints }) => (column, joints),
        };
        let each = joints.into_iter().map(|joint| {
            let mut alone = self.clone();
            alone
                .only
                .retain(|text| text.split_once('=').is_none_or(|(own, _)| own.trim() != column));
            alone.only.push(format!("{column}={joint}"));
            match alone.read_one(unless_asked, format!("joint {joint}: ")) {
                Ok(input) => Ok((joint, input)),
                Err(Unread::Other(line)) => Err(format!("joint {joint}: {line}")),
                Err(Unread::Several { column, joints }) => {
                    let names = joints.join(", ");
                    Err(format!("joint {joint}: found several in {column} ({names}), expected one"))
                }
            }
        });
        each.collect::<Result<_, _>>().map(Inputs::Several)
    }

    /// The log of one joint; `joint` stands before what is told of it.
    fn read_one(&self, unless_asked: &SplitRule, joint: String) -> Result<Input, Unread> {
        if self.threads > 0 {
            // A second call in one process (tests) keeps the first pool.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build_global();
        }
        let rigid_body = parse_rigid_body(&self.rigid_body).map_err(|e| e.to_string())?;
        let files: Vec<PathBuf> = self.data.iter().chain(&self.test).cloned().collect();
        let mut seen = HashSet::new();
        if let Some(twice) = files.iter().find(|file| !seen.insert(*file)) {
            return Err(format!("{}: given twice", twice.display()).into());
        }
        let correct = self.correct()?;
        let options =
            ReadOptions { columns: self.column_pairs()?, only: self.chosen()?, skip: self.skip };
        let bar = progress();
        let data = data::read(&files, &options, &|done, total| {
            bar.set_length(total);
            bar.set_position(done);
        })
        .map_err(Unread::from)?;
        bar.finish_and_clear();
        let told = overview(&data).lines(&data);
        let Checked { data, findings: log_findings, .. } = log_check::check(data, correct);
        let split = data::split(&data, &self.split_rule(unless_asked)?, self.seed)?;
        let start = campaign_start(&data);
        let of = |parts: &[data::Part]| tracks_since(&data.select(parts), None, start);
        let (train, test) = (of(&split.train), of(&split.test));
        if train.is_empty() || test.is_empty() {
            let line = "no unbroken stretch of two rows or more to fit on and to judge by";
            return Err(line.to_owned().into());
        }
        let hashes = files.iter().map(|file| hash(file)).collect::<Result<_, String>>()?;
        let decimate = self.decimate as usize;
        // Behind the last refusal, which is to be the one line there is.
        told.iter().for_each(|line| eprintln!("log: {joint}{line}"));
        Ok(Input { joint, data, split, train, test, rigid_body, hashes, log_findings, decimate })
    }

    /// Findings that are not to be corrected; names that are none have been refused.
    pub fn kinds_as_logged(&self) -> Vec<Kind> {
        self.as_logged.iter().filter_map(|name| Kind::parse(name.trim())).collect()
    }

    /// What is to be corrected.
    fn correct(&self) -> Result<Correct, String> {
        let mut correct =
            Correct { motion: self.motion == MotionFrom::Smoothed, ..Correct::default() };
        for name in &self.as_logged {
            match Kind::parse(name.trim()) {
                Some(Kind::VelocityNoise | Kind::VelocityLag | Kind::Quantised) => {
                    correct.motion = false;
                }
                Some(Kind::Outlier) => correct.outliers = false,
                Some(Kind::HeldChannel) => correct.held = false,
                // What the diagnosis finds, and leaves alone if it is asked to ([`Self::kinds_as_logged`]).
                Some(Kind::TorqueLag) => {}
                Some(_) => return Err(format!("--as-logged: {name} is never corrected")),
                None => return Err(format!("--as-logged: unknown kind {name:?}")),
            }
        }
        Ok(correct)
    }

    fn column_pairs(&self) -> Result<Vec<(String, String)>, String> {
        let pair = |text: &String| match text.split_once('=') {
            Some((ours, theirs)) if !ours.is_empty() && !theirs.is_empty() => {
                Ok((ours.trim().to_owned(), theirs.trim().to_owned()))
            }
            _ => {
                Err(format!("--columns: found {text:?}, expected NAME=COLUMN or NAME=COLUMN:UNIT"))
            }
        };
        self.columns.iter().map(pair).collect()
    }

    /// What `--where` asks for.
    fn chosen(&self) -> Result<Vec<(String, Vec<String>)>, String> {
        let choice = |text: &String| {
            let parts = text.split_once('=').map(|(column, values)| {
                let values: Vec<String> = values.split(',').map(|v| v.trim().to_owned()).collect();
                (column.trim().to_owned(), values)
            });
            parts
                .filter(|(column, _)| !column.is_empty())
                .ok_or_else(|| format!("--where: found {text:?}, expected COLUMN=VALUE"))
        };
        self.only.iter().map(choice).collect()
    }

    fn split_rule(&self, unless_asked: &SplitRule) -> Result<SplitRule, String> {
        if !self.test.is_empty() {
            return Ok(SplitRule::Files(self.test.clone()));
        }
        if let Some(text) = &self.hold_out {
            return SplitRule::parse_hold_out(text).map_err(|error| error.to_string());
        }
        Ok(self.tail.map_or_else(|| unless_asked.clone(), |share| SplitRule::Tail { share }))
    }
}

/// A bar on a terminal, nothing in a pipe.
fn progress() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("reading {wide_bar} {bytes}/{total_bytes}");
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// A spinner on a terminal, nothing in a pipe.
pub fn spinner(what: String) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner().with_message(what);
    bar.enable_steady_tick(std::time::Duration::from_millis(120));
    bar
}

/// SHA-256 of a file.
pub(super) fn hash(file: &Path) -> Result<String, String> {
    let failed = |error: std::io::Error| format!("{}: {error}", file.display());
    let mut reader = std::fs::File::open(file).map_err(failed)?;
    let mut hasher = Sha256::new();
    let mut buffer = vec![0; 1 << 20];
    loop {
        match reader.read(&mut buffer).map_err(failed)? {
            0 => break,
            read => hasher.update(&buffer[..read]),
        }
    }
    Ok(hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
