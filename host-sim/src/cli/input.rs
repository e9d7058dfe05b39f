//! Command-line arguments of the commands that read measured data, and the reading itself.
//!
//! [`DataArguments`] names the files, their columns, the split into training and test rows, and the rigid-body parts.
//! [`DataArguments::read`] reads the files, checks the log, and returns tracks that are ready to fit.

use super::table;
use clap::Args;
use clap::builder::PossibleValuesParser;
use compensator_core::TermKind;
use friction_identification::data::{
    self, DataError, Dataset, Preset, ReadOptions, Split, SplitRule,
};
use friction_identification::fit::dataset_tracks::{campaign_start, tracks_since};
use friction_identification::fit::{Rows, Track};
use friction_identification::log_check::{
    self, CheckedLog, Corrections, LogFinding, LogFindingKind, overview,
};
use friction_identification::spec::parse_rigid_body;
use indicatif::{ProgressBar, ProgressStyle};
use sha2::{Digest, Sha256};
use std::collections::HashSet;
use std::io::{IsTerminal, Read};
use std::path::{Path, PathBuf};

/// The data files, and how to read and split them.
#[derive(Args, Clone, Debug)]
pub struct DataArguments {
    /// One or more files of measured data: CSV, JSON lines, Parquet, Arrow, MCAP or CAN traces; also in gzip or zip
    #[arg(required = true, value_name = "DATA")]
    pub data: Vec<PathBuf>,
    /// Files to hold out. By default whole runs are held out, or time blocks of a single run; `diagnose` holds out each
    /// run once
    #[arg(long, value_name = "DATA", num_args = 1..)]
    pub test: Vec<PathBuf>,
    /// Hold out the runs where COLUMN has one of the values. COLUMN is `run` or a column that is constant within each run
    #[arg(long, value_name = "COLUMN=VALUE,..", conflicts_with_all = ["test", "tail"])]
    pub hold_out: Option<String>,
    /// Hold out the end of each run; SHARE is between 0 and 1
    #[arg(long, value_name = "SHARE", conflicts_with = "test")]
    pub tail: Option<f64>,
    /// Names and units of the columns in the file: `torque_nm=tau_3:mNm,velocity_rad_s=dq_3:rpm,time_s=t:ms`. `:-Nm`
    /// reverses the sign; `:0.229rpm` is the size of one count, `:4096counts` the counts of a turn, `:0.1degC-40` a scale and
    /// an offset; `velocity[2]` is an element of a cell that contains a list. `help` lists the columns of each file
    #[arg(long, value_name = "a=b:unit,..", value_delimiter = ',')]
    pub columns: Vec<String>,
    /// Tool that wrote the log; supplies names and units of columns that `--columns` does not name
    #[arg(long, value_name = "TOOL", value_parser = PossibleValuesParser::new(Preset::ALL.map(Preset::name)))]
    pub from: Option<String>,
    /// Skip the first N lines of text of each file, above the header
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub skip_lines: usize,
    /// Torque of 100 %, for columns in percent: `--columns torque_nm=0x6077:0.1% --rated-torque 1.2Nm`
    #[arg(long, value_name = "TORQUE", value_parser = rated_torque_nm)]
    pub rated_torque: Option<f64>,
    /// Use only rows where COLUMN has one of the values. `joint=2` selects one joint, also if the joints have numbered
    /// columns (`torque_nm_1`, `torque_nm_2`); by default all joints are processed in turn. May be repeated
    #[arg(long = "where", value_name = "COLUMN=VALUE,..")]
    pub only: Vec<String>,
    /// Drop the first N samples of each run
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub skip: usize,
    /// Use every N-th sample of the residual, after an anti-aliasing filter; the simulation runs at the full rate
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub decimate: u32,
    /// Rigid-body parts that the torque column contains besides friction: inertia,gravity,load,offset,delay,gain
    #[arg(long, value_name = "PARTS", default_value = "")]
    pub rigid_body: String,
    /// Source of the motion: reconstructed from position and velocity, or the unchanged velocity column
    #[arg(long, value_name = "WHICH", value_enum, default_value_t = MotionFrom::Smoothed)]
    pub motion: MotionFrom,
    /// Log problems to report without correction: velocity-noise, velocity-lag, quantised (for these the motion is used as
    /// logged), outlier, held-channel, torque-lag
    #[arg(long, value_name = "KIND,..", value_delimiter = ',')]
    pub as_logged: Vec<String>,
    /// Seed of the choice of held-out runs; the same seed gives the same result
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Number of threads; 0 uses all cores
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: usize,
}

/// The value of `--columns` that lists the columns.
const COLUMNS_HELP: &str = "help";

/// Parses a torque with its unit, Nm.
fn rated_torque_nm(text: &str) -> Result<f64, String> {
    let torque_nm = data::parse_value("torque_nm", text).map_err(|e| format!("expected {e}"))?;
    let is_torque = torque_nm.is_finite() && torque_nm > 0.0;
    is_torque.then_some(torque_nm).ok_or_else(|| "expected a positive torque".to_owned())
}

/// Source of the motion.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum MotionFrom {
    /// Reconstructed from all motion columns.
    Smoothed,
    /// The unchanged velocity column.
    Logged,
}

/// The log of one joint, read, checked and split.
pub struct LogInput {
    /// All runs.
    pub data: Dataset,
    /// Training and test parts of the runs.
    pub split: Split,
    /// Training tracks.
    pub train: Vec<Track>,
    /// Test tracks.
    pub test: Vec<Track>,
    /// Rigid-body parts that the torque column contains besides friction.
    pub rigid_body: Vec<TermKind>,
    /// SHA-256 of each file.
    pub hashes: Vec<String>,
    /// Problems of the log itself.
    pub log_findings: Vec<LogFinding>,
    /// Prefix of messages, `joint NAME: `; empty for a log of one joint.
    message_prefix: String,
    decimate: usize,
}

impl LogInput {
    /// Returns the training rows.
    pub fn train_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.train, decimate: self.decimate }
    }

    /// Prints the problems of the log on standard error, so that standard output contains the result only.
    pub fn print_log_findings(&self) {
        for finding in &self.log_findings {
            let prefix = &self.message_prefix;
            eprintln!("log: {prefix}{}: {}", finding.kind.name(), finding.in_words);
        }
    }

    /// Returns the test rows.
    pub fn test_rows(&self) -> Rows<'_> {
        Rows { tracks: &self.test, decimate: self.decimate }
    }
}

/// The data of a command.
pub enum LogInputs {
    /// The log of one joint.
    One(Box<LogInput>),
    /// The logs of several joints, each with the joint's name.
    Several(Vec<(String, LogInput)>),
}

/// Reason why a log cannot be read as the log of one joint.
enum ReadFailure {
    /// The log contains several joints.
    Several { column: String, joints: Vec<String> },
    /// Any other error, as one line for the user.
    Other(String),
}

impl From<String> for ReadFailure {
    fn from(line: String) -> Self {
        Self::Other(line)
    }
}

impl From<DataError> for ReadFailure {
    fn from(error: DataError) -> Self {
        match error {
            DataError::SeveralJoints { column, joints, .. } => Self::Several { column, joints },
            other => Self::Other(other.to_string()),
        }
    }
}

impl DataArguments {
    /// Reads, checks and splits the log of one joint, or of each joint of a log with several. `default_split` applies if
    /// the user gives no split.
    ///
    /// # Errors
    /// Returns one line for the user.
    pub fn read(&self, default_split: &SplitRule) -> Result<LogInputs, String> {
        let (column, joints) = match self.read_one(default_split, String::new()) {
            Ok(input) => return Ok(LogInputs::One(Box::new(input))),
            Err(ReadFailure::Other(line)) => return Err(line),
            Err(ReadFailure::Several { column, joints }) => (column, joints),
        };
        let each = joints.into_iter().map(|joint| {
            let mut alone = self.clone();
            alone
                .only
                .retain(|text| text.split_once('=').is_none_or(|(own, _)| own.trim() != column));
            alone.only.push(format!("{column}={joint}"));
            match alone.read_one(default_split, format!("joint {joint}: ")) {
                Ok(input) => Ok((joint, input)),
                Err(ReadFailure::Other(line)) => Err(format!("joint {joint}: {line}")),
                Err(ReadFailure::Several { column, joints }) => {
                    let names = joints.join(", ");
                    Err(format!("joint {joint}: found several in {column} ({names}), expected one"))
                }
            }
        });
        each.collect::<Result<_, _>>().map(LogInputs::Several)
    }

    /// Reads the log of one joint. `message_prefix` precedes each message about it.
    fn read_one(
        &self,
        default_split: &SplitRule,
        message_prefix: String,
    ) -> Result<LogInput, ReadFailure> {
        if self.threads > 0 {
            // If the process already has a global pool (tests), that pool stays.
            let _ = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build_global();
        }
        let rigid_body = parse_rigid_body(&self.rigid_body).map_err(|e| e.to_string())?;
        let files: Vec<PathBuf> = self.data.iter().chain(&self.test).cloned().collect();
        let mut seen = HashSet::new();
        if let Some(twice) = files.iter().find(|file| !seen.insert(*file)) {
            return Err(format!("{}: file is given twice", twice.display()).into());
        }
        let correct = self.correct()?;
        let options = self.read_options()?;
        let bar = progress();
        let data = data::read(&files, &options, &|done, total| {
            bar.set_length(total);
            bar.set_position(done);
        })
        .map_err(ReadFailure::from)?;
        bar.finish_and_clear();
        let overview_lines = overview(&data).lines(&data);
        let CheckedLog { data, findings: log_findings, .. } = log_check::check(data, correct);
        let split = data::split(&data, &self.split_rule(default_split)?, self.seed)?;
        let start = campaign_start(&data);
        let of = |parts: &[data::Part]| tracks_since(&data.select(parts), None, start);
        let (train, test) = (of(&split.train), of(&split.test));
        if train.is_empty() || test.is_empty() {
            let line =
                "found no continuous segment of at least two rows for training or for testing";
            return Err(line.to_owned().into());
        }
        let hashes = files.iter().map(|file| hash(file)).collect::<Result<_, String>>()?;
        let decimate = self.decimate as usize;
        // Printed after the last possible error, so that an error stays the only line.
        overview_lines.iter().for_each(|line| eprintln!("log: {message_prefix}{line}"));
        Ok(LogInput {
            message_prefix,
            data,
            split,
            train,
            test,
            rigid_body,
            hashes,
            log_findings,
            decimate,
        })
    }

    /// Returns the kinds of `--as-logged`, which are not corrected. Unknown names are reported by [`Self::read`].
    pub fn kinds_as_logged(&self) -> Vec<LogFindingKind> {
        self.as_logged.iter().filter_map(|name| LogFindingKind::parse(name.trim())).collect()
    }

    /// Returns the corrections that the log check applies.
    fn correct(&self) -> Result<Corrections, String> {
        let mut correct =
            Corrections { motion: self.motion == MotionFrom::Smoothed, ..Corrections::default() };
        for name in &self.as_logged {
            match LogFindingKind::parse(name.trim()) {
                Some(
                    LogFindingKind::VelocityNoise
                    | LogFindingKind::VelocityLag
                    | LogFindingKind::Quantised,
                ) => {
                    correct.motion = false;
                }
                Some(LogFindingKind::Outlier) => correct.outliers = false,
                Some(LogFindingKind::HeldChannel) => correct.held = false,
                // The diagnosis detects this kind and reads [`Self::kinds_as_logged`].
                Some(LogFindingKind::TorqueLag) => {}
                Some(_) => return Err(format!("--as-logged: {name} is never corrected")),
                None => return Err(format!("--as-logged: unknown kind {name:?}")),
            }
        }
        Ok(correct)
    }

    /// Returns how the files are read.
    fn read_options(&self) -> Result<ReadOptions, String> {
        Ok(ReadOptions {
            columns: self.column_pairs()?,
            only: self.row_filters()?,
            skip: self.skip,
            skip_lines: self.skip_lines,
            preset: self.from.as_deref().and_then(Preset::parse),
            rated_torque_nm: self.rated_torque,
            ..ReadOptions::default()
        })
    }

    /// Returns the description of the columns that `--columns help` asks for; `None` if it is not asked for.
    ///
    /// # Errors
    /// Returns one line if a file cannot be read.
    pub fn described_columns(&self) -> Result<Option<String>, String> {
        if self.columns.iter().all(|text| text.trim() != COLUMNS_HELP) {
            return Ok(None);
        }
        let others = self.columns.iter().filter(|text| text.trim() != COLUMNS_HELP).cloned();
        let options = Self { columns: others.collect(), ..self.clone() }.read_options()?;
        let files = self.data.iter().chain(&self.test);
        let described = files.map(|file| {
            let survey = data::survey(file, &options).map_err(|error| error.to_string())?;
            Ok(table::columns(file, &survey))
        });
        described.collect::<Result<Vec<_>, String>>().map(|texts| Some(texts.join("\n")))
    }

    fn column_pairs(&self) -> Result<Vec<(String, String)>, String> {
        let pair = |text: &String| match text.split_once('=') {
            Some((ours, theirs)) if !ours.is_empty() && !theirs.is_empty() => {
                Ok((ours.trim().to_owned(), self.in_nm(theirs.trim())))
            }
            _ => {
                Err(format!("--columns: found {text:?}, expected NAME=COLUMN or NAME=COLUMN:UNIT"))
            }
        };
        self.columns.iter().map(pair).collect()
    }

    /// Returns a column of `--columns` with a unit in percent of the rated torque replaced by one in Nm.
    fn in_nm(&self, column: &str) -> String {
        let parts = || {
            let rated_nm = self.rated_torque?;
            let (name, share) = column.strip_suffix('%')?.rsplit_once(':')?;
            let share = match share.trim() {
                "" => 1.0,
                "-" => -1.0,
                share => share.parse::<f64>().ok()?,
            };
            Some((name, share * rated_nm / 100.0))
        };
        parts().map_or_else(|| column.to_owned(), |(name, nm)| format!("{name}:{nm}Nm"))
    }

    /// Parses `--where` into columns and their accepted values.
    fn row_filters(&self) -> Result<Vec<(String, Vec<String>)>, String> {
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

    fn split_rule(&self, default_split: &SplitRule) -> Result<SplitRule, String> {
        if !self.test.is_empty() {
            return Ok(SplitRule::Files(self.test.clone()));
        }
        if let Some(text) = &self.hold_out {
            return SplitRule::parse_hold_out(text).map_err(|error| error.to_string());
        }
        Ok(self.tail.map_or_else(|| default_split.clone(), |share| SplitRule::Tail { share }))
    }
}

/// Returns a progress bar; it is hidden if standard error is not a terminal.
fn progress() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("reading {wide_bar} {bytes}/{total_bytes}");
    ProgressBar::new(0).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Returns a spinner; it is hidden if standard error is not a terminal.
pub fn spinner(what: String) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::new_spinner().with_message(what);
    bar.enable_steady_tick(std::time::Duration::from_millis(120));
    bar
}

/// Returns the SHA-256 of a file as hexadecimal digits.
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
