//! Command-line arguments of the commands that read measured data, and the reading itself.
//!
//! [`DataArguments`] names the files, their columns, the split into training and test rows, and the rigid-body parts.
//! [`DataArguments::read`] reads the files, checks the log, reports its problems before any fit, and returns tracks that are
//! ready to fit.

use super::output::print_message;
use super::table;
use super::words::{in_options, text_in_options};
use clap::Args;
use clap::builder::PossibleValuesParser;
use friction_diagnose::prepare::{
    Error, PrepareOptions, Prepared, Source, corrections, percent_of_torque, prepare,
};
use friction_fit::Loss;
use friction_fit::spec::parse_rigid_body;
use indicatif::{HumanBytes, ProgressBar, ProgressStyle};
use joint_log::log_check::LogFindingKind;
use joint_log::work::{self, Cancelled, Progress};
use joint_log::{DataError, JOINT, Preset, ReadOptions, SplitRule};
use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::path::PathBuf;

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

    /// Read one joint of a log with several: its number or name. By default all are processed in turn
    #[arg(long, value_name = "JOINT")]
    pub joint: Option<String>,
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
    /// logged), wrapped-angle, outlier, held-channel, torque-lag
    #[arg(long, value_name = "KIND,..", value_delimiter = ',')]
    pub as_logged: Vec<String>,
    /// Loss of the fits: `squares`; `huber`, where errors of single rows beyond 2.5 standard deviations count linearly;
    /// `auto` uses huber if the torque has many spikes
    #[arg(long, value_name = "WHICH", value_enum, default_value_t = LossChoice::Auto)]
    pub loss: LossChoice,
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
    let torque_nm = joint_log::parse_value("torque_nm", text)
        .map_err(|e| format!("expected {}", text_in_options(&e)))?;
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

/// Loss of the fits.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum LossChoice {
    /// Huber's loss if the torque has many spikes, else squares.
    Auto,
    /// Squared errors.
    Squares,
    /// Huber's loss.
    Huber,
}

/// The data of a command.
pub enum LogInputs {
    /// The log of one joint.
    One(Box<Prepared>),
    /// The logs of several joints, each with the joint's name.
    Several(Vec<(String, Prepared)>),
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

impl From<Error> for ReadFailure {
    fn from(error: Error) -> Self {
        match error {
            Error::Data(DataError::SeveralJoints { column, joints, .. }) => {
                Self::Several { column, joints }
            }
            other => Self::Other(in_options(other)),
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
        let (column, joints) = match self.read_one(default_split, None) {
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
            match alone.read_one(default_split, Some(&joint)) {
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

    /// Reads the log of one joint. `joint` is its name if the log has several.
    fn read_one(
        &self,
        default_split: &SplitRule,
        joint: Option<&str>,
    ) -> Result<Prepared, ReadFailure> {
        let files: Vec<PathBuf> = self.data.iter().chain(&self.test).cloned().collect();
        let options = self.options(default_split)?;
        let mut input = in_stages(self.threads, || prepare(&Source::Files(files), &options))
            .map_err(ReadFailure::from)?;
        input.joint = joint.map(str::to_owned);
        // Printed after the last possible error, so that an error stays the only line.
        print_log(&input);
        if input.loss == Loss::Huber && self.loss == LossChoice::Auto {
            print_lines(&input, [SPIKES.to_owned()].into_iter());
        }
        Ok(input)
    }

    /// Returns how a log is read, checked and split.
    ///
    /// # Errors
    /// Returns one line for the user.
    pub fn options(&self, default_split: &SplitRule) -> Result<PrepareOptions, String> {
        let rigid_body = parse_rigid_body(&self.rigid_body).map_err(in_options)?;
        let corrections = corrections(self.motion == MotionFrom::Smoothed, &self.as_logged)
            .map_err(|end| format!("--as-logged: {end}"))?;
        Ok(PrepareOptions {
            read: self.read_options()?,
            columns: self.columns.clone(),
            corrections,
            split: self.split_rule(default_split)?,
            seed: self.seed,
            rigid_body,
            decimate: self.decimate as usize,
            loss: match self.loss {
                LossChoice::Auto => None,
                LossChoice::Squares => Some(Loss::Squares),
                LossChoice::Huber => Some(Loss::Huber),
            },
        })
    }

    /// Returns the kinds of `--as-logged`, which are not corrected. Unknown names are reported by [`Self::read`].
    pub fn kinds_as_logged(&self) -> Vec<LogFindingKind> {
        self.as_logged.iter().filter_map(|name| LogFindingKind::parse(name.trim())).collect()
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
            let survey = joint_log::survey(file, &options).map_err(in_options)?;
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
        let rated = self.rated_torque.and_then(|rated_nm| percent_of_torque(column, rated_nm));
        rated.unwrap_or_else(|| column.to_owned())
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
        let joint = self.joint.iter().map(|joint| Ok((JOINT.to_owned(), vec![joint.clone()])));
        self.only.iter().map(choice).chain(joint).collect()
    }

    fn split_rule(&self, default_split: &SplitRule) -> Result<SplitRule, String> {
        if !self.test.is_empty() {
            return Ok(SplitRule::Files(self.test.clone()));
        }
        if let Some(text) = &self.hold_out {
            return SplitRule::parse_hold_out(text).map_err(in_options);
        }
        Ok(self.tail.map_or_else(|| default_split.clone(), |share| SplitRule::Tail { share }))
    }
}

/// Remark on a loss that the user did not select.
const SPIKES: &str = "the loss is huber because of the spikes; --loss squares changes it";

/// Prints the columns of a log and its problems on standard error, so that standard output contains the result only.
fn print_log(input: &Prepared) {
    let findings = input.log_findings.iter();
    let problems = findings.map(|finding| format!("{}: {}", finding.kind.name(), finding.in_words));
    print_lines(input, input.overview.iter().cloned().chain(problems));
}

/// Prints lines about a log, with the joint's name if the log has several.
fn print_lines(input: &Prepared, lines: impl Iterator<Item = String>) {
    let joint = input.joint.as_ref().map_or(String::new(), |joint| format!("joint {joint}: "));
    lines.for_each(|line| print_message(&format!("log: {joint}{line}")));
}

/// Runs a long computation on `threads` threads, 0 for all cores. Its state is shown on standard error if that is a
/// terminal. Ctrl-C ends the process.
///
/// # Errors
/// Returns the error of the computation.
pub fn in_stages<R: Send, E: Send + From<Cancelled>>(
    threads: usize,
    work: impl FnOnce() -> Result<R, E> + Send,
) -> Result<R, E> {
    let bar = spinner(String::new());
    let shown = |progress: &Progress| {
        match progress {
            Progress::Reading { done, total } => {
                bar.set_message(format!("reading {} of {}", HumanBytes(*done), HumanBytes(*total)));
            }
            Progress::Stage(stage) => bar.set_message(stage.clone()),
        }
        ControlFlow::Continue(())
    };
    let outcome = work::run(threads, &shown, work);
    bar.finish_and_clear();
    outcome
}

/// Returns a bar of counted items with the remaining time; it is hidden if standard error is not a terminal.
pub fn counted_progress(what: &str, items: &str, total: u64) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let template = format!("{what} {{wide_bar}} {{pos}}/{{len}} {items}, {{eta}} left");
    let style = ProgressStyle::with_template(&template);
    let bar = ProgressBar::new(total);
    let bar = bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.tick();
    bar
}

/// Prints a message on standard error, if that is a terminal: what a command is about to do, and how long it takes.
pub fn announce(message: &str) {
    if std::io::stderr().is_terminal() {
        print_message(message);
    }
}

/// Formats a duration: `45 s`, `8 min 20 s`, `2 h 5 min`.
pub fn duration_in_words(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0 => "less than 1 s".to_owned(),
        1..=119 => format!("{whole} s"),
        120..=7199 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole / 60 % 60),
    }
}

/// Returns a spinner with the elapsed time; it is hidden if standard error is not a terminal.
pub fn spinner(what: String) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {wide_msg} [{elapsed}]");
    let style = style.unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style).with_message(what);
    bar.enable_steady_tick(std::time::Duration::from_millis(120));
    bar
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn duration_in_words_uses_two_units_at_most() {
        for (seconds, words) in
            [(0.2, "less than 1 s"), (45.3, "45 s"), (500.0, "8 min 20 s"), (7500.0, "2 h 5 min")]
        {
            assert_eq!(duration_in_words(seconds), words);
        }
    }
}
